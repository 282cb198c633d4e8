#!/usr/bin/env python3
"""Opens a result's exports by the programs that people open them with, and compares every cell.

    scripts/checks/check_exports.sh MAP.parquet

Workbooks by openpyxl, CSV by pandas, NetCDF of the recipe by netCDF4; the result by pyarrow.
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
units = {name: told["unit"] for name, told in json.loads(metadata[b"sweep.columns"]).items()}
plan = json.loads(metadata[b"sweep.plan"])


def shown(name):
    """A column's unit as exports say it: none of pure numbers."""
    return "" if units[name] == "1" else units[name]


def same(ours, theirs):
    """One value, whatever stands for a missing one."""
    if ours is None:
        return theirs is None or (isinstance(theirs, float) and math.isnan(theirs))
    if isinstance(ours, bool):
        return str(theirs).lower() in (("true", "1") if ours else ("false", "0"))
    return ours == theirs


def compare(what, found):
    """Every row of the result against what another program read."""
    found = list(found)
    assert len(found) == len(rows), f"{what}: {len(found)} rows, not {len(rows)}"
    for number, (ours, theirs) in enumerate(zip(rows, found)):
        for name, one, other in zip(names, ours, theirs, strict=True):
            assert same(one, other), f"{what}: row {number}, {name}: {other!r}, not {one!r}"
    print(f"{what}: {len(rows)} rows of {len(names)} columns are the result's")


with tempfile.TemporaryDirectory() as folder:
    files = {ending: pathlib.Path(folder) / f"map.{ending}" for ending in ("csv", "xlsx")}
    for path in files.values():
        subprocess.run([sweep, "export", source, str(path)], check=True)

    book = openpyxl.load_workbook(files["xlsx"])
    first, *others = book.worksheets
    header, told, *cells = first.iter_rows(values_only=True)
    assert list(header) == names, header
    assert [unit or "" for unit in told] == [shown(name) for name in names], told
    compare("openpyxl", cells)
    assert first.freeze_panes == "A3", first.freeze_panes
    last = openpyxl.utils.get_column_letter(len(names))
    assert first.auto_filter.ref == f"A2:{last}{len(rows) + 2}", first.auto_filter.ref
    assert first.column_dimensions["A"].width > 10
    said = {cell for sheet in others for row in sheet.iter_rows(values_only=True) for cell in row}
    assert set(names) <= said and plan["name"] in said

    table = pandas.read_csv(files["csv"], comment="#")
    assert list(table.columns) == names
    cleaned = table.astype(object).where(table.notna(), None)
    compare("pandas", cleaned.itertuples(index=False, name=None))

    axes = [axis["parameter"] for axis in plan["axis"]]
    sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "docs" / "recipes"))
    import with_xarray

    path = pathlib.Path(folder) / "map.nc"
    with_xarray.write_netcdf(with_xarray.load(source), path)
    with netCDF4.Dataset(path) as data:
        data.set_auto_mask(False)
        places = [[data.variables[axis][:].tolist() for axis in axes], axes]
        for number, row in enumerate(rows):
            at = tuple(own.index(row[names.index(axis)]) for own, axis in zip(*places))
            for name in set(names) - set(axes):
                found, ours = data.variables[name][at], row[names.index(name)]
                # NetCDF has no truth values.
                ours = int(ours) if isinstance(ours, bool) else ours
                words = isinstance(found, str)
                fits = found == str(ours) or ours is None if words else same(ours, float(found))
                assert fits, f"netCDF4: row {number}, {name}: {found!r}, not {ours!r}"
                if units[name] not in ("", "1"):
                    assert data.variables[name].units == units[name], name
    print(f"netCDF4: {len(names)} columns of the recipe's file are the result's")
