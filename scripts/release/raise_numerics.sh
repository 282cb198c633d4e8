#!/bin/sh
# Raises NUMERICS_VERSION, by which parts and results of other builds are told apart, and writes
# what this build computes: hashes into tests/goldens.json, and numbers of three maps into
# tests/goldens.csv. To be run, and its changes committed, with every change to a byte of a result.
set -eu
cd "$(dirname "$0")/../.."
file=crates/sweep/src/identity.rs
now=$(sed -n 's/^pub const NUMERICS_VERSION: u32 = \([0-9]*\);$/\1/p' "$file")
sed "/^pub const NUMERICS_VERSION/s/$now;$/$((now + 1));/" "$file" > "$file.new"
mv "$file.new" "$file"
UPDATE_GOLDENS=1 cargo test --release -p sweep --test command goldens
echo "numerics $now -> $((now + 1)); commit $file, tests/goldens.json and tests/goldens.csv"
