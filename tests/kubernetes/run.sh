#!/bin/sh
# The Kubernetes manifests against their schemas, strictly (no unknown field), for an old and a new
# version of Kubernetes; and the commands in them against the program itself. SWEEP names another
# binary than the release build.
#
# The schemas come with a Python package.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
sweep=${SWEEP:-$root/target/release/sweep}
venv=$("$root/scripts/tools/venv.sh" "$here/requirements.txt")

# 1.29 is the first whose API has backoffLimitPerIndex switched on.
for version in 1.29 1.37; do
    "$venv/bin/kubernetes-validate" --strict -k "$version" "$root"/docs/kubernetes/*.yaml
done
"$venv/bin/python" "$here/check.py" "$sweep" "$root"/docs/kubernetes
