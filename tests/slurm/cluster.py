"""A Slurm cluster of two virtual nodes on this host, without systemd: daemons as child processes,
killed one by one."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path


class Cluster:
    def __init__(self, folder: Path, patience: float):
        self.folder = folder
        # How many times the usual seconds it is waited.
        self.patience = patience
        self.munge = folder / "munge"
        self.processes: dict[str, subprocess.Popen] = {}
        self.environment = {
            k: v for k, v in os.environ.items() if not k.startswith(("SLURM_", "SBATCH_"))
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
        # Munge's own user must reach its folder.
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
            "the controller", lambda: "is UP" in self.ask("scontrol", "ping", check=False), 20
        )

    def start_node(self, node: str):
        self.start(node, ["/usr/sbin/slurmd", "-D", "-N", node])

    def start(self, name: str, command: list[str]):
        log = open(self.folder / f"{name}.out", "ab")
        # A session of its own: what a node starts can be told from what another one started.
        self.processes[name] = subprocess.Popen(
            command, env=self.environment, stdout=log, stderr=log, start_new_session=True
        )

    def kill(self, name: str):
        """Ends a daemon as a crash would."""
        process = self.processes.pop(name)
        process.send_signal(signal.SIGKILL)
        process.wait()

    def kill_node(self, node: str):
        """Ends a node as a power cut would: its daemon, the steps it had started, and whatever
        those had started."""
        steps = [
            pid
            for pid, words in processes()
            if words[0].startswith("slurmstepd") and f"SLURMD_NODENAME={node}" in of_any_child(pid)
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

    def ask(self, *command: str, check: bool = True, **options) -> str:
        # On a busy host the controller now and then drops a connection; asking again is harmless,
        # submitting again is not.
        attempts = 5 if command[0] in ("squeue", "sinfo", "scontrol") and check else 1
        for attempt in range(attempts):
            done = subprocess.run(
                command, env=self.environment, capture_output=True, text=True, **options
            )
            if done.returncode == 0 or not check:
                return done.stdout
            time.sleep(0.2 * (attempt + 1))
        raise AssertionError(f"{' '.join(command)} failed: {done.stderr}")

    def node_states(self) -> list[str]:
        return self.ask("sinfo", "-h", "-N", "-o", "%T").split()

    def tasks(self, job: str) -> dict[str, dict[str, str]]:
        """State and node of each task of an array (of a job without tasks: N/A) that the controller
        still knows."""
        lines = self.ask("squeue", "-h", "-r", "-t", "all", "-o", "%F|%K|%T|%N").splitlines()
        rows = (line.split("|") for line in lines)
        return {task: {"state": state, "node": node} for of, task, state, node in rows if of == job}

    def is_over(self, job: str) -> bool:
        """Whether no task of a job will do anything any more; so it is with one that the controller
        has lost."""
        ended = {"COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL"}
        return all(task["state"] in ended for task in self.tasks(job).values())

    def wait_for_job(self, job: str, seconds: float) -> dict[str, str]:
        """The end state of each task."""
        self.wait_for(
            f"end of job {job}", lambda: self.is_over(job), seconds, lambda: self.tasks(job)
        )
        return {task: facts["state"] for task, facts in self.tasks(job).items()}

    def wait_until_saved(self, since: float):
        """Waits until the controller has written its record of the jobs anew, which it does some
        seconds after a change."""
        state = self.folder / "state/job_state"
        # Half a second for the snapshot that was under way.
        self.wait_for(
            "record of the jobs", lambda: state.exists() and state.stat().st_mtime > since + 0.5, 60
        )

    def wait_for(self, what, condition, seconds, show=lambda: ""):
        seconds = self.patience * seconds
        until = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > until:
                raise AssertionError(f"no {what} after {seconds} s {show()}\n{self.logs()}")
            time.sleep(0.05)

    def logs(self) -> str:
        tail = lambda path: "\n".join(path.read_text(errors="replace").splitlines()[-15:])
        return "\n".join(
            f"--- {path.name}\n{tail(path)}"
            for path in [*sorted(self.folder.glob("*.log")), *sorted(self.folder.glob("*.out"))]
        )


def free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


def processes():
    """Every process with its command line."""
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
    return [p for child in children for p in [child, *descendants(child)]]


def environment(pid: int) -> dict[str, str]:
    try:
        text = Path(f"/proc/{pid}/environ").read_bytes().decode(errors="replace")
    except OSError:
        return {}
    return dict(pair.split("=", 1) for pair in text.split("\0") if "=" in pair)


def of_any_child(pid: int) -> set[str]:
    return {f"{k}={v}" for child in descendants(pid) for k, v in environment(child).items()}


def kill(pid: int):
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
