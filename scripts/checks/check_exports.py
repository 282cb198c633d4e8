#!/usr/bin/env python3
"""Reads the exports of a result with common programs, and compares every cell with the result.

    scripts/checks/check_exports.sh MAP.parquet

openpyxl reads the workbook, pandas the CSV file, netCDF4 the NetCDF file of the recipe, and pyarrow
the result.
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

import netCDF4
import openpyxl
import pandas
import pyarrow.parquet

sweep, source = sys.argv[1:]
result = pyarrow.parquet.read_table(source)
names = result.column_names
rows = [[result[name][k].as_py() for name in names] for k in range(result.num_rows)]
metadata = pyarrow.parquet.read_metadata(source).metadata
units = {name: column["unit"] for name, column in json.loads(metadata[b"sweep.columns"]).items()}
plan = json.loads(metadata[b"sweep.plan"])


def exported_unit(name):
    """Returns a column's unit as in exports, where numbers without a unit have an empty text."""
    return "" if units[name] == "1" else units[name]


def is_same(result_value, exported_value):
    """Returns whether an exported value equals that of the result. NaN and `None` are missing
    values."""
    if result_value is None:
        is_nan = isinstance(exported_value, float) and math.isnan(exported_value)
        return exported_value is None or is_nan
    if isinstance(result_value, bool):
        return str(exported_value).lower() in (("true", "1") if result_value else ("false", "0"))
    return result_value == exported_value


def compare(program, exported_rows):
    """Asserts that another program has read the rows of the result."""
    exported_rows = list(exported_rows)
    assert len(exported_rows) == len(rows), f"{program}: {len(exported_rows)} rows, not {len(rows)}"
    for number, (row, exported_row) in enumerate(zip(rows, exported_rows)):
        for name, value, exported in zip(names, row, exported_row, strict=True):
            message = f"{program}: row {number}, {name}: {exported!r}, not {value!r}"
            assert is_same(value, exported), message
    print(f"{program}: {len(rows)} rows of {len(names)} columns are the result's")


with tempfile.TemporaryDirectory() as folder:
    files = {ending: pathlib.Path(folder) / f"map.{ending}" for ending in ("csv", "xlsx")}
    for path in files.values():
        subprocess.run([sweep, "export", source, str(path)], check=True)

    book = openpyxl.load_workbook(files["xlsx"])
    first_sheet, *other_sheets = book.worksheets
    header, exported_units, *cells = first_sheet.iter_rows(values_only=True)
    assert list(header) == names, header
    assert [unit or "" for unit in exported_units] == [
        exported_unit(name) for name in names
    ], exported_units
    compare("openpyxl", cells)
    assert first_sheet.freeze_panes == "A3", first_sheet.freeze_panes
    last_column = openpyxl.utils.get_column_letter(len(names))
    filter_range = first_sheet.auto_filter.ref
    assert filter_range == f"A2:{last_column}{len(rows) + 2}", filter_range
    assert first_sheet.column_dimensions["A"].width > 10
    other_cells = {
        cell
        for sheet in other_sheets
        for row in sheet.iter_rows(values_only=True)
        for cell in row
    }
    assert set(names) <= other_cells and plan["name"] in other_cells

    table = pandas.read_csv(files["csv"], comment="#")
    assert list(table.columns) == names
    table_with_none = table.astype(object).where(table.notna(), None)
    compare("pandas", table_with_none.itertuples(index=False, name=None))

    axes = [axis["parameter"] for axis in plan["axis"]]
    sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "docs" / "recipes"))
    import with_xarray

    path = pathlib.Path(folder) / "map.nc"
    with_xarray.write_netcdf(with_xarray.load(source), path)
    with netCDF4.Dataset(path) as data:
        data.set_auto_mask(False)
        values_of_axes = [data.variables[axis][:].tolist() for axis in axes]
        for number, row in enumerate(rows):
            indices = tuple(
                values.index(row[names.index(axis)]) for values, axis in zip(values_of_axes, axes)
            )
            for name in set(names) - set(axes):
                exported, value = data.variables[name][indices], row[names.index(name)]
                # NetCDF has no booleans.
                value = int(value) if isinstance(value, bool) else value
                if isinstance(exported, str):
                    is_equal = exported == str(value) or value is None
                else:
                    is_equal = is_same(value, float(exported))
                assert is_equal, f"netCDF4: row {number}, {name}: {exported!r}, not {value!r}"
                if units[name] not in ("", "1"):
                    assert data.variables[name].units == units[name], name
    print(f"netCDF4: {len(names)} columns of the recipe's file are the result's")
