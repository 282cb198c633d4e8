"""A Slurm cluster of two virtual nodes on this host. Its daemons are child processes that tests can
kill."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path


class Cluster:
    """A running cluster. Leaving its context stops the daemons."""

    def __init__(self, folder: Path, patience: float):
        self.folder = folder
        # The factor of all times for which the cluster waits.
        self.patience = patience
        self.munge = folder / "munge"
        self.processes: dict[str, subprocess.Popen] = {}
        self.environment = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("SLURM_", "SBATCH_"))
        }
        self.environment["SLURM_CONF"] = str(folder / "slurm.conf")

    def __enter__(self):
        self.configure()
        try:
            self.start_munge()
            self.start_controller()
            for node in ("n1", "n2"):
                self.start_node(node)
            self.wait_for("both nodes", lambda: self.node_states() == ["idle", "idle"], 30)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_):
        self.stop()

    def configure(self):
        # The user of munge must have access to its folder.
        for folder in (self.folder.parent, self.folder):
            folder.chmod(0o755)
        for name in ("state", "spool-n1", "spool-n2", "munge"):
            (self.folder / name).mkdir(mode=0o755)
        host = socket.gethostname().split(".")[0]
        text = (Path(__file__).parent / "slurm.conf.in").read_text()
        ports = dict(zip(("@PORT@", "@PORT1@", "@PORT2@"), free_ports(3)))
        for mark, value in {"@DIR@": self.folder, "@HOST@": host, **ports}.items():
            text = text.replace(mark, str(value))
        (self.folder / "slurm.conf").write_text(text)

    def start_munge(self):
        user = pwd.getpwnam("munge")
        key = self.munge / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        for path in (self.munge, key):
            shutil.chown(path, user.pw_uid, user.pw_gid)
        paths = {
            "key-file": key,
            "socket": self.munge / "munge.socket",
            "pid-file": self.munge / "munged.pid",
            "log-file": self.munge / "munged.log",
            "seed-file": self.munge / "munged.seed",
        }
        options = [f"--{name}={path}" for name, path in paths.items()]
        self.start(
            "munged",
            [
                "setpriv",
                "--reuid=munge",
                "--regid=munge",
                "--clear-groups",
                "/usr/sbin/munged",
                "--foreground",
                *options,
            ],
        )
        self.wait_for("munge's socket", paths["socket"].exists, 10)

    def start_controller(self):
        self.start("slurmctld", ["/usr/sbin/slurmctld", "-D"])
        self.wait_for(
            "the controller",
            lambda: "is UP" in self.run_command("scontrol", "ping", check=False),
            20,
        )

    def start_node(self, node: str):
        self.start(node, ["/usr/sbin/slurmd", "-D", "-N", node])

    def start(self, name: str, command: list[str]):
        log = open(self.folder / f"{name}.out", "ab")
        # Each daemon has its own session, so that its descendants can be identified.
        self.processes[name] = subprocess.Popen(
            command, env=self.environment, stdout=log, stderr=log, start_new_session=True
        )

    def kill(self, name: str):
        """Kills a daemon, which simulates a crash."""
        process = self.processes.pop(name)
        process.send_signal(signal.SIGKILL)
        process.wait()

    def kill_node(self, node: str):
        """Kills the daemon, the steps and all their descendants on a node, which simulates a power
        failure. Returns the killed processes."""
        steps = [
            pid
            for pid, words in processes()
            if words[0].startswith("slurmstepd")
            and f"SLURMD_NODENAME={node}" in environment_of_descendants(pid)
        ]
        self.kill(node)
        victims = [pid for step in steps for pid in [step, *descendants(step)]]
        for pid in victims:
            kill(pid)
        return victims

    def stop(self):
        for name in list(reversed(self.processes)):
            process = self.processes.pop(name)
            process.terminate()
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def run_command(self, *command: str, check: bool = True, **options) -> str:
        # On a busy host the controller sometimes drops a connection. Queries are repeated;
        # submissions are not, because they might have been received.
        attempts = 5 if command[0] in ("squeue", "sinfo", "scontrol") and check else 1
        for attempt in range(attempts):
            completed = subprocess.run(
                command, env=self.environment, capture_output=True, text=True, **options
            )
            if completed.returncode == 0 or not check:
                return completed.stdout
            time.sleep(0.2 * (attempt + 1))
        raise AssertionError(f"{' '.join(command)} failed: {completed.stderr}")

    def node_states(self) -> list[str]:
        return self.run_command("sinfo", "-h", "-N", "-o", "%T").split()

    def tasks(self, job: str) -> dict[str, dict[str, str]]:
        """Returns the state and the node of each task of an array that the controller knows. A job
        without tasks has the task N/A."""
        output = self.run_command("squeue", "-h", "-r", "-t", "all", "-o", "%F|%K|%T|%N")
        rows = (line.split("|") for line in output.splitlines())
        return {
            task: {"state": state, "node": node}
            for row_job, task, state, node in rows
            if row_job == job
        }

    def is_over(self, job: str) -> bool:
        """Returns whether all tasks of a job have ended. Lost tasks count as ended."""
        final_states = {"COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL"}
        return all(task["state"] in final_states for task in self.tasks(job).values())

    def wait_for_job(self, job: str, seconds: float) -> dict[str, str]:
        """Waits for a job; returns the final state of each task."""
        self.wait_for(
            f"end of job {job}", lambda: self.is_over(job), seconds, lambda: self.tasks(job)
        )
        return {task: facts["state"] for task, facts in self.tasks(job).items()}

    def wait_until_saved(self, since: float):
        """Waits until the controller has saved the state of jobs again, some seconds after a
        change."""
        state = self.folder / "state/job_state"
        # A snapshot that began before the change is saved within half a second.
        self.wait_for(
            "record of the jobs", lambda: state.exists() and state.stat().st_mtime > since + 0.5, 60
        )

    def wait_for(self, event, condition, seconds, describe=lambda: ""):
        seconds = self.patience * seconds
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise AssertionError(f"no {event} after {seconds} s {describe()}\n{self.logs()}")
            time.sleep(0.05)

    def logs(self) -> str:
        tail = lambda path: "\n".join(path.read_text(errors="replace").splitlines()[-15:])
        return "\n".join(
            f"--- {path.name}\n{tail(path)}"
            for path in [*sorted(self.folder.glob("*.log")), *sorted(self.folder.glob("*.out"))]
        )


def free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    for opened_socket in sockets:
        opened_socket.bind(("127.0.0.1", 0))
    ports = [opened_socket.getsockname()[1] for opened_socket in sockets]
    for opened_socket in sockets:
        opened_socket.close()
    return ports


def processes():
    """Yields all processes with their command lines."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
            except OSError:
                continue
            if words[0]:
                yield int(entry.name), words


def parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


def descendants(pid: int) -> list[int]:
    children = [child for child, _ in processes() if parent(child) == pid]
    return [process_id for child in children for process_id in [child, *descendants(child)]]


def environment(pid: int) -> dict[str, str]:
    try:
        text = Path(f"/proc/{pid}/environ").read_bytes().decode(errors="replace")
    except OSError:
        return {}
    return dict(pair.split("=", 1) for pair in text.split("\0") if "=" in pair)


def environment_of_descendants(pid: int) -> set[str]:
    return {
        f"{name}={value}"
        for child in descendants(pid)
        for name, value in environment(child).items()
    }


def kill(pid: int):
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
