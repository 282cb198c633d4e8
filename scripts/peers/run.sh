#!/usr/bin/env bash
# One trajectory (trajectory.h) by other programs' integrators and by this project's, through the same right-hand side, in one run on one core:
# error against time. Writes results/benchmarks/peers.md, .svg and .jsonl (the raw runs).
#
#     scripts/peers/run.sh [REPEATS]      # medians of so many rounds (3); what takes longer than 10 s runs once
set -euo pipefail
cd "$(dirname "$0")/../.."
repeats=${1:-3}
work=target/peers
mkdir -p "$work"

missing=()
for package in g++ libsundials-dev libboost-dev python3-venv; do
  dpkg -s "$package" > /dev/null 2>&1 || missing+=("$package")
done
if ((${#missing[@]})); then
  as_root=()
  ((EUID == 0)) || as_root=(sudo)
  "${as_root[@]}" apt-get update
  "${as_root[@]}" apt-get install -y --no-install-recommends "${missing[@]}"
fi
[[ -x $work/venv/bin/python ]] || python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --requirement scripts/peers/requirements.txt

cargo build --release -p washer-capi --lib --example trajectory
cargo build --release --bin sweep
flags=(-O3 -march=native -Icrates/washer-capi/include -Ltarget/release -Wl,-rpath,"$PWD/target/release")
cc "${flags[@]}" -o "$work/cvode" scripts/peers/cvode.c \
  -lwasher_capi -lsundials_cvode -lsundials_nvecserial -lsundials_sunmatrixdense -lsundials_sunlinsoldense -lm
c++ "${flags[@]}" -o "$work/odeint" scripts/peers/odeint.cpp -lwasher_capi

# The last core that this shell may use; all that follows stays on it.
core=$(taskset -pc $$ | sed 's/.*[,: -]//')
taskset -c "$core" "$work/venv/bin/python" scripts/peers/compare.py "$repeats"
