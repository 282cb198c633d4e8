"""Tests sweeps on a Slurm cluster, also with a killed task, node or controller.

usage: check.py SWEEP_BINARY [--tasks N] [SCENARIO ...]

In each scenario the merged file must have the same bytes as that of a single machine. Requires
root, slurm-wlm and munge; run.sh installs the packages.
"""

import argparse
import json
import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import cluster
from cluster import Cluster

# Each task has two chunks, which take some tenths of a second.
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
    """A sweep of a grid on the cluster, in a separate folder."""

    def __init__(self, slurm: Cluster, binary: Path, folder: Path, shards: int):
        self.slurm, self.binary, self.folder, self.shards = slurm, binary, folder, shards
        # The number of points of a chunk, which the program chooses by the size of the grid.
        self.chunk_points = 8 if shards <= 8 else 32
        folder.mkdir()
        grid = GRID.replace("STEP_S", str(1e-5 * self.chunk_points / 8))
        grid = grid.replace("CHUNKS", str(2 * shards)).replace("POINTS", str(self.chunk_points))
        (folder / "array.toml").write_text(grid)
        self.result = folder / "results/array.parquet"
        self.partial = folder / "results/array.parquet.partial"

    def sweep(self, *arguments: str, code: int = 0) -> subprocess.CompletedProcess:
        command = [self.binary, *arguments]
        completed = subprocess.run(
            command, cwd=self.folder, env=self.slurm.environment, capture_output=True, text=True
        )
        assert (
            completed.returncode == code
        ), f"{arguments} ended with {completed.returncode}, not {code}: {completed.stderr}"
        return completed

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
        """Runs the printed script; returns the job numbers of the array and of the merge."""
        output = self.slurm.run_command("sh", str(self.script()), *arguments)
        words = output.replace(",", "").split()
        assert words[0::2] == ["array", "merge"], output
        return words[1], words[3]

    def stop_in_mid_shard(self) -> tuple[str, int]:
        """Stops the process of a task that has finished one of its two chunks. Returns the numbers
        of the task and of the process."""
        stopped_tasks = []

        def stop_task():
            for shard in range(1, self.shards + 1):
                pid = self.process(str(shard)) if self.chunks(shard) == 1 else None
                if pid:
                    os.kill(pid, signal.SIGSTOP)
                    if self.chunks(shard) == 1:
                        stopped_tasks.append((str(shard), pid))
                        return True
                    os.kill(pid, signal.SIGCONT)
            return False

        self.slurm.wait_for("task with one chunk", stop_task, 60,
                            lambda: self.slurm.tasks(self.array))
        return stopped_tasks[0]

    def chunks(self, shard: int) -> int:
        numbers = (shard - 1, shard - 1 + self.shards)
        return sum((self.partial / f"part-{chunk:08}.parquet").exists() for chunk in numbers)

    def process(self, task: str) -> int | None:
        """Returns the process of a task's sweep, if it runs."""
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
        assert self.result.read_bytes() == expected, "the bytes are not those of one machine"
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
    """Runs an array without options, whose shards follow from the environment, and submits a part
    of it again."""
    wrap = f"--wrap={sweep.binary} run array.toml"
    job = sweep.slurm.run_command(
        "sbatch",
        "--parsable",
        f"--array=0-{sweep.shards - 1}",
        "--open-mode=append",
        wrap,
        cwd=sweep.folder,
    ).strip()
    sweep.slurm.wait_for("beginning", lambda: (sweep.partial / "shards.json").exists(), 30)
    sweep.slurm.run_command("scancel", "--state=PENDING", job)
    sweep.slurm.wait_for_job(job, 60)
    status = sweep.status()
    assert status["shards"] == sweep.shards and status["missing_shards"], status
    message = sweep.sweep("merge", "array.toml", code=1).stderr
    assert "is incomplete" in message and "of shards" in message, message
    second_job = sweep.slurm.run_command(
        "sbatch", "--parsable", f"--array={status['missing_shards']}", wrap, cwd=sweep.folder
    ).strip()
    assert set(sweep.slurm.wait_for_job(second_job, 90).values()) == {"COMPLETED"}, sweep.logs()
    assert sweep.status()["state"] == "complete"
    sweep.sweep("merge", "array.toml")
    sweep.assert_same(expected)


