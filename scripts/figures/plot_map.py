"""Draw a map's ratio over its first two axes, with the line on which it is at its limit.

    python scripts/figures/plot_map.py FILE [-o OUT.png]

Reads the Parquet file alone: what stands in its columns and metadata is all that is drawn. Further
axes are cut at their first value, which the title names.
"""

import argparse
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from matplotlib.collections import PatchCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.patches import Rectangle


def value_of(node, key):
    """The first value stored under `key` in nested JSON, outer levels first; None if there is
    none."""
    if isinstance(node, dict):
        if key in node:
            return node[key]
        node = list(node.values())
    if isinstance(node, list):
        for inner in node:
            found = value_of(inner, key)
            if found is not None:
                return found
    return None


def provenance(file):
    """The file's key-value metadata, parsed where it is JSON."""
    entries = {}
    for key, value in (file.schema_arrow.metadata or {}).items():
        try:
            entries[key.decode()] = json.loads(value)
        except ValueError:
            entries[key.decode()] = value.decode(errors="replace")
    return entries


def read(path):
    """Axes as (label, values), the ratio on their grid, where a point failed, the limit, and the
    run's name."""
    try:
        file = pq.ParquetFile(path)
        table = file.read()
    except (OSError, pa.ArrowException) as error:
        sys.exit(f"{path}: cannot be read: {error}")
    names = table.column_names
    results = [k for k, name in enumerate(names) if name.startswith(("nonlinear_", "linear_"))]
    if not results or "ratio_max" not in names or "status" not in names:
        sys.exit(f"{path}: not a map file: it lacks the columns nonlinear_..., ratio_max or status")
    axes = [name for name in names[: results[0]] if name != "point"]
    if len(axes) < 2:
        sys.exit(f"{path}: a picture of a map needs two axes, this file has {len(axes)}")

    columns = [table[name].to_numpy() for name in axes]
    values, places = zip(*(np.unique(column, return_inverse=True) for column in columns))
    shape = [len(axis) for axis in values]
    ratio = np.full(shape, np.nan)
    ratio[places] = table["ratio_max"].to_numpy(zero_copy_only=False)
    failed = np.zeros(shape, dtype=bool)
    failed[places] = np.array(table["status"].to_pylist()) != "ok"

    cut = (slice(None), slice(None)) + (0,) * (len(axes) - 2)
    told = provenance(file)
    units = told.get("sweep.columns", {})
    labels = [axis_label(name, units.get(name, {}).get("unit", "")) for name in axes]
    title = value_of(told, "name") or pathlib.Path(path).stem
    for label, axis in zip(labels[2:], values[2:]):
        title += f" · {label} = {axis[0]:g}"
    limit = float(value_of(told, "ratio_limit") or 2.0)
    return list(zip(labels, values))[:2], ratio[cut], failed[cut], limit, title


def axis_label(name, unit):
    """Name in words and unit: `damping_n_s_per_m` is "damping (N s/m)"."""
    suffix = "_" + unit.lower().replace("/", " per ").replace(" ", "_")
    words = name.removesuffix(suffix).replace("_", " ")
    return f"{words} ({unit})" if unit else words


def edges(values):
    """Borders of the cells around the values: halfway between neighbours."""
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middles = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middles[0]], middles, [2 * values[-1] - middles[-1]]])


def draw(path, output):
    """Write the picture."""
    ((x_label, xs), (y_label, ys)), ratio, failed, limit, title = read(path)
    offset = np.ma.masked_invalid(np.log(np.where(ratio > 0, ratio, np.nan) / limit)).T

    figure, plot = plt.subplots(figsize=(8.5, 6), layout="constrained")
    plot.set_facecolor("0.75")
    reach = [-1.0, 1.0]
    if offset.count():
        reach = [min(offset.min(), np.log(0.5)), max(offset.max(), np.log(2.0))]
    norm = TwoSlopeNorm(vmin=reach[0], vcenter=0.0, vmax=reach[1])
    mesh = plot.pcolormesh(edges(xs), edges(ys), offset, cmap="RdBu_r", norm=norm)
    handles = []
    if min(offset.shape) > 1:
        plot.contour(xs, ys, offset, levels=[0.0], colors="black", linewidths=2)
        handles.append(plt.Line2D([], [], color="black", lw=2, label=f"boundary: ratio {limit:g}"))
    if failed.any():
        left, bottom = edges(xs), edges(ys)
        hatched = dict(fc="0.75", ec="0.2", hatch="///", lw=0)
        cells = [
            Rectangle((left[i], bottom[j]), left[i + 1] - left[i], bottom[j + 1] - bottom[j])
            for i, j in np.argwhere(failed)
        ]
        plot.add_collection(PatchCollection(cells, **hatched))
        handles.append(Rectangle((0, 0), 1, 1, label=f"failed ({failed.sum()} points)", **hatched))
    handles += [
        Rectangle((0, 0), 1, 1, fc="#d6604d", label="linear model unreliable"),
        Rectangle((0, 0), 1, 1, fc="#4393c3", label="linear model reliable"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)

    marks = np.array([0.1, 0.2, 0.5, 1, 1.2, 1.5, 2, 3, 5, 10, 20, 50, 100, 1000])
    marks = marks[(np.log(marks / limit) >= reach[0]) & (np.log(marks / limit) <= reach[1])]
    label = "largest ratio, nonlinear / linear"
    bar = figure.colorbar(mesh, ax=plot, ticks=np.log(marks / limit), label=label)
    bar.ax.set_yticklabels([f"{mark:g}" for mark in marks])
    bar.ax.minorticks_off()
    plot.set(xlabel=x_label, ylabel=y_label, title=title)
    # Without the version and date that matplotlib would add, the same file gives the same picture.
    metadata = {"Software": None} if str(output).endswith(".png") else None
    figure.savefig(output, dpi=150, metadata=metadata)


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description="Draw a map's ratio over its first two axes, with its boundary."
    )
    parser.add_argument("file", help="result of `sweep run`")
    parser.add_argument("-o", "--output", help="image to write (default: FILE with .png)")
    arguments = parser.parse_args()
    draw(arguments.file, arguments.output or pathlib.Path(arguments.file).with_suffix(".png"))


if __name__ == "__main__":
    main()
