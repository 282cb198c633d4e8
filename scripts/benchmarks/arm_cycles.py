#!/usr/bin/env python3
"""Predicts the processor cycles of a step on cores of 64-bit ARM.

LLVM's models of the cores (llvm-mca) give the cycles without cache misses and mispredicted
branches. The instructions are those of one RK4 step of the nonlinear model with its peaks, traced
in a run under qemu. Prints a table in Markdown.

    scripts/checks/check_arm.sh                      # installs the tools
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
# The address at which qemu 7 loads a position-independent program.
LOAD_ADDRESS = 0x5500000000
# Number of traced instructions. The start of the program has fewer, and a step some 20,000.
TRACED_COUNT = 4_000_000
# Number of traced instructions, from the last one back, in which a step is searched.
KEPT_COUNT = 200_000
# Branches, which are left out because llvm-mca accepts only code without them.
BRANCH_PATTERN = re.compile(r"(b|bl|br|blr|b\..*|cbz|cbnz|tbz|tbnz|ret|adr|adrp)\s")
STACK_PATTERN = re.compile(r"(ld|st)\S*\s.*\[(sp|x29)")


def disassemble(binary):
    """Returns the instructions by address, and the first and last address of the project's own
    functions."""
    dump = subprocess.run(
        ["aarch64-linux-gnu-objdump", "-d", "--no-show-raw-insn", binary],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    code, own_addresses, is_own_function = {}, [], False
    for line in dump.splitlines():
        if name := re.match(r"[0-9a-f]+ <(.*)>:$", line):
            is_own_function = "lane_ode" in name[1] or "washer_model" in name[1]
        elif instruction := re.match(r"\s+([0-9a-f]+):\s+(\S.*)$", line):
            address = int(instruction[1], 16)
            code[address] = re.sub(r"<.*>", "", instruction[2].split("//")[0]).strip()
            if is_own_function:
                own_addresses.append(address)
    return code, min(own_addresses), max(own_addresses)


def trace_addresses(binary, simd, first, last):
    """Returns the addresses of the last instructions before a run is stopped in the middle."""
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
            + ["-dfilter", f"{LOAD_ADDRESS + first:#x}..{LOAD_ADDRESS + last:#x}", binary, simd],
            stdout=subprocess.DEVNULL,
        )
        with open(fifo) as trace:
            last_lines = collections.deque(itertools.islice(trace, TRACED_COUNT), KEPT_COUNT)
        run.kill()
        run.wait()
    address_matches = (re.search(r"\[[0-9a-f]+/([0-9a-f]+)/", line) for line in last_lines)
    addresses = [int(address[1], 16) - LOAD_ADDRESS for address in address_matches if address]
    if not addresses:
        sys.exit(
            f"{binary} {simd} ran nothing between {LOAD_ADDRESS + first:#x} and "
            f"{LOAD_ADDRESS + last:#x}: does this qemu load it at another address?"
        )
    return addresses


def find_step(addresses):
    """Returns the addresses of one step, from one execution of an instruction that runs once per
    step to the next. This instruction is the one with the fewest repeated executions."""
    visits = collections.defaultdict(list)
    for i, address in enumerate(addresses):
        visits[address].append(i)
    rarest_visits = min((indices for indices in visits.values() if len(indices) >= 5), key=len)
    gaps = {b - a for a, b in zip(rarest_visits, rarest_visits[1:])}
    assert max(gaps) < 1.05 * min(gaps), f"steps of {min(gaps)} to {max(gaps)} instructions"
    return addresses[rarest_visits[-2] : rarest_visits[-1]]


def predict_cycles(code, core):
    """Returns the cycles in which a core executes straight code, by llvm-mca."""
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
    code, first, last = disassemble(binary)
    table = {"instructions": {}, "of them loads and stores on the stack": {}} | {
        core: {} for core in CORES
    }
    for simd, lanes in LANES.items():
        addresses = trace_addresses(binary, simd, first, last)
        executed_code = [code[address] for address in find_step(addresses)]
        straight_code = "\n".join(line for line in executed_code if not BRANCH_PATTERN.match(line))
        table["instructions"][simd] = len(executed_code) / lanes
        table["of them loads and stores on the stack"][simd] = (
            sum(bool(STACK_PATTERN.match(line)) for line in executed_code) / lanes
        )
        for core in CORES:
            table[core][simd] = predict_cycles(straight_code, core) / lanes
    print("| a step and lane |", *(f"{simd} |" for simd in LANES), "scalar / neon |")
    print("|---|---|---|---|")
    for name, cycles_by_set in table.items():
        name = name if " " in name or name == "instructions" else f"cycles, {name}"
        print(
            f"| {name} |",
            *(f"{cycles_by_set[simd]:.0f} |" for simd in LANES),
            f"{cycles_by_set['scalar'] / cycles_by_set['neon']:.2f} |",
        )


if __name__ == "__main__":
    main()