def task_killed(sweep: Sweep, expected: bytes):
    sweep.array, merge = sweep.submit()
    task, process = sweep.stop_in_mid_shard()
    os.kill(process, signal.SIGKILL)
    states = sweep.slurm.wait_for_job(sweep.array, 90)
    assert states.pop(task) == "FAILED" and set(states.values()) == {"COMPLETED"}, states
    # The merge has failed, because a chunk is missing.
    final_states = sweep.slurm.wait_for_job(merge, 30)
    assert final_states == {"N/A": "FAILED"}, final_states
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
    task, process = sweep.stop_in_mid_shard()
    node = cluster.environment(process)["SLURMD_NODENAME"]
    victims = slurm.kill_node(node)
    assert process in victims, "the node's power cut spared its task"

    def is_down():
        state = slurm.run_command("sinfo", "-h", "-n", node, "-o", "%T")
        return state.strip().rstrip("*") == "down"

    slurm.wait_for(f"state down of {node}", is_down, 60)
    slurm.wait_for(
        "task queued again", lambda: slurm.tasks(sweep.array)[task]["state"] == "PENDING", 30
    )
    # After a failure of its node, Slurm starts a task two minutes later. This command starts it
    # immediately.
    slurm.run_command("scontrol", "update", f"JobId={sweep.array}_{task}", "StartTime=now")
    assert set(slurm.wait_for_job(sweep.array, 120).values()) == {"COMPLETED"}, sweep.logs()
    assert slurm.wait_for_job(merge, 60) == {"N/A": "COMPLETED"}, sweep.logs()
    log = (sweep.folder / f"results/array.slurm-{sweep.array}_{task}.log").read_text()
    assert (
        f"going on: {sweep.chunk_points} of {2 * sweep.chunk_points} points are there" in log
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
    _, process = sweep.stop_in_mid_shard()
    slurm.wait_until_saved(submitted)
    slurm.kill("slurmctld")
    # The tasks on the nodes continue and end without a controller.
    os.kill(process, signal.SIGCONT)
    time.sleep(2)
    slurm.start_controller()

    # A controller that lost tasks queues them again with a delay; one that lost the start of a
    # task may start it twice and then drain the node. Both states are resolved by commands.
    def is_over():
        for task, facts in slurm.tasks(sweep.array).items():
            if facts["state"] == "PENDING":
                slurm.run_command(
                    "scontrol",
                    "update",
                    f"JobId={sweep.array}_{task}",
                    "StartTime=now",
                    check=False,
                )
        for node in ("n1", "n2"):
            if slurm.run_command("sinfo", "-h", "-n", node, "-o", "%T").startswith("drain"):
                slurm.run_command("scontrol", "update", f"NodeName={node}", "State=RESUME")
        return slurm.is_over(sweep.array) and slurm.is_over(merge)

    slurm.wait_for("end of array and merge", is_over, 120, lambda: slurm.tasks(sweep.array))
    if not sweep.result.exists():
        # `sweep status` finds the shards that the controller has lost.
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
            start_s = time.monotonic()
            alone.sweep("run", "array.toml", "--progress", "none")
            expected = alone.result.read_bytes()
            print(f"single machine: {time.monotonic() - start_s:.0f} s", flush=True)
            for scenario in SCENARIOS:
                if names and scenario.__name__ not in names:
                    continue
                start_s = time.monotonic()
                scenario(Sweep(slurm, binary, home / scenario.__name__, shards), expected)
                print(
                    f"{scenario.__name__}: {time.monotonic() - start_s:.0f} s, the same bytes",
                    flush=True,
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("binary", type=Path)
    parser.add_argument("--tasks", type=int, default=8)
    parser.add_argument("scenarios", nargs="*")
    arguments = parser.parse_intermixed_args()
    main(arguments.binary.resolve(), arguments.tasks, arguments.scenarios)
