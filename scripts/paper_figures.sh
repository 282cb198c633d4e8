#!/bin/sh
# The paper's result figures (6, 7, 9 to 12) from this program, and for Fig. 6 from Exudyn as well, into results/figures:
# scripts/paper_figures.sh
#
# Builds the release binary unless SWEEP names one. Traces, modes and the map stay in results/ as Parquet; the map of Fig. 12 is
# the longest, and is taken as it is if it is there.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
if [ -z "${SWEEP:-}" ]; then
    cargo build --release
    SWEEP=$root/target/release/sweep
fi
figures=results/figures
mkdir -p "$figures"

"$SWEEP" modes --speed 0:1200:10 --out results/fig7.parquet
"$SWEEP" plot results/fig7.parquet -o "$figures/fig7.svg"

# Instants close enough that 1200 rpm, 20 turns a second, keeps its peaks.
for name in fig6 fig10 fig11; do
    "$SWEEP" trace "sweeps/$name.toml" --every 0.002 --out "results/$name.parquet"
done
"$SWEEP" plot results/fig6.parquet --modes results/fig7.parquet -o "$figures/fig9.svg"
for name in fig10 fig11; do
    "$SWEEP" plot "results/$name.parquet" --modes results/fig7.parquet -o "$figures/$name.svg"
done

"$SWEEP" run sweeps/fig12.toml --progress plain
"$SWEEP" plot results/fig12.parquet -o "$figures/fig12.svg"

# Fig. 6 needs the other program, half a minute of it.
scripts/crosscheck.sh --sweep "$SWEEP" --trace results/fig6_exudyn.parquet
"$SWEEP" plot results/fig6.parquet --against results/fig6_exudyn.parquet --modes results/fig7.parquet -o "$figures/fig6.svg"
