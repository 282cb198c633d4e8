#!/usr/bin/env bash
# Compares errors and times of other programs' integrators and of `sweep run` for the ensemble of
# ensemble.toml, with the same right-hand side and on the cores that this shell may use. Writes
# results/benchmarks/peers.md, .svg and .jsonl (a line per setting), and the sentence in README.
#
#     scripts/peers/run.sh [--check]
#
# With --check all programs run trajectories of a second, and the results are in target/peers.
set -euo pipefail
cd "$(dirname "$0")/../.."
if [ "${1:-}" = --check ]; then export CHECK=1 END_S=1; fi
folder=target/peers
mkdir -p "$folder"

scripts/tools/packages.sh g++ libsundials-dev libboost-dev
venv=$(scripts/tools/venv.sh scripts/peers/requirements.txt)

# All crates are built, because a single crate would have other features, with which its
# dependencies would be compiled again.
cargo build --release --locked --workspace
flags=(-O3 -march=native -Icrates/washer-capi/include "-L$folder" -Ltarget/release
  "-Wl,-rpath,$PWD/$folder:$PWD/target/release")
libraries=(-ltrajectory -lwasher_capi -lm)
cc "${flags[@]}" -shared -fPIC -o "$folder/libtrajectory.so" scripts/peers/trajectory.c \
  -lwasher_capi
cc "${flags[@]}" -o "$folder/cvode" scripts/peers/cvode.c -lsundials_cvode -lsundials_nvecserial \
  -lsundials_sunmatrixdense -lsundials_sunlinsoldense "${libraries[@]}"
c++ "${flags[@]}" -o "$folder/odeint" scripts/peers/odeint.cpp "${libraries[@]}"
RUSTFLAGS="-Ctarget-cpu=native -L$PWD/$folder -L$PWD/target/release \
  -Clink-arg=-Wl,-rpath,$PWD/$folder:$PWD/target/release" \
  cargo build --release --locked --manifest-path scripts/peers/diffsol/Cargo.toml \
  --target-dir "$folder/diffsol"

PYTHONPATH=scripts/benchmarks "$venv/bin/python" scripts/peers/compare.py
