#!/usr/bin/env bash
# Builds a static binary for any x86-64 Linux, and checks that its files have the same bytes as
# those of the ordinary binary.
#
#   scripts/release/build_static.sh
#
# Adds the Rust target x86_64-unknown-linux-musl if it is missing and, as root on Debian, musl-tools
# (a C compiler for the target). The static binary is
# target/x86_64-unknown-linux-musl/release/sweep. SWEEP names the ordinary binary; the default is
# target/release/sweep.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
target=x86_64-unknown-linux-musl
cd "$root"
ordinary_binary=$(realpath --canonicalize-missing "${SWEEP:-target/release/sweep}")
static_binary=$(realpath --canonicalize-missing "${CARGO_TARGET_DIR:-target}/$target/release/sweep")

[ -d "$(rustc --print target-libdir --target "$target")" ] || rustup target add "$target"
command -v musl-gcc > /dev/null || scripts/tools/packages.sh musl-tools
cargo build --release --locked --target "$target" -p sweep
[ -x "$ordinary_binary" ] || cargo build --release --locked -p sweep

# A static binary has no interpreter and no shared library.
if readelf --program-headers --dynamic "$static_binary" | grep -E 'INTERP|NEEDED'; then
    echo "$static_binary is not static" >&2
    exit 1
fi

# Computes files of all kinds, by several methods, on grids with logarithmic spacing and a Sobol
# sequence, because their bytes depend on the mathematical library.
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for name in fast dopri5 additive; do
    scripts/tools/short_grid.sh "$name" > "$folder/$name.toml"
done
sed -e 's/, count = 3//' "$folder/fast.toml" > "$folder/sobol.toml"
printf '\n[design]\nmethod = "sobol"\npoints = 16\n' >> "$folder/sobol.toml"
for sweep in "$ordinary_binary" "$static_binary"; do
    out=$folder/$(if [ "$sweep" = "$static_binary" ]; then echo static; else echo ordinary; fi)
    mkdir "$out"
    "$sweep" run sweeps/quick.toml --out "$out/quick.parquet" --progress none
    for name in fast dopri5 additive sobol; do
        "$sweep" run "$folder/$name.toml" --out "$out/$name.parquet" --progress none
    done
    "$sweep" boundary "$folder/fast.toml" --out "$out/boundary.parquet"
    "$sweep" trace sweeps/quick.toml --at unbalance_mass_kg=0.4 --at damping_n_s_per_m=100 \
        --states --forces --out "$out/trace.parquet"
    "$sweep" modes --speed 0:400:50 --out "$out/modes.parquet"
    for file in quick fast boundary trace modes; do
        "$sweep" plot "$out/$file.parquet" -o "$out/$file.svg"
        "$sweep" plot "$out/$file.parquet" -o "$out/$file.png"
    done
    rm "$out"/*.run.json
done > "$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }
diff -rq "$folder/ordinary" "$folder/static"
files=$(find "$folder/static" -type f | wc -l)
bytes=$(stat -c %s "$static_binary")
echo "$static_binary: static, $bytes bytes, the same $files files as from $ordinary_binary"
