#!/usr/bin/env bash
# The ensemble of ensemble.toml by other programs' integrators and by `sweep run`, through the same
# right-hand side, in one run on the cores that this shell may use: error against time. Writes
# results/benchmarks/peers.md, .svg and .jsonl (a line per setting), and README's sentence of it.
#
#     scripts/peers/run.sh [--check]
#
# --check only sees that all of it still runs: trajectories of a second, written to target/peers.
set -euo pipefail
cd "$(dirname "$0")/../.."
if [ "${1:-}" = --check ]; then export CHECK=1 END_S=1; fi
work=target/peers
mkdir -p "$work"

scripts/tools/packages.sh g++ libsundials-dev libboost-dev
venv=$(scripts/tools/venv.sh scripts/peers/requirements.txt)

# With all crates: alone, one would get other features, and its kernels be compiled once more.
cargo build --release --locked --workspace
flags=(-O3 -march=native -Icrates/washer-capi/include "-L$work" -Ltarget/release
  "-Wl,-rpath,$PWD/$work:$PWD/target/release")
libraries=(-ltrajectory -lwasher_capi -lm)
cc "${flags[@]}" -shared -fPIC -o "$work/libtrajectory.so" scripts/peers/trajectory.c -lwasher_capi
cc "${flags[@]}" -o "$work/cvode" scripts/peers/cvode.c -lsundials_cvode -lsundials_nvecserial \
  -lsundials_sunmatrixdense -lsundials_sunlinsoldense "${libraries[@]}"
c++ "${flags[@]}" -o "$work/odeint" scripts/peers/odeint.cpp "${libraries[@]}"
RUSTFLAGS="-Ctarget-cpu=native -L$PWD/$work -L$PWD/target/release \
  -Clink-arg=-Wl,-rpath,$PWD/$work:$PWD/target/release" \
  cargo build --release --locked --manifest-path scripts/peers/diffsol/Cargo.toml \
  --target-dir "$work/diffsol"

PYTHONPATH=scripts/benchmarks "$venv/bin/python" scripts/peers/compare.py
