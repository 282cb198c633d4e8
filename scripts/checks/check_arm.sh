#!/usr/bin/env bash
# Checks the program for 64-bit ARM on another machine. Code for NEON runs under emulation
# (qemu-aarch64); the other code is only type-checked.
#
#   scripts/checks/check_arm.sh          lanes and integrators under emulation; `cargo check` of
#                                        every crate
#   scripts/checks/check_arm.sh all      also both models on every instruction set, and result
#                                        files, whose bytes must be those of this machine
#
# Adds the Rust target aarch64-unknown-linux-gnu if it is missing and, as root on Debian, qemu-user
# and a C compiler for the target. SWEEP names the binary of this machine; the default is
# target/release/sweep.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
target=aarch64-unknown-linux-gnu
cd "$root"

[ -d "$(rustc --print target-libdir --target "$target")" ] || rustup target add "$target"
if ! command -v aarch64-linux-gnu-gcc > /dev/null || ! command -v qemu-aarch64 > /dev/null \
    || [ ! -d /usr/aarch64-linux-gnu/include ]; then
    scripts/tools/packages.sh gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user
fi
emulator="qemu-aarch64 -L /usr/aarch64-linux-gnu"
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER=$emulator
lane_ode=(cargo test --release --locked --target "$target" -p lane-ode --lib)

if [ "${1:-}" != all ]; then
    # Tests all operations of all lane types, also with NaN and signed zeros, and the integrators.
    # The skipped tests of sines and peaks use one lane, and would take 20 s under emulation.
    "${lane_ode[@]}" -- --skip tests::trig --skip tests::peaks
    # C libraries are compiled without optimisation, because they are not run.
    CFLAGS_aarch64_unknown_linux_gnu=-O0 \
        cargo check --release --locked --target "$target" --workspace
    exit
fi

"${lane_ode[@]}"
# Compares all recorded numbers of both models by every explicit method, on NEON and on one lane.
cargo test --release --locked --target "$target" -p washer-model --lib \
    same_bits_on_every_instruction_set

cargo build --release --locked --target "$target" -p sweep
native_binary=$(realpath --canonicalize-missing "${SWEEP:-target/release/sweep}")
arm_binary=$(realpath "${CARGO_TARGET_DIR:-target}/$target/release/sweep")
[ -x "$native_binary" ] || cargo build --release --locked -p sweep

# All intrinsics must be inlined.
if aarch64-linux-gnu-nm -C "$arm_binary" | grep 'core_arch::\(aarch64\|arm_shared\)::'; then
    echo "intrinsics called out of line" >&2
    exit 1
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for name in fast rk4 dopri5 additive; do
    scripts/tools/short_grid.sh "$name" > "$folder/$name.toml"
done
cp sweeps/quick.toml "$folder/quick.toml"
for name in quick fast rk4 dopri5 additive; do
    "$native_binary" run "$folder/$name.toml" --out "$folder/$name.here.parquet" --progress none
    for simd in neon scalar; do
        [ "$simd $name" != "scalar quick" ] || continue
        SWEEP_SIMD=$simd $emulator "$arm_binary" run "$folder/$name.toml" \
            --out "$folder/$name.$simd.parquet" --progress none
        cmp "$folder/$name.here.parquet" "$folder/$name.$simd.parquet"
    done
done
echo "$arm_binary: the same files as from $native_binary"
