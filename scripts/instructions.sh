#!/usr/bin/env bash
# Instructions per step and trajectory, both models with their peaks, counted by valgrind's callgrind: not a time, but the same on every
# run. Callgrind does not know AVX-512. Writes a Markdown table.
#
#     scripts/instructions.sh [SWEEP_BINARY]
set -euo pipefail
cd "$(dirname "$0")/.."
sweep=${1:-target/release/sweep}
if ! command -v valgrind > /dev/null; then
  echo "valgrind is not installed: no instruction counts" >&2
  exit 0
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Instructions of a run of eight points to a given end, by plain RK4.
count() { # SET END_S
  sed -e "s/^end_s = .*/end_s = $2/" -e 's/^window_s = .*//' -e 's/count = 9/count = 2/' \
      -e 's/^method = .*/method = "rk4"\nstep_s = 2e-4/' -e '/^accuracy = /d' sweeps/quick.toml > "$work/grid.toml"
  printf '\n[[axis]]\nparameter = "tub_front_x_m"\nvalues = [0.45, 0.46]\n' >> "$work/grid.toml"
  SWEEP_SIMD=$1 valgrind --tool=callgrind --callgrind-out-file="$work/out" \
    "$sweep" run "$work/grid.toml" --out "$work/out.parquet" --fresh --threads 1 --progress none > "$work/log" 2>&1 \
    || { cat "$work/log" >&2; return 1; }
  sed -n 's/^summary: //p' "$work/out"
}

echo "| instruction set | instructions a step and trajectory, mean of both models |"
echo "|---|---|"
for set in scalar avx2; do
  short=$(count $set 0.02)
  long=$(count $set 0.07)
  # 0.05 s more at 2e-4 s, eight points, two models.
  echo "| $set | $(((long - short) / (250 * 8 * 2))) |"
done
