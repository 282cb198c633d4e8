#!/usr/bin/env bash
# Builds the C ABI, compiles its header as C and as C++, and compares right-hand sides with those of
# the reference.
set -euo pipefail
cd "$(dirname "$0")/../.."
# All crates are built, because a single crate would have other features, with which its
# dependencies would be compiled again.
cargo build --release --locked --workspace
for language in c c++; do
  cc -x "$language" -Wall -Wextra -Werror -fsyntax-only crates/washer-capi/include/washer.h
done
python3 scripts/peers/smoke.py
