#!/usr/bin/env bash
# Measures every timed claim of README, docs and results anew, of one commit, on this machine, and
# writes each into its page. Ninety minutes in which nothing else should run. A part that fails is
# named at the end, and the others are measured all the same.
#
#     scripts/benchmarks/claims.sh [PART ...]
#
# Parts: kernels, methods, elements, points, build, peers, samples (outputs that pages show).
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
  echo "there are changes that no commit has: figures would say they are of none" >&2
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
