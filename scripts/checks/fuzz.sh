#!/bin/sh
# Fuzzes the readers of files with libFuzzer:
# scripts/checks/fuzz.sh [SECONDS] [grid|list|result|folder]
#
# grid: grid files, machine files and constants. list: lists of points, CSV and Parquet. result:
# result files. folder: the files of an unfinished run, and the account of a finished one.
#
# Requires a C++ compiler (for libFuzzer) and the stable toolchain, which supports the LLVM pass of
# the coverage counters. Inputs that fail are written to target/fuzz/findings, and new inputs that
# reach further code to target/fuzz/corpus-TARGET. The initial inputs are those of the repository
# (fuzz/corpus, fuzz/corpus-list, fuzz/corpus-result, fuzz/corpus-folder), and for grids also
# sweeps/ and the broken files of the tests.
set -eu
cd "$(dirname "$0")/../.."
seconds=${1:-60}
name=${2:-grid}
work=target/fuzz
mkdir -p "$work/corpus-$name" "$work/findings" "$work/seeds"
# Uses the dependencies' versions of the workspace; Cargo adds those of the fuzzer.
cp Cargo.lock fuzz/Cargo.lock

# With an explicit target, build scripts are compiled without counters.
target=$(rustc -vV | sed -n 's/^host: //p')
flags="-Cpasses=sancov-module -Ccodegen-units=16 --cfg fuzzing"
for counter in level=4 inline-8bit-counters pc-table trace-compares; do
    flags="$flags -Cllvm-args=-sanitizer-coverage-$counter"
done
RUSTFLAGS=$flags cargo build --release --manifest-path fuzz/Cargo.toml \
    --target-dir "$work" --target "$target"

# Temporary files hold the fuzzer's inputs, so that they are kept in memory if possible.
if [ -d /dev/shm ]; then export TMPDIR=/dev/shm; fi
case $name in
    grid)
        cp sweeps/*.toml crates/sweep/testdata/broken/*.toml "$work/seeds/"
        cp crates/sweep/src/commands/starter.toml "$work/seeds/"
        set -- -dict=fuzz/grid.dict -max_len=8192 "$work/corpus-$name" fuzz/corpus "$work/seeds"
        ;;
    # The output of commands is discarded.
    list | result | folder)
        set -- -close_fd_mask=3 -max_len=65536 "$work/corpus-$name" "fuzz/corpus-$name"
        ;;
    *) echo "no target $name: expected grid, list, result or folder" >&2 && exit 2 ;;
esac
exec "$work/$target/release/$name" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
    -print_final_stats=1 -artifact_prefix="$work/findings/" "$@"
