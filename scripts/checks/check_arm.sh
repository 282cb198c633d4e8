#!/usr/bin/env bash
# 64-bit ARM from another machine: what runs on NEON, under emulation (qemu-aarch64), and everything
# else type-checked.
#
#   scripts/checks/check_arm.sh          lanes and integrators under emulation; `cargo check` of
#                                        every crate
#   scripts/checks/check_arm.sh all      also both models on every instruction set, and result
#                                        files, which must be this machine's to the byte
#
# Adds the Rust target aarch64-unknown-linux-gnu and, as root on Debian, qemu-user and a C compiler
# for it where they are missing. SWEEP names another binary of this machine than
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
    # Every operation of every lane type, NaN and signed zeros included, and the integrators over
    # them. Sines and peaks against their references run on one lane, and take the emulator 20 s.
    "${lane_ode[@]}" -- --skip tests::trig --skip tests::peaks
    # The C libraries are compiled, and not used.
    CFLAGS_aarch64_unknown_linux_gnu=-O0 \
        cargo check --release --locked --target "$target" --workspace
    exit
fi

"${lane_ode[@]}"
# Both models by every explicit method, every number recorded: NEON against one lane.
cargo test --release --locked --target "$target" -p washer-model --lib \
    same_bits_on_every_instruction_set

cargo build --release --locked --target "$target" -p sweep
here=$(realpath --canonicalize-missing "${SWEEP:-target/release/sweep}")
there=$(realpath "${CARGO_TARGET_DIR:-target}/$target/release/sweep")
[ -x "$here" ] || cargo build --release --locked -p sweep

# No intrinsic may survive as a call.
if aarch64-linux-gnu-nm -C "$there" | grep 'core_arch::\(aarch64\|arm_shared\)::'; then
    echo "intrinsics called out of line" >&2
    exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for name in fast rk4 dopri5 additive; do
    scripts/tools/short_grid.sh "$name" > "$work/$name.toml"
done
cp sweeps/quick.toml "$work/quick.toml"
for name in quick fast rk4 dopri5 additive; do
    "$here" run "$work/$name.toml" --out "$work/$name.here.parquet" --progress none
    for simd in neon scalar; do
        [ "$simd $name" != "scalar quick" ] || continue
        SWEEP_SIMD=$simd $emulator "$there" run "$work/$name.toml" \
            --out "$work/$name.$simd.parquet" --progress none
        cmp "$work/$name.here.parquet" "$work/$name.$simd.parquet"
    done
done
echo "$there: the same files as from $here"
