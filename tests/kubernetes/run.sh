#!/bin/sh
# Checks the Kubernetes manifests by the schemas of an old and a new version of Kubernetes, without
# unknown fields, and runs the commands of the manifests. SWEEP names the binary, by default that of
# the release build.
#
# The schemas are part of a Python package.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
sweep=${SWEEP:-$root/target/release/sweep}
venv=$("$root/scripts/tools/venv.sh" "$here/requirements.txt")

# Version 1.29 is the first one in which backoffLimitPerIndex is enabled.
for version in 1.29 1.37; do
    "$venv/bin/kubernetes-validate" --strict -k "$version" "$root"/docs/kubernetes/*.yaml
done
"$venv/bin/python" "$here/check.py" "$sweep" "$root"/docs/kubernetes
