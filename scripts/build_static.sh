#!/usr/bin/env bash
# A static binary for any x86-64 Linux, and proof that it gives the bytes of the ordinary one.
#
#   scripts/build_static.sh [GRID.toml]
#
# Needs the Rust target x86_64-unknown-linux-musl (`rustup target add`) and a C compiler for it (Debian: musl-tools).
# The binary is target/x86_64-unknown-linux-musl/release/sweep; SWEEP names another ordinary one than target/release/sweep.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
grid=${1:-$root/sweeps/quick.toml}
target=x86_64-unknown-linux-musl
cd "$root"
ordinary=${SWEEP:-target/release/sweep}
static=${CARGO_TARGET_DIR:-target}/$target/release/sweep

rustup target add "$target" 2>/dev/null
command -v musl-gcc > /dev/null || { echo "musl-gcc is missing (Debian: apt-get install musl-tools)" >&2; exit 1; }
cargo build --release --locked --target "$target" -p sweep
[ -x "$ordinary" ] || cargo build --release --locked -p sweep

# No interpreter, no shared library.
if readelf --program-headers --dynamic "$static" | grep -E 'INTERP|NEEDED'; then
    echo "$static is not static" >&2
    exit 1
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$ordinary" run "$grid" --out "$work/ordinary.parquet" --progress none
"$static" run "$grid" --out "$work/static.parquet" --progress none
cmp "$work/ordinary.parquet" "$work/static.parquet"
echo "$static: static, $(stat -c %s "$static") bytes, the same result as $ordinary"
