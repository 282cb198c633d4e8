"""Holds the reading recipes against each other, on a map as it is and on the same map with verdicts
taken out, and its second axis under another name.

    python scripts/checks/check_recipes.py MAP.parquet

Five libraries read the same file: units and answers must be the same, and no answer may rest on a
row that has none.
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


def by_hand(path, mass_kg):
    """The answer by plain loops over plain rows."""
    second = pq.read_schema(path).names[2]
    rows = pq.read_table(path, columns=["unbalance_mass_kg", second, "reliable"]).to_pylist()
    mass = min(row["unbalance_mass_kg"] for row in rows if row["unbalance_mass_kg"] >= mass_kg)
    column = [row for row in rows if row["unbalance_mass_kg"] == mass]
    kept = None
    for row in sorted(column, key=lambda row: -row[second]):
        if row["reliable"] is not True:
            break
        kept = row[second]
    return mass, kept


def without_verdicts(path, copy):
    """Takes out the verdict of every seventh point, and of all at the strongest damping and the
    greatest mass; calls the damping friction."""
    table = pq.read_table(path)
    strongest = pc.equal(table["damping_n_s_per_m"], pc.max(table["damping_n_s_per_m"]))
    greatest = pc.equal(table["unbalance_mass_kg"], pc.max(table["unbalance_mass_kg"]))
    point = table["point"].to_numpy()
    gone = pc.or_(pa.chunked_array([pa.array(point % 7 == 3)]), pc.and_(strongest, greatest))
    place = table.column_names.index("reliable")
    verdicts = pc.if_else(gone, pa.scalar(None, pa.bool_()), table["reliable"])
    renamed = [b"damping_n_s_per_m", b"friction_n"]
    told = {key: value.replace(*renamed) for key, value in pq.read_metadata(path).metadata.items()}
    old, new = (name.decode() for name in renamed)
    table = table.set_column(place, table.field(place), verdicts).rename_columns({old: new})
    pq.write_table(table.replace_schema_metadata(told), copy)


def main():
    """Compare; exit with 1 if anything differs."""
    path = sys.argv[1]
    sys.path.insert(0, str(RECIPES))
    recipes = {name: importlib.import_module(f"with_{name}") for name in LIBRARIES}
    wrong = []
    expected = recipes["pyarrow"].units(path)
    for name, recipe in recipes.items():
        if recipe.units(path) != expected:
            wrong.append(f"{name}: other units than pyarrow sees")
    answers = []
    with tempfile.TemporaryDirectory() as folder:
        copy = str(pathlib.Path(folder, "without_verdicts.parquet"))
        without_verdicts(path, copy)
        for file in (path, copy):
            masses = sorted(set(pq.read_table(file)["unbalance_mass_kg"].to_pylist()))
            for mass_kg in [*masses, (masses[0] + masses[-1]) / 2, 0.6]:
                right = by_hand(file, mass_kg)
                answers.append(right)
                for name, recipe in recipes.items():
                    answer = tuple(recipe.least_second(file, mass_kg))
                    if answer != right:
                        found = f"{name}: {answer} for {mass_kg} kg in {file}"
                        wrong.append(f"{found}; by hand {right}")
    is_none = [damping is None for _, damping in answers]
    if not any(is_none) or all(is_none):
        wrong.append("the map has no masses of both kinds: with and without a damping that does")
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"{len(answers)} answers, {len(expected)} units, {len(recipes)} libraries: "
          f"{len(wrong)} differences")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
