#!/usr/bin/env bash
# Builds and runs the example of docs/your_own_model.md as a crate outside of the workspace, with
# dependencies by path.
#
#   scripts/checks/check_outside.sh [FOLDER]    default: target/ci/work/outside
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
folder=${1:-$root/target/ci/work/outside}
mkdir -p "$folder/src"
cp "$root/crates/ode-map/examples/two_springs.rs" "$folder/src/main.rs"
cp "$root/crates/ode-map/examples/two_springs.toml" "$folder"
# Uses the dependencies' versions of the workspace.
cp "$root/Cargo.lock" "$folder"
cat > "$folder/Cargo.toml" << EOF
[package]
name = "two_springs"
version = "0.1.0"
edition = "2024"

[dependencies]
lane-ode = { path = "$root/crates/lane-ode" }
ode-map = { path = "$root/crates/ode-map" }

[workspace]
EOF
cd "$folder"
CARGO_PROFILE_DEV_DEBUG=0 CARGO_TARGET_DIR=$folder/target cargo run --quiet -- \
    run two_springs.toml --out two_springs.parquet --fresh --progress none
