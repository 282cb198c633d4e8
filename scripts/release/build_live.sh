#!/bin/sh
# The WebAssembly module that live pages carry, from crates/washer-live:
# scripts/release/build_live.sh [OUTPUT]
#
# OUTPUT is crates/washer-plot/assets/live.wasm.gz, which is committed, so that nobody needs the
# target to build the program. It is packed, because pages carry it as text. CI builds it once more
# and compares what both compute (tests/browser/check_module.py): the same bits, whatever the
# toolchain.
set -eu
cd "$(dirname "$0")/../.."
output=${1:-crates/washer-plot/assets/live.wasm.gz}
target=wasm32-unknown-unknown

[ -d "$(rustc --print target-libdir --target $target)" ] || rustup target add $target

cargo rustc --locked --package washer-live --profile live --target $target --crate-type cdylib
module=${CARGO_TARGET_DIR:-target}/$target/live/washer_live.wasm
# Without a name and a time: the same module gives the same bytes.
gzip -9 -n -c "$module" > "$output"
echo "wrote $output: $(wc -c < "$output") bytes, unpacked $(wc -c < "$module"), $(rustc --version)"
