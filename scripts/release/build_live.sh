#!/bin/sh
# Builds the WebAssembly module of live pages from crates/washer-live:
# scripts/release/build_live.sh [OUTPUT]
#
# The default of OUTPUT is crates/washer-plot/assets/live.wasm.gz, which is committed, so that the
# program can be built without the WebAssembly target. The module is compressed, because pages
# contain it as text. CI builds the module again and checks that both modules compute the same bits
# (tests/browser/check_module.py).
set -eu
cd "$(dirname "$0")/../.."
output=${1:-crates/washer-plot/assets/live.wasm.gz}
target=wasm32-unknown-unknown

[ -d "$(rustc --print target-libdir --target $target)" ] || rustup target add $target

cargo rustc --locked --package washer-live --profile live --target $target --crate-type cdylib
module=${CARGO_TARGET_DIR:-target}/$target/live/washer_live.wasm
# Without name and time in its header, equal modules give equal bytes.
gzip -9 -n -c "$module" > "$output"
echo "wrote $output: $(wc -c < "$output") bytes, unpacked $(wc -c < "$module"), $(rustc --version)"
