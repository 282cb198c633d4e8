#!/usr/bin/env python3
"""Checks that the JSON Schemas of `sweep schema` accept every valid grid and machine file, and
refuse invalid ones.

    python scripts/checks/check_schema.py [SWEEP_BINARY]

Requires Python 3.11 and the package jsonschema.
"""

import json
import pathlib
import subprocess
import sys
import tomllib

import jsonschema

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BROKEN_GRIDS = ROOT / "crates/sweep/testdata/broken"
# Invalid grid files whose mistake a schema can detect, because it concerns a single value.
REFUSED = [
    "axis_single_brackets", "axis_spacing_unknown", "axis_values_and_range", "axis_values_empty",
    "channels_empty", "channels_unknown_and_repeated", "count_fraction", "count_negative",
    "count_overflow", "count_zero", "dotted_keys", "end_beyond_reason", "end_zero", "key_missing",
    "key_unknown",
    "key_unknown_in_every_section", "measures_empty", "measures_unknown",
    "method_left_out_with_keys_of_others", "method_removed", "method_unknown",
    "method_with_keys_of_others",
    "name_is_a_path", "name_is_hidden", "number_huge",
    "profile_unknown", "profile_with_keys_of_the_table", "section_missing", "set_out_of_range",
    "set_with_a_string", "spin_out_of_range", "spin_table_empty", "spin_table_with_keys_of_a_ramp",
    "step_zero", "type_wrong", "type_wrong_in_array", "window_negative", "window_of_three",
]
# Tests of distributions, which no grid file of sweeps/ has.
DESIGN = """
[design]
method = "monte_carlo"
points = 8
"""
GRID_WITH_DISTRIBUTION = """
[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = 50.0
[[axis]]
parameter = "unbalance_mass_kg"
RANGE
[[axis]]
parameter = "damping_n_s_per_m"
distribution = { kind = "normal", mean = 120.0, sd = 10.0 }
"""


def main() -> int:
    sweep = sys.argv[1] if len(sys.argv) > 1 else "sweep"

    def run_sweep(*arguments: str) -> str:
        command = [sweep, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    schemas = {}
    for kind, arguments in {"grid": ["schema"], "machine": ["schema", "--machine"]}.items():
        schema = json.loads(run_sweep(*arguments))
        jsonschema.Draft202012Validator.check_schema(schema)
        schemas[kind] = jsonschema.Draft202012Validator(schema)

    failures = []

    def expect(kind: str, name: str, text: str, is_valid: bool) -> None:
        errors = [error.message for error in schemas[kind].iter_errors(tomllib.loads(text))]
        if is_valid and errors:
            failures.append(f"{name} should be accepted: {errors[0]}")
        if not is_valid and not errors:
            failures.append(f"{name} should be refused")

    grids = sorted((ROOT / "sweeps").glob("*.toml"))
    for path in grids:
        expect("grid", path.name, path.read_text(), True)
    expect("grid", "sweep init", run_sweep("init", "-"), True)
    expect("machine", "sweep init --machine", run_sweep("init", "--machine", "-"), True)
    without_count, with_count = (
        GRID_WITH_DISTRIBUTION.replace("RANGE", f"range = {{ from = 0.1, to = 1.0{count} }}")
        for count in ("", ", count = 3")
    )
    expect("grid", "a design with a distribution", DESIGN + without_count, True)
    expect("grid", "a design with a count", DESIGN + with_count, False)
    expect("grid", "a distribution without a design", with_count, False)
    for name in REFUSED:
        expect("grid", name, (BROKEN_GRIDS / f"{name}.toml").read_text(), False)
    for name in ["empty", "impossible", "incomplete"]:
        expect("machine", name, (BROKEN_GRIDS / f"machines/{name}.toml").read_text(), False)

    for failure in failures:
        print(failure, file=sys.stderr)
    print(f"{len(grids) + 3} files accepted, {len(REFUSED) + 5} refused, {len(failures)} wrong",
          file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
