#!/usr/bin/env python3
"""Counts the instructions of an RK4 step by single-stepping, which supports all instruction sets.

    python3 scripts/benchmarks/kernel_profile.py [--ghz CLOCK] [BENCH_BINARY]

Runs the benchmark `whole_trajectory` (`cargo bench --bench kernels`; built if no binary is given)
of both models on each instruction set that the processor has. The thread is stopped at some
instants and single-stepped for some steps from each. The executions of each address and objdump's
mnemonic of the address give the counts. The instruction with the fewest executions in the loop runs
once per step, and marks where steps begin. Half of the trajectory lies in the window, where
channels are observed, so that counts are approximate means over both halves. The time per step is
that of the benchmark's fastest run. The clock frequency, unless given, is measured by a chain of
subtractions, which takes one cycle each. The peak rate of arithmetic is that of independent fused
operations of the same width, because some processors execute those of AVX-512 in two halves.
Requires Linux on x86-64, binutils and a C compiler. Writes a table in Markdown, in about two
minutes.
"""

import argparse
import collections
import ctypes
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time

ATTACH, DETACH, SINGLE_STEP, GET_REGISTERS = 16, 17, 9, 12
RIP = 16  # index of the instruction pointer in user_regs_struct, in words
REGISTERS = 27
WAIT_FOR_ALL = 0x40000000
STEPS = 200_000  # number of steps of the trajectory
# Number of instants at which the thread is stopped, and of instructions from each.
SAMPLES, INSTRUCTIONS = 8, 30_000
# The instruction sets by name, with the processor's flag and the prefix of the registers.
INSTRUCTION_SETS = {
    "Scalar": ("fma", "xmm"),
    "Avx2": ("avx2", "ymm"),
    "Avx512": ("avx512dq", "zmm"),
}
# The kinds of arithmetic, with patterns of the mnemonics.
KINDS = {
    "fused": r"vf\w*m(add|sub)",
    "multiplied": r"vmul[ps]d",
    "added": r"v(add|sub)[ps]d",
    "divided, rooted": r"v(div|sqrt)[ps]d",
}
COLUMNS = ["fused", "loads", "stores", "all instructions"]

libc = ctypes.CDLL(None, use_errno=True)
libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]


def ptrace(request, thread, data=None):
    if libc.ptrace(request, thread, None, data) == -1:
        sys.exit(f"ptrace: {os.strerror(ctypes.get_errno())} (a container may forbid it)")


def busiest_thread(pid):
    """Returns the thread with the most processor time."""

    def ticks(thread):
        with open(f"/proc/{pid}/task/{thread}/stat") as file:
            return int(file.read().rsplit(")", 1)[1].split()[11])

    return max(map(int, os.listdir(f"/proc/{pid}/task")), key=ticks)


def trace_samples(pid):
    """Yields the executed addresses of each sample, relative to the address of the program."""
    time.sleep(0.5)  # until the first trajectory has begun
    with open(f"/proc/{pid}/maps") as file:
        base = int(file.readline().split("-")[0], 16)
    thread = busiest_thread(pid)
    registers = (ctypes.c_ulong * REGISTERS)()
    for _ in range(SAMPLES):
        trace = []
        ptrace(ATTACH, thread)
        os.waitpid(thread, WAIT_FOR_ALL)
        for _ in range(INSTRUCTIONS):
            ptrace(GET_REGISTERS, thread, ctypes.byref(registers))
            trace.append(registers[RIP] - base)
            ptrace(SINGLE_STEP, thread)
            os.waitpid(thread, WAIT_FOR_ALL)
        ptrace(DETACH, thread)
        time.sleep(0.037)
        yield trace


def disassemble(binary, addresses):
    """Returns mnemonic and operands by address, from the first to the last of these addresses."""
    address_range = [f"--start-address={min(addresses)}", f"--stop-address={max(addresses) + 16}"]
    command = ["objdump", "-d", "--insn-width=16", *address_range, binary]
    code_by_address = {}
    for line in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    ):
        match = re.match(r"\s*([0-9a-f]+):\t(?:[0-9a-f]{2} )+\s*(\S+)\s*(.*)", line)
        if match:
            address, mnemonic, operands = match.groups()
            code_by_address[int(address, 16)] = (mnemonic, operands.split("#")[0].strip())
    return code_by_address


def count_whole_steps(trace):
    """Returns the executions of each address in the whole steps of a sample, and the number of
    these steps."""
    counts = collections.Counter(trace)
    addresses_by_count = collections.Counter(counts.values())
    min_addresses = 0.03 * len(counts)
    executions_per_sample = next(
        count
        for count in sorted(addresses_by_count)
        if count > 1 and addresses_by_count[count] + addresses_by_count[count + 1] > min_addresses
    )
    mark_address = next(address for address in trace if counts[address] == executions_per_sample)
    first = trace.index(mark_address)
    last = len(trace) - 1 - trace[::-1].index(mark_address)
    return collections.Counter(trace[first:last]), executions_per_sample - 1


