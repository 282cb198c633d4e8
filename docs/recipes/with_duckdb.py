"""The map with DuckDB: SQL on the file as it lies there, its metadata included.

    python docs/recipes/with_duckdb.py results/quick.parquet [MASS_KG]

Answers: which least damping keeps this unbalance reliable? And where does the drum come nearest to
the tub?
"""

import sys

import duckdb

UNITS = """
    SELECT entry.key AS name, entry.value ->> 'unit' AS unit
    FROM parquet_kv_metadata($path) AS pair, json_each(decode(pair.value)::JSON) AS entry
    WHERE decode(pair.key) = 'sweep.columns'
"""

# A row without a verdict (null) is not a reliable one.
LEAST_DAMPING = """
    WITH at_mass AS (
        SELECT * FROM read_parquet($path)
        WHERE unbalance_mass_kg = (
            SELECT min(unbalance_mass_kg) FROM read_parquet($path)
            WHERE unbalance_mass_kg >= $mass_kg
        )
    )
    SELECT
        min(unbalance_mass_kg),
        min(damping_n_s_per_m) FILTER (
            damping_n_s_per_m > coalesce(
                (SELECT max(damping_n_s_per_m) FROM at_mass WHERE reliable IS NOT TRUE),
                '-infinity'::DOUBLE
            )
        )
    FROM at_mass
"""

NEAREST = """
    SELECT unbalance_mass_kg, damping_n_s_per_m, min_gap_nonlinear_m, reliable
    FROM read_parquet($path) ORDER BY min_gap_nonlinear_m LIMIT 5
"""


def units(path):
    """Column name to unit, from the file's metadata."""
    return dict(duckdb.execute(UNITS, {"path": path}).fetchall())


def least_damping(path, mass_kg):
    """(mass, damping): the first mass of the grid not below `mass_kg`, and the damping from which
    on it is reliable.

    The damping is None if even the strongest of the map does not do.
    """
    return duckdb.execute(LEAST_DAMPING, {"path": path, "mass_kg": mass_kg}).fetchone()


def main():
    """Read the command line, tell."""
    path, mass_kg = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.6
    print(f"the five least gaps ({units(path)['min_gap_nonlinear_m']}), nonlinear model")
    for mass, damping, gap, reliable in duckdb.execute(NEAREST, {"path": path}).fetchall():
        print(
            f"  {gap:.5f} at {mass:g} kg, {damping:g} N "
            f"s/m{'' if reliable else ', where the linear model is wrong'}"
        )
    mass, damping = least_damping(path, mass_kg)
    answer = "at no damping of this map" if damping is None else f"from {damping:g} N s/m"
    print(f"{mass_kg:g} kg stays reliable {answer} (grid: {mass:g} kg)")


if __name__ == "__main__":
    main()
