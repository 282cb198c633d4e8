"""What scripts that measure share: where and of what a figure is, and its place in a page."""

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
# Whether to see that all of it still runs, on little, and to write nothing.
IS_CHECK = "CHECK" in os.environ


def run(*command):
    """What it prints; its failure ends the measurement."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout.strip()


def machine():
    """Processor and system."""
    facts = dict(re.findall(r"^([^:]+):\s*(.*)$", run("lscpu"), re.MULTILINE))
    model = facts.get("Model name", platform.machine())
    return (
        f"{model} (family {facts.get('CPU family')}, model {facts.get('Model')}), "
        f"{len(os.sched_getaffinity(0))} cores, {platform.system()} {platform.release()}"
    )


def commit():
    """The commit that is measured: of one command that writes many pages, the one it began with."""
    return os.environ.get("MEASURED_COMMIT") or run("git", "describe", "--always", "--dirty")


def said():
    """The line under a table: where and of what it was measured."""
    return f"Measured on {machine()}, of commit {commit()}."


def wrapped(text):
    """A paragraph in lines of at most 100 columns; a table as it is."""
    return text if text.startswith("|") else textwrap.fill(text, 100, break_on_hyphens=False)


def figure(number):
    """Three digits at most."""
    return f"{number:.0f}" if number >= 100 else f"{number:.3g}"


def table(heads, rows):
    """Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def put(page, name, *paragraphs):
    """Paragraphs between the marks of this name; a check prints them."""
    path, paragraphs = ROOT / page, list(map(wrapped, paragraphs))
    if IS_CHECK:
        print(*paragraphs, sep="\n\n")
        return
    marked = re.compile(rf"(?s)(<!-- {name}: begin -->).*?(<!-- {name}: end -->)")
    text, count = marked.subn(lambda m: "\n\n".join([m[1], *paragraphs, m[2]]), path.read_text())
    if count != 1:
        raise SystemExit(f"{page}: there is no place for {name}")
    path.write_text(text)


class Spent:
    """A command's time on the wall and of the processor (s), and the most memory it had (MB). It is
    interrupted once `is_enough` says so, if that is given."""

    def __init__(self, *command, is_enough=None):
        code = 130 if is_enough else 0
        with tempfile.TemporaryFile() as printed:
            began = time.perf_counter()
            process = subprocess.Popen(
                list(map(str, command)), cwd=ROOT, stdout=printed, stderr=subprocess.STDOUT
            )
            account = pathlib.Path(f"/proc/{process.pid}/status")
            ended = os.WEXITED | os.WNOHANG | os.WNOWAIT
            # The kernel's account of a process that is gone begins with this script's own memory.
            self.memory_mb = 0.0
            while os.waitid(os.P_PID, process.pid, ended) is None:
                if most := re.search(r"VmHWM:\s*(\d+) kB", account.read_text()):
                    self.memory_mb = int(most[1]) * 1.024e-3
                if is_enough and is_enough():
                    process.send_signal(signal.SIGINT)
                    is_enough = None
                time.sleep(0.1)
            _, status, usage = os.wait4(process.pid, 0)
            self.wall_s = time.perf_counter() - began
            self.core_s = usage.ru_utime + usage.ru_stime
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode != code:
                printed.seek(0)
                text = printed.read().decode().strip()
                raise SystemExit(f"{' '.join(map(str, command))}: {text}")


if __name__ == "__main__":
    print(wrapped(said()))
