#!/usr/bin/env python3
"""Runs the commands of the README and of the guide, and compares their outputs with the pages.

    python scripts/checks/try_docs.py SWEEP_BINARY [--write | --measure]

The commands run in a copy of the repository's files: first those of the README, then those of the
pages of docs/SUMMARY.md in order.

- Each line of an `sh` or `console` block is run unchanged and must succeed. A block that cannot run
  here has the line `<!-- not run: REASON -->` above it. SWEEP_BINARY replaces
  `cargo run --release --`; other cargo commands are skipped, because .ci/run runs them.
- A `text` block below an `sh` block has the output of the last command above it. With --write the
  script updates blocks that differ.
- A placeholder such as @@NAME@@ is a mistake. A block of commands or of Python in another Markdown
  file is also a mistake if it has no reason why it is not run.

Values that depend on the machine are not compared. On a line with a rate, threads, memory or the
time of a search, these are numbers with their units and names of instruction sets. With --measure
the script updates them too.

Requires only the standard library and the packages that the pages install.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED_COMMANDS = ("cargo test", "cargo install", "cargo build")
MACHINE_DEPENDENT_LINE = re.compile(r"points/s|\bthreads?\b|^takes\b|of memory|\brounds\b")
# A duration such as "2 min 5 s" counts as one number, because a fast machine prints "5 s".
NUMBERS = re.compile(
    r"\b[0-9]+ (h [0-9]+ min|min [0-9]+ s)\b"
    r"|\b[0-9][0-9.e+-]*( (ms|s|days?|kB|MB|GB)\b)?|\b(avx512|avx2|neon|scalar)\b"
)
PROGRESS = re.compile(r"[0-9]+ of [0-9]+ points \([0-9.]+ %\)")
NOT_RUN_MARK = re.compile(r"<!-- not run: .+ -->$")
PLACEHOLDER = re.compile(r"@@\w+@@")
# Pages whose `python` blocks scripts/checks/python_recipes.py runs.
PAGES_OF_PYTHON = {"docs/python.md", "crates/washer-sweep/README.md"}
# The note that a slow machine estimates times from the beginnings of trajectories.
ESTIMATE_NOTE = re.compile(r", the first ~ each$")


def find_pages():
    """Returns the paths of the README and of the guide's pages in order."""
    listing = re.findall(r"\]\(([^)]+\.md)\)", (ROOT / "docs/SUMMARY.md").read_text())
    paths = ((ROOT / "docs" / name).resolve() for name in ["../README.md", *listing])
    return list(dict.fromkeys(paths))


def find_blocks(lines):
    """Yields the language, the first line and the end line of each fenced block."""
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
    """Returns whether the line above a block says that it is not run."""
    above = [line for line in lines[max(0, start - 3):start - 1] if line]
    return bool(above) and NOT_RUN_MARK.match(above[-1]) is not None


def split_commands(lines):
    """Yields the commands of a block; continued lines are joined."""
    for command in re.sub(r"\\\n\s*", "", "\n".join(lines)).split("\n"):
        if command.strip() and not command.startswith("#"):
            yield command


def without_machine_values(line):
    """Returns a line without values that depend on the machine."""
    if MACHINE_DEPENDENT_LINE.search(line):
        return ESTIMATE_NOTE.sub("", NUMBERS.sub("~", line))
    return line


def update_output(documented_lines, printed_lines):
    """Returns the printed lines; lines with equal machine-independent parts are kept."""
    line_by_comparison = {without_machine_values(line): line for line in documented_lines}
    return [line_by_comparison.get(without_machine_values(line), line) for line in printed_lines]


