#!/usr/bin/env bash
# Checks the manual pages, the completions of shells and the summary of a run:
# scripts/checks/check_manners.sh SWEEP_BINARY
set -euo pipefail
sweep=$1
root=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Each command that --help lists has a manual page and a completion.
"$sweep" man "$folder/man"
shells="bash zsh fish elvish powershell"
for shell in $shells; do "$sweep" completions "$shell" > "$folder/completions.$shell"; done
bash -n "$folder/completions.bash"
commands=$("$sweep" --help | sed -n '/^Usage:/,/^Options:/p' | awk '/^  [a-z]/ { print $1 }')
test "$(wc -w <<< "$commands")" -ge 11
for command in $commands; do
    grep -q "^\.SH SYNOPSIS" "$folder/man/sweep-$command.1"
    for shell in $shells; do grep -q -- "$command" "$folder/completions.$shell"; done
    # The help of a command begins with examples.
    test "$("$sweep" "$command" --help | head -1)" = "Examples:"
done

# The summary has at most twelve lines and ends with the next command. It has no colour in a file,
# and standard output is empty.
"$sweep" run "$root/docs/examples/compact_grid.toml" --out "$folder/compact.parquet" \
    --progress none > "$folder/out" 2> "$folder/err"
test ! -s "$folder/out"
test "$(wc -l < "$folder/err")" -le 12
tail -1 "$folder/err" | grep -q 'next  sweep plot'
! grep -q $'\x1b' "$folder/err"
echo "manners: $(wc -w <<< "$commands") commands with examples, manual pages and completions;" \
    "a summary of $(wc -l < "$folder/err") lines"
