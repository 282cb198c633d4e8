#!/usr/bin/env python3
"""What a step costs on cores of 64-bit ARM, by LLVM's models of them (llvm-mca): a prediction
without caches or mispredicted branches, not a measurement. One RK4 step of the nonlinear model,
peaks included, is cut out of a run under qemu. Prints Markdown.

    scripts/checks/check_arm.sh                      # for the tools
    CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \\
        cargo build --release --target aarch64-unknown-linux-gnu -p washer-capi --example trajectory
    scripts/benchmarks/arm_cycles.py target/aarch64-unknown-linux-gnu/release/examples/trajectory

Needs qemu-aarch64, aarch64-linux-gnu-objdump and llvm-mca (Debian: qemu-user,
binutils-aarch64-linux-gnu, llvm-19).
"""

import collections
import itertools
import re
import shutil
import subprocess
import sys
import tempfile

CORES = ["neoverse-n1", "neoverse-n2", "neoverse-v1", "neoverse-v2", "apple-m1", "ampere1"]
LANES = {"scalar": 1, "neon": 2}
# Where qemu 7 puts a position-independent program.
BASE = 0x5500000000
# What comes before the first step is shorter; a step is some 20,000 instructions.
TRACED = 4_000_000
KEPT = 200_000
# llvm-mca takes straight code only.
BRANCH = re.compile(r"(b|bl|br|blr|b\..*|cbz|cbnz|tbz|tbnz|ret|adr|adrp)\s")
STACK = re.compile(r"(ld|st)\S*\s.*\[(sp|x29)")


def disassembled(binary):
    """Instructions by address, and the range of the project's own functions."""
    dump = subprocess.run(
        ["aarch64-linux-gnu-objdump", "-d", "--no-show-raw-insn", binary],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    code, own, ours = {}, [], False
    for line in dump.splitlines():
        if name := re.match(r"[0-9a-f]+ <(.*)>:$", line):
            ours = "lane_ode" in name[1] or "washer_model" in name[1]
        elif instruction := re.match(r"\s+([0-9a-f]+):\s+(\S.*)$", line):
            address = int(instruction[1], 16)
            code[address] = re.sub(r"<.*>", "", instruction[2].split("//")[0]).strip()
            if ours:
                own.append(address)
    return code, min(own), max(own)


def traced(binary, simd, first, last):
    """The last addresses that ran, of a run that is stopped in the middle."""
    with tempfile.TemporaryDirectory() as folder:
        fifo = f"{folder}/trace"
        subprocess.run(["mkfifo", fifo], check=True)
        run = subprocess.Popen(
            [
                "qemu-aarch64",
                "-L",
                "/usr/aarch64-linux-gnu",
                "-singlestep",
                "-d",
                "exec,nochain",
                "-D",
                fifo,
            ]
            + ["-dfilter", f"{BASE + first:#x}..{BASE + last:#x}", binary, simd],
            stdout=subprocess.DEVNULL,
        )
        with open(fifo) as trace:
            tail = collections.deque(itertools.islice(trace, TRACED), KEPT)
        run.kill()
        run.wait()
    found = (re.search(r"\[[0-9a-f]+/([0-9a-f]+)/", line) for line in tail)
    addresses = [int(address[1], 16) - BASE for address in found if address]
    if not addresses:
        sys.exit(
            f"{binary} {simd} ran nothing between {BASE + first:#x} and {BASE + last:#x}: does "
            f"this qemu put it elsewhere?"
        )
    return addresses


def step(addresses):
    """The addresses of one step: between two visits of an address that runs once a step, the most
    seldom of all that come back."""
    visits = collections.defaultdict(list)
    for i, address in enumerate(addresses):
        visits[address].append(i)
    rarest = min((seen for seen in visits.values() if len(seen) >= 5), key=len)
    gaps = {b - a for a, b in zip(rarest, rarest[1:])}
    assert max(gaps) < 1.05 * min(gaps), f"steps of {min(gaps)} to {max(gaps)} instructions"
    return addresses[rarest[-2] : rarest[-1]]


def cycles(code, core):
    tool = next(
        filter(
            shutil.which, [*(f"llvm-mca-{version}" for version in range(25, 17, -1)), "llvm-mca"]
        )
    )
    report = subprocess.run(
        [tool, "-mtriple=aarch64", f"-mcpu={core}", "-iterations=1"],
        input=code,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return int(re.search(r"Total Cycles:\s+(\d+)", report)[1])


def main():
    (binary,) = sys.argv[1:]
    code, first, last = disassembled(binary)
    table = {"instructions": {}, "of them loads and stores on the stack": {}} | {
        core: {} for core in CORES
    }
    for simd, lanes in LANES.items():
        ran = [code[address] for address in step(traced(binary, simd, first, last))]
        straight = "\n".join(line for line in ran if not BRANCH.match(line))
        table["instructions"][simd] = len(ran) / lanes
        table["of them loads and stores on the stack"][simd] = (
            sum(bool(STACK.match(line)) for line in ran) / lanes
        )
        for core in CORES:
            table[core][simd] = cycles(straight, core) / lanes
    print("| a step and lane |", *(f"{simd} |" for simd in LANES), "scalar / neon |")
    print("|---|---|---|---|")
    for name, of in table.items():
        name = name if " " in name or name == "instructions" else f"cycles, {name}"
        print(
            f"| {name} |",
            *(f"{of[simd]:.0f} |" for simd in LANES),
            f"{of['scalar'] / of['neon']:.2f} |",
        )


if __name__ == "__main__":
    main()
