#!/usr/bin/env python3
"""Measures the cost and the accuracy of each method, and writes the table of docs/method.md.

    scripts/tools/python.sh scripts/benchmarks/method_costs.py SWEEP_BINARY [POINTS_PER_AXIS]

Runs the map of `sweeps/quick.toml` by each method on one thread. Times are processor times, which
other work on the machine disturbs less than wall times. The error is the greatest relative
difference of an amplitude of either model from that of plain `rk4` at a quarter of its usual step.
Only reliable points count: most other motions are chaotic, so that no two methods agree on their
digits.
"""

import pathlib
import re
import sys
import tempfile

import pyarrow.compute as pc
import pyarrow.parquet as pq
from measured import (
    ROOT,
    MeasuredCommand,
    format_number,
    markdown_table,
    measurement_note,
    write_between_marks,
)

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


def compute_map(sweep, folder, integrator, count):
    """Computes the map by one method; returns its table and its processor time (s)."""
    grid, out = folder / "grid.toml", folder / "map.parquet"
    text = re.sub(r"\[integrator\].*?\n\n", f"[integrator]\n{integrator}\n\n", GRID, flags=re.S)
    grid.write_text(text.replace("count = 9", f"count = {count}"))
    command = MeasuredCommand(sweep, "run", grid, "--out", out, "--fresh", "--threads", "1")
    return pq.read_table(out), command.core_s


def max_error(table, reference):
    """Returns the greatest relative difference of an amplitude where the reference is reliable."""
    is_reliable = reference["reliable"]
    greatest = 0.0
    for name in reference.column_names:
        if name.startswith(("nonlinear_", "linear_")):
            expected = reference[name].filter(is_reliable)
            computed = table[name].filter(is_reliable)
            errors = pc.abs(pc.divide(pc.subtract(computed, expected), expected))
            greatest = max(greatest, pc.max(errors).as_py())
    return greatest


def main():
    """Measures all methods and writes the table into the page."""
    sweep, count = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 9
    headings = ["`[integrator]`", "points per core-second", "steps, both models", "worst error",
                "verdicts other than the reference's"]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        reference, _ = compute_map(sweep, folder, REFERENCE, count)
        for integrator in METHODS:
            result, core_s = compute_map(sweep, folder, integrator, count)
            steps = pc.mean(pc.add(result["steps_nonlinear"], result["steps_linear"])).as_py()
            other_verdicts = pc.sum(pc.not_equal(result["reliable"], reference["reliable"])).as_py()
            settings = integrator.replace("\n", ", ").replace('"', "").replace("method = ", "")
            rows.append([f"`{settings}`", format_number(result.num_rows / core_s), f"{steps:.0f}",
                         f"{max_error(result, reference):.0e}", other_verdicts])
            print(rows[-1], file=sys.stderr, flush=True)
    table = markdown_table(headings, rows)
    write_between_marks("docs/method.md", "costs", table, measurement_note())


if __name__ == "__main__":
    main()
