#!/bin/sh
# Checks the scripts of the CI kit of docs/workflows in a temporary repository, whose grid names a
# machine file in another folder. `gh` and the release's server are replaced by local substitutes.
#
#     scripts/checks/workflow.sh SWEEP
set -eu
sweep=$(realpath "$1")
kit=$(realpath "$(dirname "$0")/../../docs/workflows")
home=$(mktemp -d)
trap 'rm -rf "$home"' EXIT
fails() { echo "workflow.sh: $1" >&2; exit 1; }

# Creates a release in a folder: an archive with its digest.
name=sweep-1.2.3-$(uname -m)-linux
release=$home/origin/releases/download/v1.2.3
mkdir -p "$release" "$home/$name"
cp "$sweep" "$home/$name/sweep"
(cd "$home" && tar -czf "$release/$name.tar.gz" "$name")
(cd "$release" && sha256sum "$name.tar.gz" > "$name.tar.gz.sha256")
sh "$kit/install.sh" "file://$home/origin" v1.2.3 "$home/tool" > /dev/null
rm -r "$home/origin"
# Installs from the cache, because the release is deleted.
sh "$kit/install.sh" "file://$home/origin" v1.2.3 "$home/tool"
PATH=$home/tool/bin:$home/bin:$PATH
export PATH

git init -q "$home/repository"
cd "$home/repository"
git config user.name ci
git config user.email ci@example.org
mkdir grids machines
sweep init machines/mine.toml --machine > /dev/null
cat > grids/my.toml << 'GRID'
machine = "../machines/mine.toml"
spin = { profile = "triangular", peak_rpm = 100.0, ramp_s = 4.0 }
time = { end_s = 4.0 }
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.5]
[[axis]]
parameter = "damping_n_s_per_m"
values = [100, 200]
GRID
git add . && git commit -qm "A machine and its grid"

compare() {
    code=0
    sh "$kit/compare.sh" HEAD grids/my.toml out > log.txt 2>&1 || code=$?
    [ "$code" = "$1" ] || { cat log.txt; fails "$2: exit code $code"; }
}
compare 0 "nothing has changed"
grep -q "They do not differ" out/summary.md || fails "no word that nothing differs"
# Changes the machine file, which is not in the folder of the grid.
sed -i 's/23.87/20.0/' machines/mine.toml
FAIL_ON=plan compare 4 "another machine"
grep -q mass_kg out/summary.md || fails "the machine's change is not told"
GATE='ratio_max < 0' compare 4 "a gate that cannot open"
grep -q FAILS out/summary.md || fails "the gate is not told"
sed 's/0.5/0.6/' grids/my.toml > grids/new.toml
sh "$kit/compare.sh" HEAD grids/new.toml out > /dev/null 2>&1 || fails "a new grid"

# Differences over one axis have no picture, but the gate is checked.
head -n 6 grids/my.toml > grids/one.toml
git add grids/one.toml && git commit -qm "One axis"
code=0
GATE='ratio_max < 0' sh "$kit/compare.sh" HEAD grids/one.toml out > /dev/null 2>&1 || code=$?
[ "$code" = 4 ] && grep -q FAILS out/summary.md || fails "a grid of one axis: exit code $code"

# The points of a tolerance are matched although its middle differs between the machines.
git checkout -q machines/mine.toml
{ head -n 3 grids/my.toml; cat << 'GRID'
design = { method = "monte_carlo", points = 4 }
[[axis]]
parameter = "tub_mass_kg"
tolerance = "5 %"
GRID
} > grids/tolerance.toml
git add grids/tolerance.toml && git commit -qm "A tolerance"
sed -i 's/23.87/20.0/' machines/mine.toml
sh "$kit/compare.sh" HEAD grids/tolerance.toml out > log.txt 2>&1 ||
    { cat log.txt; fails "a tolerance about another number"; }
grep -q "rows: 4 in both" out/summary.md || fails "points of a tolerance are not matched"

# The summary says that maps without a common row cannot be compared, and the gate is checked.
sed 's/values = .*/values = [0.3]/' grids/one.toml > grids/other.toml
mv grids/other.toml grids/one.toml
code=0
sh "$kit/compare.sh" HEAD grids/one.toml out > /dev/null 2>&1 || code=$?
[ "$code" = 2 ] || fails "maps without a common row: exit code $code"
grep -q "they share no row" out/summary.md || fails "the refusal of the comparison is not told"
grep -q "^holds" out/summary.md || fails "no gate after a refused comparison"

# A pull request that repairs the base's grid passes; one that breaks it fails with the reason.
sed 's/ramp_s = 4.0/ramp_s = -1/' grids/my.toml > grids/broken.toml
git add grids/broken.toml && git commit -qm "A broken grid"
cp grids/my.toml grids/broken.toml
sh "$kit/compare.sh" HEAD grids/broken.toml out > /dev/null 2>&1 || fails "a mended grid is refused"
grep -q "ramp_s" out/summary.md || fails "the base's mistake is not told"
grep -q "The grid of the base does not run" out/summary.md || fails "no word of the base"
git commit -qam "The grid is mended" && sed -i 's/ramp_s = 4.0/ramp_s = -1/' grids/broken.toml
code=0
sh "$kit/compare.sh" HEAD grids/broken.toml out > /dev/null 2>&1 || code=$?
[ "$code" = 2 ] && grep -q "ramp_s" out/summary.md || fails "a broken grid: exit code $code"

# The substitute of `gh` stores each comment in a file. Posting twice must leave one comment, with
# the later text.
mkdir -p "$home/bin" "$home/comments"
cat > "$home/bin/gh" << 'GH'
#!/bin/sh
comments=COMMENTS
case "$*" in
    *--paginate*)
        for file in "$comments"/*; do
            [ -e "$file" ] && printf '%s\t%s\n' "$(basename "$file")" "$(head -n 1 "$file")"
        done ;;
    *PATCH*) cp "${6#body=@}" "$comments/${4##*/}" ;;
    *POST*) cp "${6#body=@}" "$comments/$(($(ls "$comments" | wc -l) + 1))" ;;
esac
exit 0
GH
sed -i "s|COMMENTS|$home/comments|" "$home/bin/gh"
chmod +x "$home/bin/gh"
echo "somebody else's" > "$home/comments/1"
sh "$kit/comment.sh" out/summary.md me/mine 7
echo "a later run" >> out/summary.md
sh "$kit/comment.sh" out/summary.md me/mine 7
[ "$(ls "$home/comments" | wc -l)" = 2 ] || fails "not one comment"
grep -q "a later run" "$home/comments/2" || fails "the comment is not the last run's"

# The steps of the action call existing scripts with existing inputs.
for script in $(grep -o '[a-z]*\.sh' "$kit/action.yml" | sort -u); do
    [ -x "$kit/$script" ] || fails "the action calls $script"
done
for input in $(grep -o 'inputs\.[a-z-]*' "$kit/action.yml" | cut -d. -f2 | sort -u); do
    grep -q "^  $input:" "$kit/action.yml" || fails "the action has no input $input"
done
