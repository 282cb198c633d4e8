"""Checks that a manifest with a mistake is refused, and runs the commands of the manifests.

usage: check.py SWEEP_BINARY FOLDER

The shards run on this machine, each with the index that Kubernetes would set in the environment of
its container. Then they are merged.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import kubernetes_validate
import yaml

# Each shard has two points, whose trajectories are short.
GRID = """
[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = 0.01
[integrator]
method = "rk4"
[[axis]]
parameter = "unbalance_mass_kg"
range = { from = 0.05, to = 1.0, count = 100 }
"""


def main(binary: str, folder: Path):
    sweep, merge = (
        yaml.safe_load((folder / name).read_text()) for name in ("sweep.yaml", "merge.yaml")
    )

    misspelt = yaml.safe_load((folder / "sweep.yaml").read_text())
    misspelt["spec"]["completionmode"] = misspelt["spec"].pop("completionMode")
    try:
        kubernetes_validate.validate(misspelt, "1.37", strict=True)
        sys.exit("a misspelt field was accepted: the schema is not applied")
    except kubernetes_validate.ValidationError:
        pass

    with tempfile.TemporaryDirectory() as home:
        Path(home, "fig12.toml").write_text(GRID)
        run_job(binary, merge, home, expected_code=1)
        for index in range(sweep["spec"]["completions"]):
            run_job(binary, sweep, home, {"JOB_COMPLETION_INDEX": str(index)})
        run_job(binary, merge, home)
        assert Path(home, "results/fig12.parquet").is_file()
    print("kubernetes: manifests valid, their commands compute and merge a sweep")


def run_job(
    binary: str, job: dict, home: str, environment: dict[str, str] = {}, expected_code: int = 0
):
    (container,) = job["spec"]["template"]["spec"]["containers"]
    command, *arguments = container["command"]
    assert command == "sweep"
    completed = subprocess.run(
        [binary, *arguments],
        cwd=home,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )
    assert (
        completed.returncode == expected_code
    ), f"{arguments} {environment} ended with {completed.returncode}: {completed.stderr}"


if __name__ == "__main__":
    main(str(Path(sys.argv[1]).resolve()), Path(sys.argv[2]))
