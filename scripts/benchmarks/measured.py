"""Common functions of the scripts that measure: they describe the machine and the commit, measure
commands, and write tables into pages."""

import os
import pathlib
import platform
import re
import signal
import subprocess
import tempfile
import textwrap
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
# Whether the measurement is only tried, with little work and without writing pages.
IS_CHECK = "CHECK" in os.environ


def run_command(*command):
    """Runs a command and returns its output. A failure ends the measurement."""
    completed = subprocess.run(list(map(str, command)), capture_output=True, text=True, cwd=ROOT)
    if completed.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}: {completed.stderr.strip()}")
    return completed.stdout.strip()


def describe_machine():
    """Describes the processor and the system."""
    processor_fields = dict(re.findall(r"^([^:]+):\s*(.*)$", run_command("lscpu"), re.MULTILINE))
    model = processor_fields.get("Model name", platform.machine())
    return (
        f"{model} (family {processor_fields.get('CPU family')}, "
        f"model {processor_fields.get('Model')}), "
        f"{len(os.sched_getaffinity(0))} cores, {platform.system()} {platform.release()}"
    )


def describe_commit():
    """Describes the measured commit. `MEASURED_COMMIT` sets it for a command that writes many
    pages, because the first page already changes the work tree."""
    commit = os.environ.get("MEASURED_COMMIT")
    return commit or run_command("git", "describe", "--always", "--dirty")


def measurement_note():
    """Returns the line under a table, with the machine and the commit."""
    return f"Measured on {describe_machine()}, of commit {describe_commit()}."


def wrap_paragraph(text):
    """Wraps a paragraph at 100 columns. Returns a table unchanged."""
    return text if text.startswith("|") else textwrap.fill(text, 100, break_on_hyphens=False)


def format_number(number):
    """Formats a number with three significant digits."""
    return f"{number:.0f}" if number >= 100 else f"{number:.3g}"


def markdown_table(headings, rows):
    """Writes a table in Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def write_between_marks(page, name, *paragraphs):
    """Writes paragraphs between the marks of this name in a page. A trial prints them instead."""
    path, paragraphs = ROOT / page, list(map(wrap_paragraph, paragraphs))
    if IS_CHECK:
        print(*paragraphs, sep="\n\n")
        return
    marked_text = re.compile(rf"(?s)(<!-- {name}: begin -->).*?(<!-- {name}: end -->)")
    text, count = marked_text.subn(
        lambda m: "\n\n".join([m[1], *paragraphs, m[2]]), path.read_text()
    )
    if count != 1:
        raise SystemExit(f"{page}: the marks of {name} are missing")
    path.write_text(text)


class MeasuredCommand:
    """The wall time and the processor time of a command (s), and its peak memory (MB). The command
    is interrupted as soon as `is_enough`, if given, returns true."""

    def __init__(self, *command, is_enough=None):
        expected_code = 130 if is_enough else 0
        with tempfile.TemporaryFile() as output_file:
            start_s = time.perf_counter()
            process = subprocess.Popen(
                list(map(str, command)), cwd=ROOT, stdout=output_file, stderr=subprocess.STDOUT
            )
            status_file = pathlib.Path(f"/proc/{process.pid}/status")
            wait_flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
            # The peak memory in the resource usage of an ended process includes this script's
            # memory before `exec`, so that it is read from /proc while the process runs.
            self.memory_mb = 0.0
            while os.waitid(os.P_PID, process.pid, wait_flags) is None:
                if peak_match := re.search(r"VmHWM:\s*(\d+) kB", status_file.read_text()):
                    self.memory_mb = int(peak_match[1]) * 1.024e-3
                if is_enough and is_enough():
                    process.send_signal(signal.SIGINT)
                    is_enough = None
                time.sleep(0.1)
            _, status, usage = os.wait4(process.pid, 0)
            self.wall_s = time.perf_counter() - start_s
            self.core_s = usage.ru_utime + usage.ru_stime
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode != expected_code:
                output_file.seek(0)
                text = output_file.read().decode().strip()
                raise SystemExit(f"{' '.join(map(str, command))}: {text}")


if __name__ == "__main__":
    print(wrap_paragraph(measurement_note()))
