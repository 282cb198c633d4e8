"""The map with DuckDB: SQL on the file as it lies there, its metadata included.

    python docs/recipes/with_duckdb.py results/quick.parquet [FIRST]

Answers: from which value of the second axis on is this value of the first reliable? And where does
the drum come nearest to the tub?
"""

import sys

import duckdb

UNITS = """
    SELECT entry.key AS name, entry.value ->> 'unit' AS unit
    FROM parquet_kv_metadata($path) AS pair, json_each(decode(pair.value)::JSON) AS entry
    WHERE decode(pair.key) = 'sweep.columns'
"""

AXES = """
    SELECT decode(value)::JSON ->> '$.axis[*].parameter'
    FROM parquet_kv_metadata($path) WHERE decode(key) = 'sweep.plan'
"""

# Names of columns cannot be parameters of a query, and are put in. A row without a verdict (null)
# is not a reliable one.
LEAST_SECOND = """
    WITH at_first AS (
        SELECT * FROM read_parquet($path)
        WHERE {first_axis} = (
            SELECT min({first_axis}) FROM read_parquet($path)
            WHERE {first_axis} >= $first
        )
    )
    SELECT
        min({first_axis}),
        min({second_axis}) FILTER (
            {second_axis} > coalesce(
                (SELECT max({second_axis}) FROM at_first WHERE reliable IS NOT TRUE),
                '-infinity'::DOUBLE
            )
        )
    FROM at_first
"""

NEAREST = """
    SELECT {first_axis}, {second_axis}, min_gap_nonlinear_m, reliable
    FROM read_parquet($path) ORDER BY min_gap_nonlinear_m LIMIT 5
"""


def units(path):
    """Column name to unit, from the file's metadata."""
    return dict(duckdb.execute(UNITS, {"path": path}).fetchall())


def axes(path):
    """The names of the map's two axes."""
    return duckdb.execute(AXES, {"path": path}).fetchone()[0]


def of_axes(query, path):
    """A query with the names of the map's axes."""
    first_axis, second_axis = axes(path)
    return query.format(first_axis=first_axis, second_axis=second_axis)


def least_second(path, first):
    """The first value of the first axis that is not below `first`, and the value of the second axis
    from which on it is reliable; None if even the greatest is not.
    """
    return duckdb.execute(of_axes(LEAST_SECOND, path), {"path": path, "first": first}).fetchone()


def main():
    """Read the command line, tell."""
    path, first = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else float("-inf")
    print(f"the five least gaps ({units(path)['min_gap_nonlinear_m']}), nonlinear model")
    first_axis, second_axis = axes(path)
    nearest = duckdb.execute(of_axes(NEAREST, path), {"path": path})
    for at_first, at_second, gap, reliable in nearest.fetchall():
        print(
            f"  {gap:.5f} at {first_axis} {at_first:g}, {second_axis} {at_second:g}"
            f"{'' if reliable else ', where the linear model is wrong'}"
        )
    kept, least = least_second(path, first)
    answer = "none of this map" if least is None else f"{least:g} and above"
    print(f"{first_axis} {kept:g} stays reliable at {second_axis} {answer}")


if __name__ == "__main__":
    main()
