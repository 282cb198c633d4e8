#!/bin/sh
# Fuzzes what reads files, with libFuzzer:
# scripts/checks/fuzz.sh [SECONDS] [grid|list|result|folder]
#
# grid: grid files, machine files and constants. list: lists of points, CSV and Parquet. result:
# result files. folder: the files of an unfinished run, and the account of a finished one.
#
# Needs a C++ compiler (for libFuzzer itself) and the ordinary stable toolchain: the coverage
# counters are an LLVM pass that stable takes too. What is found stands in target/fuzz/findings; new
# inputs of interest in target/fuzz/corpus-TARGET, beside the seeds of the repository (fuzz/corpus,
# fuzz/corpus-list, fuzz/corpus-result, fuzz/corpus-folder; for grids sweeps/ and the broken files
# of the tests too).
set -eu
cd "$(dirname "$0")/../.."
seconds=${1:-60}
name=${2:-grid}
work=target/fuzz
mkdir -p "$work/corpus-$name" "$work/findings" "$work/seeds"
# The versions of the workspace; Cargo adds what only the fuzzer needs.
cp Cargo.lock fuzz/Cargo.lock

# Naming the target keeps the counters out of build scripts.
target=$(rustc -vV | sed -n 's/^host: //p')
flags="-Cpasses=sancov-module -Ccodegen-units=16 --cfg fuzzing"
for counter in level=4 inline-8bit-counters pc-table trace-compares; do
    flags="$flags -Cllvm-args=-sanitizer-coverage-$counter"
done
RUSTFLAGS=$flags cargo build --release --manifest-path fuzz/Cargo.toml \
    --target-dir "$work" --target "$target"

# Temporary files are the fuzzer's inputs: in memory where there is a place for it.
if [ -d /dev/shm ]; then export TMPDIR=/dev/shm; fi
case $name in
    grid)
        cp sweeps/*.toml crates/sweep/testdata/broken/*.toml "$work/seeds/"
        cp crates/sweep/src/commands/starter.toml "$work/seeds/"
        set -- -dict=fuzz/grid.dict -max_len=8192 "$work/corpus-$name" fuzz/corpus "$work/seeds"
        ;;
    # Commands print what they find.
    list | result | folder)
        set -- -close_fd_mask=3 -max_len=65536 "$work/corpus-$name" "fuzz/corpus-$name"
        ;;
    *) echo "no target $name: expected grid, list, result or folder" >&2 && exit 2 ;;
esac
exec "$work/$target/release/$name" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
    -print_final_stats=1 -artifact_prefix="$work/findings/" "$@"
