#!/bin/sh
# Draws the paper's figures of results (6 to 12) by this program, Fig. 6 also by Exudyn, into
# results/figures: scripts/figures/paper_figures.sh
#
# Builds the release binary unless SWEEP names one. Traces, modes and the map are kept in results/
# as Parquet files. The map of Fig. 12 takes longest, and is not computed again if it exists.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
cd "$root"
if [ -z "${SWEEP:-}" ]; then
    cargo build --release
    SWEEP=$root/target/release/sweep
fi
figures=results/figures
mkdir -p "$figures"

"$SWEEP" modes --speed 0:1200:10 --out results/fig7.parquet
"$SWEEP" plot results/fig7.parquet -o "$figures/fig7.svg"
"$SWEEP" plot results/fig7.parquet --view variation -o "$figures/fig7b.svg"
"$SWEEP" plot results/fig7.parquet --view shapes -o "$figures/fig8.svg"

# The interval resolves the peaks at 1200 rpm, which are 20 turns per second.
for name in fig6 fig10 fig11; do
    "$SWEEP" trace "sweeps/$name.toml" --every 0.002 --out "results/$name.parquet"
done
"$SWEEP" plot results/fig6.parquet --modes results/fig7.parquet -o "$figures/fig9.svg"
# The options for both channels of the machine's mass centre.
centre="--channel total_centre_y --channel total_centre_z"
for name in fig10 fig11; do
    modes=results/$name-modes.parquet
    "$SWEEP" modes "sweeps/$name.toml" --speed 0:1200:10 --out "$modes"
    "$SWEEP" plot "results/$name.parquet" --modes "$modes" -o "$figures/$name.svg"
    # shellcheck disable=SC2086 # a list of options
    "$SWEEP" plot "results/$name.parquet" $centre --modes "$modes" \
        -o "$figures/${name}_centre.svg"
done

# Draws the run of Fig. 11 with the speeds at which a dwell would be unstable.
"$SWEEP" stability sweeps/fig11.toml --speed 60:350:1 --out results/fig11-stability.parquet
"$SWEEP" plot results/fig11.parquet --stability results/fig11-stability.parquet \
    --channel tub_yaw --channel tub_pitch -o "$figures/fig11_tongues.svg"

# Draws the motions at the ends of dwells, and the run of Fig. 10 through the same speeds.
"$SWEEP" dwell docs/examples/plateau.toml --speed 225:330:1 --out results/fig10-dwell.parquet
"$SWEEP" plot results/fig10-dwell.parquet --against results/fig10.parquet --channel tub_yaw \
    -o "$figures/ends.svg"

# Draws each resonance in the channel with most of its motion: the delays in a run-up and a
# run-down, and the amplitudes at constant speeds.
# shellcheck disable=SC2086
"$SWEEP" plot results/fig10.parquet --view passages --channel tub_yaw --channel tub_pitch $centre \
    --modes results/fig7.parquet -o "$figures/delay.svg"
"$SWEEP" run sweeps/held.toml --progress plain
quantities=
for channel in tub_yaw tub_pitch total_centre_y total_centre_z; do
    quantities="$quantities --quantity linear_$channel"
done
# shellcheck disable=SC2086
"$SWEEP" plot results/held.parquet $quantities -o "$figures/held.svg"

"$SWEEP" run sweeps/fig12.toml --progress plain
"$SWEEP" plot results/fig12.parquet -o "$figures/fig12.svg"

# Fig. 6 also has the result of Exudyn, which takes half a minute.
scripts/crosscheck/run.sh --sweep "$SWEEP" --trace results/fig6_exudyn.parquet
exudyn="--against results/fig6_exudyn.parquet --modes results/fig7.parquet"
# shellcheck disable=SC2086
"$SWEEP" plot results/fig6.parquet $exudyn -o "$figures/fig6.svg"
# shellcheck disable=SC2086
"$SWEEP" plot results/fig6.parquet $centre $exudyn -o "$figures/fig6_centre.svg"