def count_per_step(samples, code):
    """Returns the executions per step by kind of instruction."""
    kinds = collections.Counter()
    steps = 0
    for counts, sample_steps in map(count_whole_steps, samples):
        steps += sample_steps
        for address, count in counts.items():
            mnemonic, operands = code.get(address, ("", ""))
            kinds["all instructions"] += count
            for kind, pattern in KINDS.items():
                if re.match(pattern, mnemonic):
                    kinds[kind] += count
            if mnemonic.startswith("v") and "(" in operands:
                is_store = mnemonic.startswith("vmov") and operands.endswith(")")
                kinds["stores" if is_store else "loads"] += count
    return {kind: count / steps for kind, count in kinds.items()}


def read_step_time_ns(output):
    """Returns the time per step (ns) from the benchmark's report."""
    number, unit = re.search(r"\)\s+([\d.]+) (ns|µs|ms|s)\s", output).groups()
    return float(number) * {"ns": 1, "µs": 1e3, "ms": 1e6, "s": 1e9}[unit] / STEPS


def measure_program_s(source, *flags):
    """Returns the processor time of a C program (s), the least of five runs."""
    with tempfile.TemporaryDirectory() as folder:
        program = f"{folder}/program"
        command = ["cc", "-x", "c", "-O1", *flags, "-o", program, "-"]
        subprocess.run(command, input=source, text=True, check=True)
        times = []
        for _ in range(5):
            start_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            subprocess.run([program], check=True)
            times.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - start_s)
    return min(times)


def measure_clock_ghz():
    """Measures the clock frequency (GHz)."""
    return 1.0 / measure_program_s(
        "int main(void) { unsigned long n = 1000000000; "
        '__asm__ volatile("1: sub $1, %0; jnz 1b" : "+r"(n)); return 0; }'
    )


def measure_fused_per_ns(register):
    """Measures the fused operations per nanosecond with this kind of register. Twelve operations
    are independent of each other."""
    loops = 50_000_000
    fused = "".join(
        f"vfmadd213{'sd' if register == 'xmm' else 'pd'} %%{register}{i}, %%{register}{i}, "
        f"%%{register}{i};"
        for i in range(12)
    )
    clobbered = ", ".join(f'"xmm{i}"' for i in range(12))
    zeroed = "".join(f"vpxor %%xmm{i}, %%xmm{i}, %%xmm{i};" for i in range(12))
    source = (
        f"int main(void) {{ unsigned long n = {loops}; "
        f'__asm__ volatile("{zeroed} 1: {fused} sub $1, %0; jnz 1b" : "+r"(n) : : {clobbered}); '
        "return 0; }"
    )
    return 12e-9 * loops / measure_program_s(source, "-mavx512f")


def build_benchmark():
    """Builds the benchmark of the kernels and returns the path of its binary."""
    command = ["cargo", "bench", "--bench", "kernels", "--no-run", "--message-format=json"]
    messages = map(
        json.loads,
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines(),
    )
    return next(
        message["executable"]
        for message in messages
        if message.get("executable") and message["target"]["name"] == "kernels"
    )


def main():
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("binary", nargs="?")
    arguments.add_argument("--ghz", type=float)
    options = arguments.parse_args()
    binary = options.binary or build_benchmark()
    with open("/proc/cpuinfo") as file:
        processor_info = file.read()
    ghz = options.ghz or measure_clock_ghz()
    flags = re.search(r"flags\s*: (.*)", processor_info)[1].split()
    available_sets = {
        name: registers
        for name, (flag, registers) in INSTRUCTION_SETS.items()
        if flag in flags
    }
    peaks_per_ns = {
        name: measure_fused_per_ns(registers) for name, registers in available_sets.items()
    }
    rates = ", ".join(f"{name.lower()} {peak / ghz:.1f}" for name, peak in peaks_per_ns.items())
    print(
        f"A step of RK4 of all lanes, peaks included, at {ghz:.2f} GHz. Fused operations a cycle, "
        f"in a loop\nof nothing else: {rates}.\n"
    )
    print(
        "| | arithmetic | of it "
        + " | ".join(COLUMNS)
        + " | ns | instructions a cycle | arithmetic to fused peak |"
    )
    print("|---|" + "---:|" * (len(COLUMNS) + 4))
    for instruction_set, peak in peaks_per_ns.items():
        for model in ["Nonlinear", "Linear"]:
            command = [
                binary,
                "--bench",
                rf"whole_trajectory::\({model}, {instruction_set}\)",
                "--color",
                "never",
            ]
            report = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            process = subprocess.Popen(
                [*command, "--sample-count", "1000"],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            samples = list(trace_samples(process.pid))
            process.kill()
            process.wait()
            code = disassemble(binary, set().union(*samples))
            kinds = count_per_step(samples, code)
            ns = read_step_time_ns(report)
            arithmetic = sum(kinds.get(kind, 0) for kind in KINDS)
            counts = [arithmetic, *(kinds.get(column, 0) for column in COLUMNS), ns]
            cells = [f"{count:.0f}" for count in counts]
            cells += [
                f"{kinds['all instructions'] / (ns * ghz):.1f}",
                f"{100 * arithmetic / (ns * peak):.0f} %",
            ]
            print(
                f"| {model.lower()}, {instruction_set.lower()} | " + " | ".join(cells) + " |",
                flush=True,
            )


if __name__ == "__main__":
    main()
