#!/usr/bin/env python3
"""What the processor executes in a step of RK4, counted by single-stepping: that knows every
instruction set.

    python3 scripts/benchmarks/kernel_profile.py [--ghz CLOCK] [BENCH_BINARY]

Runs the benchmark `whole_trajectory` (`cargo bench --bench kernels`; built if no binary is given)
of both models on each instruction set that the processor has. The thread is stopped at some
instants and followed for some steps from each; how often each instruction ran, and objdump's word
for it, make the counts. What runs once per step is the rarest of what the loop holds, and tells
where steps begin. Half of the trajectory lies in the window, where the channels are observed:
counts are means over both halves, as far as so few instants tell. The time a step is the
benchmark's fastest. The clock (unless given) is from the time that a chain of subtractions takes,
one a cycle. The peak rate of arithmetic is that of independent fused operations of the same width:
some processors execute those of AVX-512 in halves. Needs Linux on x86-64, binutils and a C
compiler. Writes a Markdown table, in two minutes or so.
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
RIP = 16  # of user_regs_struct, in words
REGISTERS = 27
WAIT_FOR_ALL = 0x40000000
STEPS = 200_000  # of the trajectory
SAMPLES, INSTRUCTIONS = 8, 30_000
# By name: the flag of a processor that has it, and its registers.
SETS = {"Scalar": ("fma", "xmm"), "Avx2": ("avx2", "ymm"), "Avx512": ("avx512dq", "zmm")}
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
    def ticks(thread):
        with open(f"/proc/{pid}/task/{thread}/stat") as file:
            return int(file.read().rsplit(")", 1)[1].split()[11])

    return max(map(int, os.listdir(f"/proc/{pid}/task")), key=ticks)


def executed(pid):
    """The addresses that ran, in each sample, from where the program was loaded."""
    time.sleep(0.5)  # the first trajectory is on its way
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


def disassembled(binary, addresses):
    """Mnemonic and operands of the instructions at and between the given ones."""
    span = [f"--start-address={min(addresses)}", f"--stop-address={max(addresses) + 16}"]
    command = ["objdump", "-d", "--insn-width=16", *span, binary]
    found = {}
    for line in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    ):
        match = re.match(r"\s*([0-9a-f]+):\t(?:[0-9a-f]{2} )+\s*(\S+)\s*(.*)", line)
        if match:
            address, mnemonic, operands = match.groups()
            found[int(address, 16)] = (mnemonic, operands.split("#")[0].strip())
    return found


def whole_steps(trace):
    """How often each address ran in the whole steps of a sample, and how many they are."""
    counts = collections.Counter(trace)
    sharing = collections.Counter(counts.values())
    many = 0.03 * len(counts)
    once = next(n for n in sorted(sharing) if n > 1 and sharing[n] + sharing[n + 1] > many)
    mark = next(address for address in trace if counts[address] == once)
    first = trace.index(mark)
    last = len(trace) - 1 - trace[::-1].index(mark)
    return collections.Counter(trace[first:last]), once - 1


def per_step(samples, code):
    """Executions of every kind in a step."""
    kinds = collections.Counter()
    steps = 0
    for counts, within in map(whole_steps, samples):
        steps += within
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


def fastest_ns(output):
    """The time a step, from the benchmark's report."""
    number, unit = re.search(r"\)\s+([\d.]+) (ns|µs|ms|s)\s", output).groups()
    return float(number) * {"ns": 1, "µs": 1e3, "ms": 1e6, "s": 1e9}[unit] / STEPS


def fastest_s(source, *flags):
    """The time that a program in C takes, the least of five."""
    with tempfile.TemporaryDirectory() as folder:
        program = f"{folder}/program"
        command = ["cc", "-x", "c", "-O1", *flags, "-o", program, "-"]
        subprocess.run(command, input=source, text=True, check=True)
        times = []
        for _ in range(5):
            begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            subprocess.run([program], check=True)
            times.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begin)
    return min(times)


def clock_ghz():
    """Cycles a nanosecond."""
    return 1.0 / fastest_s(
        "int main(void) { unsigned long n = 1000000000; "
        '__asm__ volatile("1: sub $1, %0; jnz 1b" : "+r"(n)); return 0; }'
    )


def fused_per_ns(register):
    """Fused operations a nanosecond of this kind of register: twelve of them wait for no other."""
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
    return 12e-9 * loops / fastest_s(source, "-mavx512f")


def built():
    command = ["cargo", "bench", "--bench", "kernels", "--no-run", "--message-format=json"]
    messages = map(
        json.loads,
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines(),
    )
    return next(
        m["executable"]
        for m in messages
        if m.get("executable") and m["target"]["name"] == "kernels"
    )


def main():
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("binary", nargs="?")
    arguments.add_argument("--ghz", type=float)
    options = arguments.parse_args()
    binary = options.binary or built()
    with open("/proc/cpuinfo") as file:
        cpu = file.read()
    ghz = options.ghz or clock_ghz()
    flags = re.search(r"flags\s*: (.*)", cpu)[1].split()
    available = {name: registers for name, (flag, registers) in SETS.items() if flag in flags}
    peaks = {name: fused_per_ns(registers) for name, registers in available.items()}
    rates = ", ".join(f"{name.lower()} {peak / ghz:.1f}" for name, peak in peaks.items())
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
    for instruction_set, peak in peaks.items():
        for model in ["Nonlinear", "Linear"]:
            command = [
                binary,
                "--bench",
                rf"whole_trajectory::\({model}, {instruction_set}\)",
                "--color",
                "never",
            ]
            free = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            followed = subprocess.Popen(
                [*command, "--sample-count", "1000"],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            samples = list(executed(followed.pid))
            followed.kill()
            followed.wait()
            code = disassembled(binary, set().union(*samples))
            kinds = per_step(samples, code)
            ns = fastest_ns(free)
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
