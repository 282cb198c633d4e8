"""A sweep on a real Slurm cluster: an array over two nodes, a task killed, a node killed, the
controller killed.

usage: check.py SWEEP_BINARY [--tasks N] [SCENARIO ...]

Each time the merged file must be the single machine's, byte for byte. Needs root, slurm-wlm and
munge; run.sh sees to that.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cluster
from cluster import Cluster

# Two chunks for each task, each some tenths of a second of work.
GRID = """
name = "array"
machine = "paper"

[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0

[time]
end_s = 2.0
window_s = [1.0, 2.0]

[integrator]
method = "rk4"
step_s = STEP_S

[[axis]]
parameter = "unbalance_mass_kg"
range = { from = 0.05, to = 1.0, count = CHUNKS }

[[axis]]
parameter = "damping_n_s_per_m"
range = { from = 60.0, to = 300.0, count = POINTS }

[reliability]
ratio_limit = 2.0
channels = ["tub_front_y", "drum_front_z", "tub_yaw"]
"""


class Sweep:
    """One grid in a folder of its own, on the cluster."""

    def __init__(self, slurm: Cluster, binary: Path, folder: Path, shards: int):
        self.slurm, self.binary, self.folder, self.shards = slurm, binary, folder, shards
        # How many points a chunk has grows with the grid.
        self.chunk = 8 if shards <= 8 else 32
        folder.mkdir()
        grid = GRID.replace("STEP_S", str(1e-5 * self.chunk / 8))
        grid = grid.replace("CHUNKS", str(2 * shards)).replace("POINTS", str(self.chunk))
        (folder / "array.toml").write_text(grid)
        self.result = folder / "results/array.parquet"
        self.partial = folder / "results/array.parquet.partial"

    def sweep(self, *arguments: str, code: int = 0) -> subprocess.CompletedProcess:
        command = [self.binary, *arguments]
        done = subprocess.run(
            command, cwd=self.folder, env=self.slurm.environment, capture_output=True, text=True
        )
        assert (
            done.returncode == code
        ), f"{arguments} ended with {done.returncode}, not {code}: {done.stderr}"
        return done

    def status(self) -> dict:
        return json.loads(self.sweep("status", "array.toml", "--json").stdout)

    def script(self) -> Path:
        script = self.folder / "submit.sh"
        text = self.sweep(
            "slurm", "array.toml", "--shards", str(self.shards), "--time", "10", "--mem", "200M"
        ).stdout
        script.write_text(text)
        return script

    def submit(self, *arguments: str) -> tuple[str, str]:
        """Runs the printed script; the ids of the array and of the merge."""
        told = self.slurm.ask("sh", str(self.script()), *arguments)
        words = told.replace(",", "").split()
        assert words[0::2] == ["array", "merge"], told
        return words[1], words[3]

    def stopped_in_mid_shard(self) -> tuple[str, int]:
        """A task that has one of its two chunks, its process held still: the task's number and the
        process."""
        found = []

        def look():
            for shard in range(1, self.shards + 1):
                pid = self.process(str(shard)) if self.chunks(shard) == 1 else None
                if pid:
                    os.kill(pid, signal.SIGSTOP)
                    if self.chunks(shard) == 1:
                        found.append((str(shard), pid))
                        return True
                    os.kill(pid, signal.SIGCONT)
            return False

        self.slurm.wait_for("task with one chunk", look, 60, lambda: self.slurm.tasks(self.array))
        return found[0]

    def chunks(self, shard: int) -> int:
        own = (shard - 1, shard - 1 + self.shards)
        return sum((self.partial / f"part-{chunk:08}.parquet").exists() for chunk in own)

    def process(self, task: str) -> int | None:
        """The sweep of a task, if it is at work."""
        for pid, words in cluster.processes():
            if (
                words[0] == str(self.binary)
                and cluster.environment(pid).get("SLURM_ARRAY_TASK_ID") == task
            ):
                return pid
        return None

    def logs(self) -> str:
        return "\n".join(
            f"--- {path.name}\n{path.read_text()}" for path in sorted(self.folder.rglob("*.log"))
        )

    def assert_same(self, expected: bytes):
        assert self.result.exists(), f"no result\n{self.logs()}"
        assert self.result.read_bytes() == expected, "other bytes than the single machine's"
        assert not self.partial.exists(), "the run's folder stays behind"


def array_over_two_nodes(sweep: Sweep, expected: bytes):
    sweep.array, merge = sweep.submit()
    nodes = set()

    def watch():
        tasks = sweep.slurm.tasks(sweep.array)
        nodes.update(facts["node"] for facts in tasks.values() if facts["node"])
        return sweep.slurm.tasks(merge).get("N/A", {}).get("state") in ("COMPLETED", "FAILED")

    sweep.slurm.wait_for("merge", watch, 90, lambda: sweep.slurm.tasks(sweep.array))
    assert nodes == {"n1", "n2"}, nodes
    sessions = json.loads((sweep.folder / "results/array.run.json").read_text())["sessions"]
    shards = {f"{i}/{sweep.shards}" for i in range(1, sweep.shards + 1)}
    assert len(sessions) == sweep.shards and {session["shard"] for session in sessions} == shards
    assert {session["threads"] for session in sessions} == {
        1
    }, "threads are the cores that Slurm gave"
    sweep.assert_same(expected)


def plain_array_numbered_from_zero(sweep: Sweep, expected: bytes):
    """The defaults alone: place and number from the environment, and a part of the array submitted
    again."""
    wrap = f"--wrap={sweep.binary} run array.toml"
    job = sweep.slurm.ask(
        "sbatch",
        "--parsable",
        f"--array=0-{sweep.shards - 1}",
        "--open-mode=append",
        wrap,
        cwd=sweep.folder,
    ).strip()
    sweep.slurm.wait_for("beginning", lambda: (sweep.partial / "shards.json").exists(), 30)
    sweep.slurm.ask("scancel", "--state=PENDING", job)
    sweep.slurm.wait_for_job(job, 60)
    status = sweep.status()
    assert status["shards"] == sweep.shards and status["missing_shards"], status
    refused = sweep.sweep("merge", "array.toml", code=1).stderr
    assert "is incomplete" in refused and "of shards" in refused, refused
    again = sweep.slurm.ask(
        "sbatch", "--parsable", f"--array={status['missing_shards']}", wrap, cwd=sweep.folder
    ).strip()
    assert set(sweep.slurm.wait_for_job(again, 90).values()) == {"COMPLETED"}, sweep.logs()
    assert sweep.status()["state"] == "complete"
    sweep.sweep("merge", "array.toml")
    sweep.assert_same(expected)


def task_killed(sweep: Sweep, expected: bytes):
    sweep.array, merge = sweep.submit()
    task, process = sweep.stopped_in_mid_shard()
    os.kill(process, signal.SIGKILL)
    states = sweep.slurm.wait_for_job(sweep.array, 90)
    assert states.pop(task) == "FAILED" and set(states.values()) == {"COMPLETED"}, states
    # The merge came, found the hole and said so.
    ended = sweep.slurm.wait_for_job(merge, 30)
    assert ended == {"N/A": "FAILED"}, ended
    log = (sweep.folder / f"results/array.slurm-merge-{merge}.log").read_text()
    assert f"1 of {2 * sweep.shards} chunks are missing, of shards {task}" in log, log
    status = sweep.status()
    assert status["missing_shards"] == task and status["chunks_missing"] == 1, status
    _, merge = sweep.submit(f"--array={status['missing_shards']}")
    assert sweep.slurm.wait_for_job(merge, 60) == {"N/A": "COMPLETED"}, sweep.logs()
    sweep.assert_same(expected)


def node_killed(sweep: Sweep, expected: bytes):
    slurm = sweep.slurm
    sweep.array, merge = sweep.submit()
    task, process = sweep.stopped_in_mid_shard()
    node = cluster.environment(process)["SLURMD_NODENAME"]
    victims = slurm.kill_node(node)
    assert process in victims, "the node's power cut spared its task"
    down = lambda: slurm.ask("sinfo", "-h", "-n", node, "-o", "%T").strip().rstrip("*") == "down"
    slurm.wait_for(f"word that {node} is down", down, 60)
    slurm.wait_for(
        "task queued again", lambda: slurm.tasks(sweep.array)[task]["state"] == "PENDING", 30
    )
    # Slurm lets a task wait two minutes after its node failed; an administrator's word makes it
    # now.
    slurm.ask("scontrol", "update", f"JobId={sweep.array}_{task}", "StartTime=now")
    assert set(slurm.wait_for_job(sweep.array, 120).values()) == {"COMPLETED"}, sweep.logs()
    assert slurm.wait_for_job(merge, 60) == {"N/A": "COMPLETED"}, sweep.logs()
    log = (sweep.folder / f"results/array.slurm-{sweep.array}_{task}.log").read_text()
    assert (
        f"going on: {sweep.chunk} of {2 * sweep.chunk} points are there" in log
    ), f"the task did not go on from its chunk:\n{log}"
    sweep.assert_same(expected)
    slurm.start_node(node)
    slurm.wait_for(
        "node's return", lambda: slurm.node_states() == ["idle", "idle"], 60, slurm.node_states
    )


def controller_killed(sweep: Sweep, expected: bytes):
    slurm = sweep.slurm
    sweep.array, merge = sweep.submit()
    submitted = time.time()
    _, process = sweep.stopped_in_mid_shard()
    slurm.wait_until_saved(submitted)
    slurm.kill("slurmctld")
    # The nodes' tasks go on, and end with nobody to tell.
    os.kill(process, signal.SIGCONT)
    time.sleep(2)
    slurm.start_controller()

    # A controller that lost sight of tasks queues them again, to wait as above; one that lost a
    # start may start it twice and then drain the node. An administrator's word in either case.
    def over():
        for task, facts in slurm.tasks(sweep.array).items():
            if facts["state"] == "PENDING":
                slurm.ask(
                    "scontrol",
                    "update",
                    f"JobId={sweep.array}_{task}",
                    "StartTime=now",
                    check=False,
                )
        for node in ("n1", "n2"):
            if slurm.ask("sinfo", "-h", "-n", node, "-o", "%T").startswith("drain"):
                slurm.ask("scontrol", "update", f"NodeName={node}", "State=RESUME")
        return slurm.is_over(sweep.array) and slurm.is_over(merge)

    slurm.wait_for("end of array and merge", over, 120, lambda: slurm.tasks(sweep.array))
    if not sweep.result.exists():
        # What the controller forgot is what status finds.
        _, merge = sweep.submit(f"--array={sweep.status()['missing_shards']}")
        assert slurm.wait_for_job(merge, 90) == {"N/A": "COMPLETED"}, sweep.logs()
    sweep.assert_same(expected)


SCENARIOS = [
    array_over_two_nodes,
    plain_array_numbered_from_zero,
    task_killed,
    node_killed,
    controller_killed,
]


def main(binary: Path, shards: int, names: list[str]):
    with tempfile.TemporaryDirectory(prefix="sweep-slurm-") as home:
        home = Path(home)
        (home / "cluster").mkdir()
        with Cluster(home / "cluster", patience=shards / 8) as slurm:
            alone = Sweep(slurm, binary, home / "alone", shards)
            began = time.monotonic()
            alone.sweep("run", "array.toml", "--progress", "none")
            expected = alone.result.read_bytes()
            print(f"single machine: {time.monotonic() - began:.0f} s", flush=True)
            for scenario in SCENARIOS:
                if names and scenario.__name__ not in names:
                    continue
                began = time.monotonic()
                scenario(Sweep(slurm, binary, home / scenario.__name__, shards), expected)
                print(
                    f"{scenario.__name__}: {time.monotonic() - began:.0f} s, the same bytes",
                    flush=True,
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("binary", type=Path)
    parser.add_argument("--tasks", type=int, default=8)
    parser.add_argument("scenarios", nargs="*")
    asked = parser.parse_intermixed_args()
    main(asked.binary.resolve(), asked.tasks, asked.scenarios)
