#!/bin/sh
# Fuzzes the grid files with libFuzzer: scripts/fuzz.sh [SECONDS]
#
# Needs a C++ compiler (for libFuzzer itself) and the ordinary stable toolchain: the coverage counters are an LLVM pass that stable
# takes too. What is found stands in target/fuzz/findings; new inputs of interest in target/fuzz/corpus, beside the
# seeds of the repository (fuzz/corpus, sweeps and the broken files of the tests).
set -eu
cd "$(dirname "$0")/.."
seconds=${1:-60}
work=target/fuzz
mkdir -p "$work/corpus" "$work/findings" "$work/seeds"
# The versions of the workspace; Cargo adds what only the fuzzer needs.
cp Cargo.lock fuzz/Cargo.lock

# Naming the target keeps the counters out of build scripts.
target=$(rustc -vV | sed -n 's/^host: //p')
RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
-Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=16 --cfg fuzzing" \
    cargo build --release --manifest-path fuzz/Cargo.toml --target-dir "$work" --target "$target"

cp sweeps/*.toml crates/sweep/testdata/broken/*.toml crates/sweep/src/commands/starter.toml "$work/seeds/"

# Temporary files are the fuzzer's inputs: in memory where there is a place for it.
if [ -d /dev/shm ]; then export TMPDIR=/dev/shm; fi
exec "$work/$target/release/grid" -dict=fuzz/grid.dict -max_total_time="$seconds" -max_len=8192 -timeout=10 -rss_limit_mb=2048 \
    -print_final_stats=1 -artifact_prefix="$work/findings/" "$work/corpus" fuzz/corpus "$work/seeds"
