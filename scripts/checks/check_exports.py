#!/usr/bin/env python3
"""Opens a result's exports by the programs that people open them with, and compares every cell.

    scripts/checks/check_exports.sh MAP.parquet

Workbooks by openpyxl, NetCDF by netCDF4 and by xarray, CSV by pandas; the result by pyarrow.
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
import xarray

sweep, source = sys.argv[1:]
result = pyarrow.parquet.read_table(source)
names = result.column_names
rows = [[result[name][k].as_py() for name in names] for k in range(result.num_rows)]
units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in result.schema}
plan = json.loads(pyarrow.parquet.read_metadata(source).metadata[b"sweep.plan"])


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


def flags(variable):
    """What codes of words mean, by the CF conventions; nothing for numbers."""
    if "flag_values" not in variable.ncattrs():
        return None
    words = variable.flag_meanings.split(" ")
    values = [variable.flag_values] if len(words) == 1 else list(variable.flag_values)
    return dict(zip([int(value) for value in values], words, strict=True))


with tempfile.TemporaryDirectory() as folder:
    files = {ending: pathlib.Path(folder) / f"map.{ending}" for ending in ("csv", "xlsx", "nc")}
    for path in files.values():
        subprocess.run([sweep, "export", source, str(path)], check=True)

    book = openpyxl.load_workbook(files["xlsx"])
    first, *others = book.worksheets
    header, told, *cells = first.iter_rows(values_only=True)
    assert list(header) == names, header
    assert [unit or "" for unit in told] == [shown(name) for name in names], told
    compare("openpyxl", cells)
    said = {cell for sheet in others for row in sheet.iter_rows(values_only=True) for cell in row}
    assert set(names) <= said and plan["name"] in said

    table = pandas.read_csv(files["csv"], comment="#")
    assert list(table.columns) == names
    cleaned = table.astype(object).where(table.notna(), None)
    compare("pandas", cleaned.itertuples(index=False, name=None))

    axes = [axis["parameter"] for axis in plan["axis"]]
    with netCDF4.Dataset(files["nc"]) as data:
        data.set_auto_mask(False)
        shape = [len(data.dimensions[axis]) for axis in axes]
        assert math.prod(shape) == len(rows), shape
        for name in names:
            variable = data.variables.get(name)
            if name in axes:
                values = data.variables[name][:].tolist()
                assert sorted(values) == sorted({row[names.index(name)] for row in rows})
                continue
            assert variable is not None, f"netCDF4: no variable {name}"
            if units[name] not in ("", "1"):
                assert variable.units == units[name], f"{name}: {variable.units}"
            meanings = flags(variable)
            flat = variable[:].reshape(-1).tolist()
            assert len(flat) == len(rows), f"netCDF4: {name} has {len(flat)} values"
            for number, found in enumerate(flat):
                found = meanings.get(int(found)) if meanings else found
                ours = rows[number][names.index(name)]
                assert same(ours, found), f"netCDF4: row {number}, {name}: {found!r}, not {ours!r}"
    print(f"netCDF4: {len(names)} columns over {' by '.join(map(str, shape))} are the result's")

    with xarray.open_dataset(files["nc"]) as data:
        place = {axis: rows[-1][names.index(axis)] for axis in axes}
        found = float(data["ratio_max"].sel(place))
        assert found == rows[-1][names.index("ratio_max")], found
    print("xarray: finds a point by the values of its axes")
