#!/bin/sh
# Creates a Python virtual environment with the packages of a list, and prints its folder:
# scripts/tools/venv.sh REQUIREMENTS.txt
#
# The environment is in target/venv, and is created again if the list changes. Requires Python 3.11
# or newer. PYTHON names the interpreter; otherwise it is the first one that can install the
# packages.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
list=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
name=$(echo "${list#"$root"/}" | tr / -)
venv=$root/target/venv/${name%.txt}
# Reads the list and the lists that it includes.
requirements=$(cat "$list" $(sed -n "s,^-r ,$(dirname "$list")/,p" "$list"))
if [ "$(cat "$venv/installed" 2> /dev/null)" != "$requirements" ]; then
    command -v python3 > /dev/null && python3 -c 'import ensurepip' 2> /dev/null \
        || "$root/scripts/tools/packages.sh" python3 python3-venv >&2
    for python in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
        command -v "$python" > /dev/null || continue
        rm -rf "$venv"
        if "$python" -m venv "$venv" \
            && "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$list"; then
            printf '%s\n' "$requirements" > "$venv/installed"
            break
        fi
        echo "$python ($("$python" --version 2>&1)) cannot install the packages of $list" >&2
    done >&2
fi
if [ ! -f "$venv/installed" ]; then
    echo "no interpreter can install the packages of $list: name another one by PYTHON" >&2
    exit 1
fi
echo "$venv"
