#!/bin/sh
# The Kubernetes manifests against their schemas, strictly (no unknown field), for an old and a new version of Kubernetes; and the
# commands in them against the program itself. SWEEP names another binary than the release build.
#
# The schemas come with a Python package; Python 3 with venv is installed where it is missing, which needs root.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
sweep=${SWEEP:-$root/target/release/sweep}
venv=$root/target/kubernetes-venv

if ! python3 -c 'import ensurepip' 2>/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends python3-venv >/dev/null
fi
if ! [ -x "$venv/bin/python" ]; then python3 -m venv "$venv"; fi
"$venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/requirements.txt"

# 1.29 is the first whose API has backoffLimitPerIndex switched on.
for version in 1.29 1.37; do
    "$venv/bin/kubernetes-validate" --strict -k "$version" "$root"/docs/kubernetes/*.yaml
done
"$venv/bin/python" "$here/check.py" "$sweep" "$root"/docs/kubernetes
