#!/bin/sh
# Maps a grid as another commit has it and as it is here, compares the two, and checks a gate.
#
#     compare.sh COMMIT GRID OUT
#
# Run it anywhere in a git repository; GRID is relative to the repository's root. OUT gets the maps,
# their differences and summary.md, what a pull request should say. The exit code is 4 if a verdict
# flipped or the gate does not hold. Both maps are the work of one program, so that what differs
# comes from the repository. Variables: SWEEP is the program (sweep), GATE an expression of
# `sweep require`, FAIL_ON what `sweep compare` must not find (flips).
set -eu
commit=$1 grid=$2 out=$3
sweep=${SWEEP:-sweep}
cd "$(git rev-parse --show-toplevel)"
mkdir -p "$out"
before=$(mktemp -d)
trap 'rm -rf "$before"' EXIT
# The whole tree: a grid may name a machine file in any folder.
git archive "$commit" | tar -x -C "$before"

code=0
# Known again by comment.sh.
printf '<!-- sweep: %s -->\n# `%s`\n\n' "$grid" "$grid" > "$out/summary.md"
# Writes a title and the last command's messages into the summary.
refused() {
    cat "$out/refused.txt" >&2
    { printf '%s\n\n```text\n' "$1"; cat "$out/refused.txt"; printf '```\n'; } \
        >> "$out/summary.md"
}

"$sweep" run "$grid" --out "$out/after.parquet" --fresh --progress none \
    2> "$out/refused.txt" || code=$?
if [ "$code" -ne 0 ]; then
    refused "The grid does not run:"
    exit "$code"
fi
if [ ! -e "$before/$grid" ]; then
    echo "The grid is new: there is nothing to compare it with." >> "$out/summary.md"
elif ! "$sweep" run "$before/$grid" --out "$out/before.parquet" --fresh --progress none \
    2> "$out/refused.txt"; then
    # What a pull request mends is no reason to refuse it.
    refused "The grid of the base does not run, so there is nothing to compare it with:"
else
    "$sweep" compare "$out/before.parquet" "$out/after.parquet" --markdown \
        --fail-on "${FAIL_ON:-flips}" --out "$out/differences.parquet" >> "$out/summary.md" \
        2> "$out/refused.txt" || code=$?
    case $code in
        0 | 4) cat "$out/refused.txt" >&2 ;;
        *) refused "The map of the base and the one here cannot be compared:" ;;
    esac
    # Over one axis and of a design there is no such picture.
    "$sweep" plot "$out/differences.parquet" -o "$out/differences.svg" 2> /dev/null || :
fi
"$sweep" require "$out/after.parquet" "${GATE:-count(status != 'ok') == 0}" \
    > "$out/gate.txt" 2>&1 || code=$?
{ printf '\n```text\n'; cat "$out/gate.txt"; printf '```\n'; } >> "$out/summary.md"
exit "$code"
