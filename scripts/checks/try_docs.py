#!/usr/bin/env python3
"""A new user's tour: runs the commands of the README and the guide, and compares their outputs.

    python scripts/checks/try_docs.py SWEEP_BINARY [--write | --measure]

The tour starts in a fresh copy of the repository's files and takes the README, then the pages of
docs/SUMMARY.md, in order:

- Each line of an `sh` or `console` block is run as it stands, and must succeed. A block that
  cannot run here has the line `<!-- not run: REASON -->` above it. SWEEP_BINARY answers for
  `cargo run --release --`; other cargo commands are left to .ci/run.
- A `text` block below an `sh` block holds what the last command above it prints. --write renews
  the blocks that differ.
- A placeholder such as @@NAME@@ is a mistake. So is a block of commands or of Python in any other
  Markdown file that does not say why it is not run.

What depends on the machine is not compared: on a line with a rate, threads, memory or the time of a
search, numbers with their units and the names of instruction sets. --measure renews these too.

Python's own library is all it needs, besides what the pages install themselves.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
LEFT_TO_CI = ("cargo test", "cargo install", "cargo build")
OF_THE_MACHINE = re.compile(r"points/s|\bthreads?\b|^takes\b|of memory|\brounds\b")
# A slow machine's minutes and hours are one number, as a fast machine's seconds are.
NUMBERS = re.compile(
    r"\b[0-9]+ (h [0-9]+ min|min [0-9]+ s)\b"
    r"|\b[0-9][0-9.e+-]*( (ms|s|days?|kB|MB|GB)\b)?|\b(avx512|avx2|neon|scalar)\b"
)
PROGRESS = re.compile(r"[0-9]+ of [0-9]+ points \([0-9.]+ %\)")
NOT_RUN = re.compile(r"<!-- not run: .+ -->$")
PLACEHOLDER = re.compile(r"@@\w+@@")
# Pages whose `python` blocks scripts/checks/python_recipes.py runs.
RUN_AS_PYTHON = {"docs/python.md", "crates/washer-sweep/README.md"}
# A slow machine estimates from the beginnings of trajectories, and says so.
BEGINNINGS = re.compile(r", the first ~ each$")


def pages():
    """The README, then the guide in its order."""
    listed = re.findall(r"\]\(([^)]+\.md)\)", (ROOT / "docs/SUMMARY.md").read_text())
    pages = ((ROOT / "docs" / name).resolve() for name in ["../README.md", *listed])
    return list(dict.fromkeys(pages))


def blocks(lines):
    """Fenced blocks: language, line of the content's start, line after its end."""
    start = None
    for number, line in enumerate(lines):
        if not line.startswith("```"):
            continue
        if start is None:
            language, start = line[3:].strip(), number + 1
        else:
            yield language, start, number
            start = None


def is_marked(lines, start):
    """Whether the block that starts here says that it is not run."""
    above = [line for line in lines[max(0, start - 3):start - 1] if line]
    return bool(above) and NOT_RUN.match(above[-1]) is not None


def commands(lines):
    """Commands of a block, continued lines joined."""
    for command in re.sub(r"\\\n\s*", "", "\n".join(lines)).split("\n"):
        if command.strip() and not command.startswith("#"):
            yield command


def comparable(line):
    """What must be the same on every machine."""
    if OF_THE_MACHINE.search(line):
        return BEGINNINGS.sub("", NUMBERS.sub("~", line))
    return line


def renewed(shown, printed):
    """What is printed, with the lines that are shown where only the machine makes a difference."""
    known = {comparable(line): line for line in shown}
    return [known.get(comparable(line), line) for line in printed]


def tour(page, run, write, measure):
    """Takes one page; returns its counts of commands and samples, and its stale samples."""
    name = page.relative_to(ROOT)
    lines = page.read_text().splitlines()
    ran, samples, stale, printed = 0, 0, [], None
    for language, start, end in blocks(lines):
        if language in ("sh", "console") and is_marked(lines, start):
            printed = None
        elif language in ("sh", "console"):
            for command in commands(lines[start:end]):
                if command.startswith(LEFT_TO_CI):
                    continue
                print(f"{name}: {command}", flush=True)
                status, printed = run(command.replace("cargo run --release --", "sweep"))
                if status != 0:
                    sys.exit("\n".join([*printed, f"{name}: this command failed: {command}"]))
                ran += 1
        elif language == "text" and printed is not None:
            samples += 1
            right = printed if measure else renewed(lines[start:end], printed)
            if lines[start:end] != right:
                stale.append((start, end, right))
    if write and stale:
        for start, end, right in reversed(stale):
            lines[start:end] = right
        page.write_text("\n".join(lines) + "\n")
        print(f"{name}: {len(stale)} outputs renewed")
        stale = []
    wrong = [f"{name}:{start}: the program prints:\n" + "\n".join(right)
             for start, _, right in stale]
    wrong += [f"{name}:{number}: a placeholder remains: {line}"
              for number, line in enumerate(lines, 1) if PLACEHOLDER.search(line)]
    return ran, samples, wrong


def untried(names):
    """Blocks that nothing runs and that do not say why."""
    toured = {str(page.relative_to(ROOT)) for page in pages()}
    for name in names:
        lines = (ROOT / name).read_text().splitlines()
        for language, start, _ in blocks(lines):
            is_run = (language in ("sh", "console") and name in toured
                      or language == "python" and name in RUN_AS_PYTHON)
            if language in ("sh", "console", "bash", "python") and not is_run:
                if not is_marked(lines, start):
                    yield f"{name}:{start}: nothing runs this block, and it does not say why"


def main():
    """Run the tour; exit with 1 if anything is wrong."""
    sweep, measure = pathlib.Path(sys.argv[1]).resolve(), "--measure" in sys.argv[2:]
    write = measure or "--write" in sys.argv[2:]
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        copy, programs = pathlib.Path(folder, "sweep"), pathlib.Path(folder, "bin")
        for name in filter(None, os.fsdecode(listed.stdout).split("\0")):
            if (ROOT / name).is_file():
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, copy / name)
        programs.mkdir()
        (programs / "sweep").symlink_to(sweep)
        environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}"}
        environment.pop("SWEEP_SIMD", None)

        def run(command):
            done = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", command], cwd=copy, env=environment, text=True,
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )
            lines = [line.rstrip() for line in done.stdout.splitlines()]
            # A run of minutes says how far it is.
            return done.returncode, [line for line in lines if not PROGRESS.match(line)]

        taken = [tour(page, run, write, measure) for page in pages()]
    names = filter(None, os.fsdecode(listed.stdout).split("\0"))
    wrong = [line for _, _, found in taken for line in found]
    wrong += untried(name for name in names if name.endswith(".md") and (ROOT / name).is_file())
    for line in wrong:
        print(line, file=sys.stderr)
    ran, samples = (sum(page[i] for page in taken) for i in (0, 1))
    # The guide is nothing if its blocks were not found.
    if ran < 20 or samples < 3:
        wrong.append("")
    print(f"documents: {ran} commands as documented, {samples} outputs, {len(wrong)} stale",
          file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
