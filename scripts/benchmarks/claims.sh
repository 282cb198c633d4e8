#!/usr/bin/env bash
# Repeats every measurement in README, docs and results, with one commit on this machine, and writes
# the results into their pages. It takes ninety minutes, in which nothing else should run. A failed
# part does not stop the others; its name is printed at the end.
#
#     scripts/benchmarks/claims.sh [PART ...]
#
# Parts: kernels, methods, elements, points, build, peers, samples (the command outputs in pages).
set -euo pipefail
cd "$(dirname "$0")/../.."
parts=("$@")
[ $# -gt 0 ] || parts=(kernels methods elements points build peers samples)
for part in "${parts[@]}"; do
  case $part in
    kernels | methods | elements | points | build | peers | samples) ;;
    *)
      echo "$part: no such part" >&2
      exit 2
      ;;
  esac
done
if ! git diff --quiet HEAD; then
  echo "commit all changes first, so that the results can name their commit" >&2
  exit 1
fi
MEASURED_COMMIT=$(git describe --always)
export MEASURED_COMMIT
cargo build --release --locked
sweep=target/release/sweep
failed=
for part in "${parts[@]}"; do
  case $part in
    kernels) scripts/benchmarks/benchmark.sh kernels 3 ;;
    methods) scripts/tools/python.sh scripts/benchmarks/method_costs.py "$sweep" ;;
    elements | points | build)
      scripts/tools/python.sh scripts/benchmarks/costs.py "$sweep" "$part"
      ;;
    peers) scripts/peers/run.sh ;;
    samples) scripts/tools/python.sh scripts/checks/try_docs.py "$sweep" --measure ;;
  esac || failed+=" $part"
done
[ -z "$failed" ] || { echo "not measured:$failed" >&2; exit 1; }
