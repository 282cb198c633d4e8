"""Compares the reading recipes with each other, on a map and on a changed copy. The copy lacks some
verdicts, and its second axis has another name.

    python scripts/checks/check_recipes.py MAP.parquet

Five libraries read the same file. Their units and answers must be the same, and no answer may
depend on a row without a verdict.
"""

import importlib
import pathlib
import sys
import tempfile

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

RECIPES = pathlib.Path(__file__).resolve().parent.parent.parent / "docs/recipes"
LIBRARIES = ["pyarrow", "pandas", "polars", "duckdb", "xarray"]


def expected_answer(path, mass_kg):
    """Computes the answer of the recipes by loops over rows."""
    second_axis = pq.read_schema(path).names[2]
    rows = pq.read_table(path, columns=["unbalance_mass_kg", second_axis, "reliable"]).to_pylist()
    mass = min(row["unbalance_mass_kg"] for row in rows if row["unbalance_mass_kg"] >= mass_kg)
    rows_of_mass = [row for row in rows if row["unbalance_mass_kg"] == mass]
    least_reliable = None
    for row in sorted(rows_of_mass, key=lambda row: -row[second_axis]):
        if row["reliable"] is not True:
            break
        least_reliable = row[second_axis]
    return mass, least_reliable


def write_changed_copy(path, copy):
    """Writes a copy without the verdicts of every seventh point and of the points with both the
    strongest damping and the greatest mass. In the copy the column of damping is named
    friction."""
    table = pq.read_table(path)
    has_strongest_damping = pc.equal(table["damping_n_s_per_m"], pc.max(table["damping_n_s_per_m"]))
    has_greatest_mass = pc.equal(table["unbalance_mass_kg"], pc.max(table["unbalance_mass_kg"]))
    point = table["point"].to_numpy()
    is_seventh_point = pa.chunked_array([pa.array(point % 7 == 3)])
    is_corner = pc.and_(has_strongest_damping, has_greatest_mass)
    lacks_verdict = pc.or_(is_seventh_point, is_corner)
    verdict_index = table.column_names.index("reliable")
    verdicts = pc.if_else(lacks_verdict, pa.scalar(None, pa.bool_()), table["reliable"])
    old_name, new_name = "damping_n_s_per_m", "friction_n"
    metadata = {
        key: value.replace(old_name.encode(), new_name.encode())
        for key, value in pq.read_metadata(path).metadata.items()
    }
    table = table.set_column(verdict_index, table.field(verdict_index), verdicts)
    table = table.rename_columns({old_name: new_name})
    pq.write_table(table.replace_schema_metadata(metadata), copy)


def main():
    """Prints all differences; returns 1 if there are any."""
    path = sys.argv[1]
    sys.path.insert(0, str(RECIPES))
    recipes = {name: importlib.import_module(f"with_{name}") for name in LIBRARIES}
    differences = []
    expected_units = recipes["pyarrow"].units(path)
    for name, recipe in recipes.items():
        if recipe.units(path) != expected_units:
            differences.append(f"{name}: the units differ from those by pyarrow")
    answers = []
    with tempfile.TemporaryDirectory() as folder:
        copy = str(pathlib.Path(folder, "without_verdicts.parquet"))
        write_changed_copy(path, copy)
        for file in (path, copy):
            masses = sorted(set(pq.read_table(file)["unbalance_mass_kg"].to_pylist()))
            for mass_kg in [*masses, (masses[0] + masses[-1]) / 2, 0.6]:
                expected = expected_answer(file, mass_kg)
                answers.append(expected)
                for name, recipe in recipes.items():
                    answer = tuple(recipe.least_second(file, mass_kg))
                    if answer != expected:
                        difference = f"{name}: {answer} for {mass_kg} kg in {file}"
                        differences.append(f"{difference}; expected {expected}")
    is_none = [damping is None for _, damping in answers]
    if not any(is_none) or all(is_none):
        differences.append("the map lacks masses with or masses without a reliable damping")
    for line in differences:
        print(line, file=sys.stderr)
    print(f"{len(answers)} answers, {len(expected_units)} units, {len(recipes)} libraries: "
          f"{len(differences)} differences")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
