#!/usr/bin/env bash
# A new user's tour: a fresh clone in an empty folder, and every command of the README and the guide, in order, as it stands there.
#
#   scripts/try_readme.sh
#
# Commands are those in blocks fenced as `sh`; a block that cannot be run everywhere is fenced as `console`. One is not run again:
# `cargo test --release --workspace`, which CI runs by itself. Builds go to this repository's target folder, so that libraries are
# not built twice.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
pages=(README.md docs/quickstart.md docs/machine.md docs/method.md docs/verdict.md docs/reading.md docs/building.md)
tour=$(mktemp -d)
trap 'rm -rf "$tour"' EXIT
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$root/target}
export CARGO_INSTALL_ROOT=$tour/installed
export PATH=$tour/installed/bin:$PATH
unset SWEEP_SIMD

git clone --quiet "$root" "$tour/clone"
cd "$tour/clone"
run=0
for page in "${pages[@]}"; do
    # One line a command, so that the first that fails is named.
    while IFS= read -r command; do
        case $command in '' | '#'* | 'cargo test --release --workspace'*) continue ;; esac
        echo "$page: $command"
        if ! bash -euo pipefail -c "$command" < /dev/null > "$tour/out" 2>&1; then
            cat "$tour/out"
            echo "$page: this command failed: $command" >&2
            exit 1
        fi
        run=$((run + 1))
    done < <(awk '/^```/ { inside = ($0 == "```sh") ; next } inside' "$page")
done
# The guide is nothing if its blocks were not found.
test "$run" -ge 20
echo "a new user's tour: $run commands, all as documented"
