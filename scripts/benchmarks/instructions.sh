#!/usr/bin/env bash
# Counts the instructions of a step of both models with their peaks by valgrind's callgrind. The
# counts are the same in every run. Callgrind does not support AVX-512. Writes a table in Markdown.
#
#     scripts/benchmarks/instructions.sh [--check] [SWEEP_BINARY]
#
# With --check the script fails if a count exceeds its bound below. Memory reads and writes show the
# registers that the compiler spills: one kernel took 29 or 43 ms, depending only on the values that
# were in registers.
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
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Prints the bounds of --check for instructions, reads and writes, at most a tenth above the counts
# with Rust 1.95. With avx2 there are 331 writes, because the choice between a drum with its
# unbalances in one plane and a skewed drum leaves the rotor's half in memory.
print_bounds() {
  case $1 in
    scalar) echo 6800 2570 1020 ;;
    avx2) echo 1950 1400 360 ;;
  esac
}

# Prints the instructions, reads and writes of a run of eight points by plain RK4.
count_run() { # SET END_S
  sed -e "s/^end_s = .*/end_s = $2/" -e 's/^window_s = .*//' -e 's/count = 9/count = 2/' \
      -e 's/^method = .*/method = "rk4"\nstep_s = 2e-4/' -e '/^accuracy = /d' sweeps/quick.toml \
      > "$folder/grid.toml"
  printf '\n[[axis]]\nparameter = "tub_front_x_m"\nvalues = [0.45, 0.46]\n' >> "$folder/grid.toml"
  SWEEP_SIMD=$1 valgrind --tool=callgrind --cache-sim=yes --callgrind-out-file="$folder/out" \
    "$sweep" run "$folder/grid.toml" --out "$folder/out.parquet" --fresh --threads 1 \
    --progress none > "$folder/log" 2>&1 || { cat "$folder/log" >&2; return 1; }
  sed -n 's/^summary: //p' "$folder/out" | cut -d' ' -f1-3
}

echo "Per step and trajectory, mean of both models:"
echo
echo "| instruction set | instructions | reads | writes |"
echo "|---|---:|---:|---:|"
too_many=
for set in scalar avx2; do
  read -r -a short_counts <<< "$(count_run $set 0.02)"
  read -r -a long_counts <<< "$(count_run $set 0.07)"
  read -r -a max_counts <<< "$(print_bounds $set)"
  row="| $set |"
  for i in 0 1 2; do
    # The long run has 250 more steps of eight points and two models.
    per_step=$(((long_counts[i] - short_counts[i]) / (250 * 8 * 2)))
    row+=" $per_step |"
    [ $per_step -le "${max_counts[i]}" ] ||
      too_many+="$set: $per_step, more than ${max_counts[i]}"$'\n'
  done
  echo "$row"
done
if [ -n "$check" ] && [ -n "$too_many" ]; then
  printf '%s' "$too_many" >&2
  exit 1
fi
