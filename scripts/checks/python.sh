#!/bin/sh
# Checks the Python package: scripts/checks/python.sh SWEEP_BINARY [--write]
#
# Builds a wheel, tries it in an environment without other packages, runs the tests with the
# libraries that it supports, checks its stubs, and runs its documents and recipes. --write updates
# the outputs and pictures of the recipes' pages. SWEEP_BINARY must be of this build, because the
# package's results are compared with its files.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
SWEEP=$(realpath "$1")
export SWEEP
# Dependencies that the build of the program has compiled are used again.
export CARGO_TARGET_DIR="$root/target"
crate=$root/crates/washer-sweep
tests=$crate/tests
venv=$("$root/scripts/tools/venv.sh" "$tests/requirements.txt")
wheels=$root/target/wheels
clean=$root/target/venv/clean

# Builds the wheel in the same way as `pip install .`.
rm -rf "$wheels" "$clean"
"$venv/bin/pip" wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$wheels" "$root"
"$venv/bin/python" -m venv "$clean"
"$clean/bin/pip" install --quiet --disable-pip-version-check "$wheels"/*.whl
(cd "$tests" && "$clean/bin/python" clean.py)

"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall \
    "$wheels"/*.whl
(cd "$tests" && "$venv/bin/python" -m pytest --quiet -p no:cacheprovider --durations 5 .)
(cd "$tests" && "$venv/bin/python" -m mypy.stubtest washer_sweep)
(cd "$tests" && "$venv/bin/python" -m mypy --strict --cache-dir "$root/target/mypy" typed.py)
"$venv/bin/python" "$root/scripts/checks/python_recipes.py" "${2:-}"
