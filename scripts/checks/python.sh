#!/bin/sh
# The Python package: built as a wheel, tried alone in a clean environment, tested beside the
# libraries that it works with, its stubs held against it and against code that uses them, and its
# documents and recipes run: scripts/checks/python.sh SWEEP_BINARY [--write]
#
# --write renews the outputs and pictures of the recipes' pages. SWEEP_BINARY must be of this build:
# the package's results are compared with its files.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
SWEEP=$(realpath "$1")
export SWEEP
# What the program was built of is built already.
export CARGO_TARGET_DIR="$root/target"
crate=$root/crates/washer-sweep
tests=$crate/tests
venv=$("$root/scripts/tools/venv.sh" "$tests/requirements.txt")
wheels=$root/target/wheels
clean=$root/target/venv/clean

# As `pip install .` does it.
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
