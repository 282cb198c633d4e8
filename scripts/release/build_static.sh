#!/usr/bin/env bash
# A static binary for any x86-64 Linux, and proof that it gives the bytes of the ordinary one.
#
#   scripts/release/build_static.sh
#
# Adds the Rust target x86_64-unknown-linux-musl and, as root on Debian, musl-tools (a C compiler
# for it) where they are missing. The binary is target/x86_64-unknown-linux-musl/release/sweep;
# SWEEP names another ordinary one than target/release/sweep.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
target=x86_64-unknown-linux-musl
cd "$root"
ordinary=$(realpath --canonicalize-missing "${SWEEP:-target/release/sweep}")
static=$(realpath --canonicalize-missing "${CARGO_TARGET_DIR:-target}/$target/release/sweep")

[ -d "$(rustc --print target-libdir --target "$target")" ] || rustup target add "$target"
command -v musl-gcc > /dev/null || scripts/tools/packages.sh musl-tools
cargo build --release --locked --target "$target" -p sweep
[ -x "$ordinary" ] || cargo build --release --locked -p sweep

# No interpreter, no shared library.
if readelf --program-headers --dynamic "$static" | grep -E 'INTERP|NEEDED'; then
    echo "$static is not static" >&2
    exit 1
fi

# Every kind of file, by every method, with even ratios and random places: all that a mathematical
# library could have a hand in.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for name in fast dopri5 additive; do
    scripts/tools/short_grid.sh "$name" > "$work/$name.toml"
done
sed -e 's/, count = 3//' "$work/fast.toml" > "$work/sobol.toml"
printf '\n[design]\nmethod = "sobol"\npoints = 16\n' >> "$work/sobol.toml"
for sweep in "$ordinary" "$static"; do
    out=$work/$(if [ "$sweep" = "$static" ]; then echo static; else echo ordinary; fi)
    mkdir "$out"
    "$sweep" run sweeps/quick.toml --out "$out/quick.parquet" --progress none
    for name in fast dopri5 additive sobol; do
        "$sweep" run "$work/$name.toml" --out "$out/$name.parquet" --progress none
    done
    "$sweep" boundary "$work/fast.toml" --out "$out/boundary.parquet"
    "$sweep" trace sweeps/quick.toml --at unbalance_mass_kg=0.4 --at damping_n_s_per_m=100 \
        --states --forces --out "$out/trace.parquet"
    "$sweep" modes --speed 0:400:50 --out "$out/modes.parquet"
    for file in quick fast boundary trace modes; do
        "$sweep" plot "$out/$file.parquet" -o "$out/$file.svg"
        "$sweep" plot "$out/$file.parquet" -o "$out/$file.png"
    done
    rm "$out"/*.run.json
done > "$work/log" 2>&1 || { cat "$work/log"; exit 1; }
diff -rq "$work/ordinary" "$work/static"
files=$(find "$work/static" -type f | wc -l)
echo "$static: static, $(stat -c %s "$static") bytes, the same $files files as from $ordinary"
