#!/usr/bin/env bash
# What packagers and terminals need: manual pages, completions, a short summary.
# scripts/checks/check_manners.sh SWEEP_BINARY
set -euo pipefail
sweep=$1
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A page for each command that --help lists, and completions that name each.
"$sweep" man "$work/man"
shells="bash zsh fish elvish powershell"
for shell in $shells; do "$sweep" completions "$shell" > "$work/completions.$shell"; done
bash -n "$work/completions.bash"
commands=$("$sweep" --help | sed -n '/^Usage:/,/^Options:/p' | awk '/^  [a-z]/ { print $1 }')
test "$(wc -w <<< "$commands")" -ge 11
for command in $commands; do
    grep -q "^\.SH SYNOPSIS" "$work/man/sweep-$command.1"
    for shell in $shells; do grep -q -- "$command" "$work/completions.$shell"; done
    # Examples first.
    test "$("$sweep" "$command" --help | head -1)" = "Examples:"
done

# A summary of at most twelve lines, the next command last; nothing on standard output, no colour in
# a file.
"$sweep" run "$root/docs/examples/compact_grid.toml" --out "$work/compact.parquet" \
    --progress none > "$work/out" 2> "$work/err"
test ! -s "$work/out"
test "$(wc -l < "$work/err")" -le 12
tail -1 "$work/err" | grep -q 'next  sweep plot'
! grep -q $'\x1b' "$work/err"
echo "manners: $(wc -w <<< "$commands") commands with examples, manual pages and completions;" \
    "a summary of $(wc -l < "$work/err") lines"