def run_page(page, run, must_write, must_measure):
    """Runs the commands of a page; returns the numbers of commands and outputs, and mistakes."""
    name = page.relative_to(ROOT)
    lines = page.read_text().splitlines()
    command_count, output_count, outdated_blocks, printed_lines = 0, 0, [], None
    for language, start, end in find_blocks(lines):
        if language in ("sh", "console") and is_marked(lines, start):
            printed_lines = None
        elif language in ("sh", "console"):
            for command in split_commands(lines[start:end]):
                if command.startswith(SKIPPED_COMMANDS):
                    continue
                print(f"{name}: {command}", flush=True)
                status, printed_lines = run(command.replace("cargo run --release --", "sweep"))
                if status != 0:
                    sys.exit("\n".join([*printed_lines, f"{name}: this command failed: {command}"]))
                command_count += 1
        elif language == "text" and printed_lines is not None:
            output_count += 1
            updated_lines = printed_lines
            if not must_measure:
                updated_lines = update_output(lines[start:end], printed_lines)
            if lines[start:end] != updated_lines:
                outdated_blocks.append((start, end, updated_lines))
    if must_write and outdated_blocks:
        for start, end, updated_lines in reversed(outdated_blocks):
            lines[start:end] = updated_lines
        page.write_text("\n".join(lines) + "\n")
        print(f"{name}: {len(outdated_blocks)} outputs renewed")
        outdated_blocks = []
    mistakes = [f"{name}:{start}: the program prints:\n" + "\n".join(updated_lines)
             for start, _, updated_lines in outdated_blocks]
    mistakes += [f"{name}:{number}: a placeholder remains: {line}"
              for number, line in enumerate(lines, 1) if PLACEHOLDER.search(line)]
    return command_count, output_count, mistakes


def mistakes_of_unrun_blocks(file_names):
    """Yields mistakes about blocks that are not run and do not have a reason."""
    run_pages = {str(page.relative_to(ROOT)) for page in find_pages()}
    for name in file_names:
        lines = (ROOT / name).read_text().splitlines()
        for language, start, _ in find_blocks(lines):
            is_run = (language in ("sh", "console") and name in run_pages
                      or language == "python" and name in PAGES_OF_PYTHON)
            if language in ("sh", "console", "bash", "python") and not is_run:
                if not is_marked(lines, start):
                    yield f"{name}:{start}: nothing runs this block, and it does not say why"


def main():
    """Runs the commands of all pages; returns 1 if there are mistakes."""
    sweep, must_measure = pathlib.Path(sys.argv[1]).resolve(), "--measure" in sys.argv[2:]
    must_write = must_measure or "--write" in sys.argv[2:]
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        copy, programs = pathlib.Path(folder, "sweep"), pathlib.Path(folder, "bin")
        for name in filter(None, os.fsdecode(listing.stdout).split("\0")):
            if (ROOT / name).is_file():
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, copy / name)
        programs.mkdir()
        (programs / "sweep").symlink_to(sweep)
        environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}"}
        environment.pop("SWEEP_SIMD", None)

        def run(command):
            completed = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", command], cwd=copy, env=environment, text=True,
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )
            lines = [line.rstrip() for line in completed.stdout.splitlines()]
            # A run of minutes prints its progress, which depends on the machine.
            return completed.returncode, [line for line in lines if not PROGRESS.match(line)]

        page_results = [run_page(page, run, must_write, must_measure) for page in find_pages()]
    file_names = filter(None, os.fsdecode(listing.stdout).split("\0"))
    mistakes = [line for _, _, page_mistakes in page_results for line in page_mistakes]
    documents = (name for name in file_names if name.endswith(".md") and (ROOT / name).is_file())
    mistakes += mistakes_of_unrun_blocks(documents)
    for line in mistakes:
        print(line, file=sys.stderr)
    command_count, output_count = (sum(page[i] for page in page_results) for i in (0, 1))
    # Fewer commands or outputs mean that blocks were not found.
    if command_count < 20 or output_count < 3:
        mistakes.append("")
    print(f"documents: {command_count} commands as documented, {output_count} outputs, "
          f"{len(mistakes)} stale", file=sys.stderr)
    return 1 if mistakes else 0


if __name__ == "__main__":
    sys.exit(main())
