#!/usr/bin/env python3
"""What each method costs and how accurate it is: writes the table of docs/method.md.

    scripts/tools/python.sh scripts/benchmarks/method_costs.py SWEEP_BINARY [POINTS_PER_AXIS]

Runs the map of `sweeps/quick.toml` by each method on one thread. Processor time is told, which
other work on the machine disturbs less than it does the wall's. The error is the worst relative
difference of an amplitude, of either model, from plain `rk4` at a quarter of its usual step, over
the points that are reliable: elsewhere most motions are chaotic, and no two methods agree on their
digits.
"""

import pathlib
import re
import sys
import tempfile

import pyarrow.compute as pc
import pyarrow.parquet as pq
from measured import ROOT, Spent, figure, put, said, table

GRID = (ROOT / "sweeps/quick.toml").read_text()

REFERENCE = 'method = "rk4"\nstep_s = 5e-5'
METHODS = [
    *(f'method = "rk4-mass-scaled"\naccuracy = {accuracy}'
      for accuracy in ("1e-2", "1e-3", "1e-4")),
    *(f'method = "rk4"\nstep_s = {step_s}' for step_s in ("2e-4", "1e-4")),
    *(f'method = "dopri5"\nrtol = {rtol}\natol = {atol}'
      for rtol, atol in (("1e-6", "1e-9"), ("1e-9", "1e-12"))),
    *(f'method = "additive"\nrtol = {rtol}\natol = {atol}'
      for rtol, atol in (("1e-4", "1e-7"), ("1e-6", "1e-9"))),
]


def run(sweep, folder, integrator, count):
    """The map by one method, and its processor time in seconds."""
    grid, out = folder / "grid.toml", folder / "map.parquet"
    text = re.sub(r"\[integrator\].*?\n\n", f"[integrator]\n{integrator}\n\n", GRID, flags=re.S)
    grid.write_text(text.replace("count = 9", f"count = {count}"))
    spent = Spent(sweep, "run", grid, "--out", out, "--fresh", "--threads", "1")
    return pq.read_table(out), spent.core_s


def error(found, reference):
    """Worst relative difference of an amplitude where the reference is reliable."""
    reliable = reference["reliable"]
    worst = 0.0
    for name in reference.column_names:
        if name.startswith(("nonlinear_", "linear_")):
            right = reference[name].filter(reliable)
            apart = pc.abs(pc.divide(pc.subtract(found[name].filter(reliable), right), right))
            worst = max(worst, pc.max(apart).as_py())
    return worst


def main():
    """Measure, and put the table into the page."""
    sweep, count = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 9
    heads = ["`[integrator]`", "points per core-second", "steps, both models", "worst error",
             "verdicts other than the reference's"]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        reference, _ = run(sweep, folder, REFERENCE, count)
        for integrator in METHODS:
            found, spent_s = run(sweep, folder, integrator, count)
            steps = pc.mean(pc.add(found["steps_nonlinear"], found["steps_linear"])).as_py()
            other = pc.sum(pc.not_equal(found["reliable"], reference["reliable"])).as_py()
            shown = integrator.replace("\n", ", ").replace('"', "").replace("method = ", "")
            rows.append([f"`{shown}`", figure(found.num_rows / spent_s), f"{steps:.0f}",
                         f"{error(found, reference):.0e}", other])
            print(rows[-1], file=sys.stderr, flush=True)
    put("docs/method.md", "costs", table(heads, rows), said())


if __name__ == "__main__":
    main()
