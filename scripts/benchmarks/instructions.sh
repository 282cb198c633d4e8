#!/usr/bin/env bash
# What a step of a trajectory executes, both models with their peaks, counted by valgrind's
# callgrind: not a time, but the same on every run. Callgrind does not know AVX-512. Writes a
# Markdown table.
#
#     scripts/benchmarks/instructions.sh [--check] [SWEEP_BINARY]
#
# --check fails if a count is more than its bound below. Reads and writes of memory tell what the
# compiler spills: the same kernel was seen at 29 and at 43 ms, with nothing changed but what it
# kept in registers.
set -euo pipefail
cd "$(dirname "$0")/../.."
check=
if [ "${1:-}" = --check ]; then
  check=yes
  shift
fi
sweep=${1:-target/release/sweep}
if ! command -v valgrind > /dev/null; then
  echo "valgrind is not installed: no instruction counts" >&2
  [ -z "$check" ]
  exit
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Bounds of --check, at most a tenth above what Rust 1.95 gives: instructions, reads, writes. Writes
# of avx2 count 331: the choice between a drum with its unbalances in one plane and a skewed one
# leaves the rotor's half in memory.
bounds() {
  case $1 in
    scalar) echo 6800 2570 1020 ;;
    avx2) echo 1950 1400 360 ;;
  esac
}

# Instructions, reads and writes of a run of eight points to a given end, by plain RK4.
count() { # SET END_S
  sed -e "s/^end_s = .*/end_s = $2/" -e 's/^window_s = .*//' -e 's/count = 9/count = 2/' \
      -e 's/^method = .*/method = "rk4"\nstep_s = 2e-4/' -e '/^accuracy = /d' sweeps/quick.toml \
      > "$work/grid.toml"
  printf '\n[[axis]]\nparameter = "tub_front_x_m"\nvalues = [0.45, 0.46]\n' >> "$work/grid.toml"
  SWEEP_SIMD=$1 valgrind --tool=callgrind --cache-sim=yes --callgrind-out-file="$work/out" \
    "$sweep" run "$work/grid.toml" --out "$work/out.parquet" --fresh --threads 1 --progress none \
    > "$work/log" 2>&1 || { cat "$work/log" >&2; return 1; }
  sed -n 's/^summary: //p' "$work/out" | cut -d' ' -f1-3
}

echo "Per step and trajectory, mean of both models:"
echo
echo "| instruction set | instructions | reads | writes |"
echo "|---|---:|---:|---:|"
too_many=
for set in scalar avx2; do
  read -r -a short <<< "$(count $set 0.02)"
  read -r -a long <<< "$(count $set 0.07)"
  read -r -a most <<< "$(bounds $set)"
  row="| $set |"
  for i in 0 1 2; do
    # 0.05 s more at 2e-4 s, eight points, two models.
    each=$(((long[i] - short[i]) / (250 * 8 * 2)))
    row+=" $each |"
    [ $each -le "${most[i]}" ] || too_many+="$set: $each, more than ${most[i]}"$'\n'
  done
  echo "$row"
done
if [ -n "$check" ] && [ -n "$too_many" ]; then
  printf '%s' "$too_many" >&2
  exit 1
fi
