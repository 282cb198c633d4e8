#!/usr/bin/env bash
# Runs all benchmarks that measure only this project: ratios, instruction counts, and the operations
# and cache misses of a step. Writes results/benchmarks/NAME.md with machine, versions and commands.
# `cargo bench --bench kernels` measures each kernel separately.
#
#     scripts/benchmarks/benchmark.sh [NAME] [ROUNDS]
set -euo pipefail
cd "$(dirname "$0")/../.."
name=${1:-kernels}
rounds=${2:-5}
out=results/benchmarks/$name.md
mkdir -p results/benchmarks
cargo build --release --bin sweep
cargo bench --no-run

{
  echo "# Benchmarks"
  echo
  python3 scripts/benchmarks/measured.py
  echo "$(rustc --version). Load when it began: $(cut -d' ' -f1 /proc/loadavg)."
  echo "Command: \`scripts/benchmarks/benchmark.sh $name $rounds\`."
  echo
  echo "## Ratios"
  echo
  echo "\`cargo bench --bench ratios -- $rounds\`, medians of $rounds rounds"
  echo
  cargo bench --quiet --bench ratios -- "$rounds"
  echo
  echo "## Instructions"
  echo
  echo "\`scripts/benchmarks/instructions.sh\`"
  echo
  scripts/benchmarks/instructions.sh
  echo
  echo "## What a step executes"
  echo
  echo "\`scripts/benchmarks/kernel_profile.py\`"
  echo
  python3 scripts/benchmarks/kernel_profile.py
  echo
  echo "## What a step misses"
  echo
  echo "\`scripts/benchmarks/cache_misses.py\`"
  echo
  python3 scripts/benchmarks/cache_misses.py
  echo
  echo "Zen 4 has a cache of 32 KiB, and executes one fused operation of eight lanes a cycle or two"
  echo "of four. So AVX-512 gains the linear model nothing there."
} > "$out.partial"
mv "$out.partial" "$out"
echo "$out"
