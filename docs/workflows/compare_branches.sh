#!/bin/sh
# Maps a grid as another commit has it and as it is here, and compares the two.
#
#     compare_branches.sh COMMIT GRID OUT
#
# OUT/summary.md is what a pull request should say. The exit code is 4 if a verdict flipped or the
# gate does not hold. SWEEP names the binary; both maps are its work, so that what differs comes
# from the grid and machine files.
set -eu
commit=$1 grid=$2 out=$3
sweep=${SWEEP:-target/release/sweep}
mkdir -p "$out"
before=$(mktemp -d)
trap 'rm -rf "$before"' EXIT
git archive "$commit" -- "$(dirname "$grid")" | tar -x -C "$before"

"$sweep" run "$before/$grid" --out "$out/before.parquet" --progress none
"$sweep" run "$grid" --out "$out/after.parquet" --progress none

code=0
"$sweep" compare "$out/before.parquet" "$out/after.parquet" --markdown \
    --fail-on flips --out "$out/differences.parquet" > "$out/summary.md" || code=$?
"$sweep" plot "$out/differences.parquet" -o "$out/differences.svg"
if ! "$sweep" require "$out/after.parquet" "${GATE:-count(status != 'ok') == 0}" \
    2> "$out/gate.txt"
then
    code=4
fi
{ printf '\n```text\n'; cat "$out/gate.txt"; printf '```\n'; } >> "$out/summary.md"
exit "$code"
