#!/usr/bin/env bash
# One trajectory (trajectory.h) by other programs' integrators and by this project's, through the
# same right-hand side, in one run on one core: error against time. Writes
# results/benchmarks/peers.md, .svg and .jsonl (the raw runs).
#
#     scripts/peers/run.sh [REPEATS]
#
# Medians of so many rounds (3); a run of more than 10 s is done once.
set -euo pipefail
cd "$(dirname "$0")/../.."
repeats=${1:-3}
work=target/peers
mkdir -p "$work"

scripts/tools/packages.sh g++ libsundials-dev libboost-dev
venv=$(scripts/tools/venv.sh scripts/peers/requirements.txt)

cargo build --release -p washer-capi --lib --example trajectory
cargo build --release --bin sweep
flags=(-O3 -march=native -Icrates/washer-capi/include
  -Ltarget/release -Wl,-rpath,"$PWD/target/release")
cc "${flags[@]}" -o "$work/cvode" scripts/peers/cvode.c \
  -lwasher_capi -lsundials_cvode -lsundials_nvecserial -lsundials_sunmatrixdense \
  -lsundials_sunlinsoldense -lm
c++ "${flags[@]}" -o "$work/odeint" scripts/peers/odeint.cpp -lwasher_capi

# The last core that this shell may use; all that follows stays on it.
core=$(taskset -pc $$ | sed 's/.*[,: -]//')
taskset -c "$core" "$venv/bin/python" scripts/peers/compare.py "$repeats"
