#!/usr/bin/env bash
# The C ABI builds, its header is C and C++, and it gives the reference right-hand sides.
set -euo pipefail
cd "$(dirname "$0")/../.."
# With all crates: alone it would get other features, and its kernels be compiled once more.
cargo build --release --locked --workspace
for language in c c++; do
  cc -x "$language" -Wall -Wextra -Werror -fsyntax-only crates/washer-capi/include/washer.h
done
python3 scripts/peers/smoke.py
