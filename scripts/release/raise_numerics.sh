#!/bin/sh
# Raises NUMERICS_VERSION, which distinguishes parts and results of different builds, and updates
# the expected results: hashes in tests/goldens.json, and numbers of three maps in
# tests/goldens.csv.
# Run this script with every change of a byte of a result, and commit the changed files.
set -eu
cd "$(dirname "$0")/../.."
file=crates/sweep/src/identity.rs
version=$(sed -n 's/^pub const NUMERICS_VERSION: u32 = \([0-9]*\);$/\1/p' "$file")
sed "/^pub const NUMERICS_VERSION/s/$version;$/$((version + 1));/" "$file" > "$file.new"
mv "$file.new" "$file"
UPDATE_GOLDENS=1 cargo test --release -p sweep --test command goldens
echo "numerics $version -> $((version + 1)); commit $file, tests/goldens.json and tests/goldens.csv"
