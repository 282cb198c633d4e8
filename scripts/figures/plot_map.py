"""Draws the ratio of a map over its first two axes, with the line at which the ratio has its limit.

    python scripts/figures/plot_map.py FILE [-o OUT.png]

Reads only the Parquet file: everything that is drawn is in its columns and metadata. Further axes
have their first value, which is in the title.
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


def find_value(node, key):
    """Returns the first value of a key in nested JSON, outer levels first; None without the key."""
    if isinstance(node, dict):
        if key in node:
            return node[key]
        node = list(node.values())
    if isinstance(node, list):
        for inner in node:
            value = find_value(inner, key)
            if value is not None:
                return value
    return None


def read_metadata(file):
    """Returns the key-value metadata of a file, with JSON values parsed."""
    entries = {}
    for key, value in (file.schema_arrow.metadata or {}).items():
        try:
            entries[key.decode()] = json.loads(value)
        except ValueError:
            entries[key.decode()] = value.decode(errors="replace")
    return entries


def read(path):
    """Reads a map file. Returns the axes as pairs of label and values, the ratio and the failures
    on their grid, the limit, and the title."""
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
    values, indices = zip(*(np.unique(column, return_inverse=True) for column in columns))
    shape = [len(axis) for axis in values]
    ratio = np.full(shape, np.nan)
    ratio[indices] = table["ratio_max"].to_numpy(zero_copy_only=False)
    failed = np.zeros(shape, dtype=bool)
    failed[indices] = np.array(table["status"].to_pylist()) != "ok"

    first_cut = (slice(None), slice(None)) + (0,) * (len(axes) - 2)
    metadata = read_metadata(file)
    units = metadata.get("sweep.columns", {})
    labels = [axis_label(name, units.get(name, {}).get("unit", "")) for name in axes]
    title = find_value(metadata, "name") or pathlib.Path(path).stem
    for label, axis in zip(labels[2:], values[2:]):
        title += f" · {label} = {axis[0]:g}"
    limit = float(find_value(metadata, "ratio_limit") or 2.0)
    return list(zip(labels, values))[:2], ratio[first_cut], failed[first_cut], limit, title


def axis_label(name, unit):
    """Returns an axis' name in words and its unit: "damping (N s/m)" for `damping_n_s_per_m`."""
    suffix = "_" + unit.lower().replace("/", " per ").replace(" ", "_")
    words = name.removesuffix(suffix).replace("_", " ")
    return f"{words} ({unit})" if unit else words


def cell_borders(values):
    """Returns the borders of the cells around values, halfway between neighbours."""
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middles = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middles[0]], middles, [2 * values[-1] - middles[-1]]])


def draw(path, output):
    """Draws a map file and writes the picture."""
    ((x_label, xs), (y_label, ys)), ratio, failed, limit, title = read(path)
    log_ratio = np.ma.masked_invalid(np.log(np.where(ratio > 0, ratio, np.nan) / limit)).T

    figure, plot = plt.subplots(figsize=(8.5, 6), layout="constrained")
    plot.set_facecolor("0.75")
    log_range = [-1.0, 1.0]
    if log_ratio.count():
        log_range = [min(log_ratio.min(), np.log(0.5)), max(log_ratio.max(), np.log(2.0))]
    norm = TwoSlopeNorm(vmin=log_range[0], vcenter=0.0, vmax=log_range[1])
    mesh = plot.pcolormesh(cell_borders(xs), cell_borders(ys), log_ratio, cmap="RdBu_r", norm=norm)
    handles = []
    if min(log_ratio.shape) > 1:
        plot.contour(xs, ys, log_ratio, levels=[0.0], colors="black", linewidths=2)
        handles.append(plt.Line2D([], [], color="black", lw=2, label=f"boundary: ratio {limit:g}"))
    if failed.any():
        x_borders, y_borders = cell_borders(xs), cell_borders(ys)
        failed_style = dict(fc="0.75", ec="0.2", hatch="///", lw=0)
        cells = [
            Rectangle(
                (x_borders[i], y_borders[j]),
                x_borders[i + 1] - x_borders[i],
                y_borders[j + 1] - y_borders[j],
            )
            for i, j in np.argwhere(failed)
        ]
        plot.add_collection(PatchCollection(cells, **failed_style))
        label = f"failed ({failed.sum()} points)"
        handles.append(Rectangle((0, 0), 1, 1, label=label, **failed_style))
    handles += [
        Rectangle((0, 0), 1, 1, fc="#d6604d", label="linear model unreliable"),
        Rectangle((0, 0), 1, 1, fc="#4393c3", label="linear model reliable"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)

    marks = np.array([0.1, 0.2, 0.5, 1, 1.2, 1.5, 2, 3, 5, 10, 20, 50, 100, 1000])
    log_marks = np.log(marks / limit)
    marks = marks[(log_marks >= log_range[0]) & (log_marks <= log_range[1])]
    label = "largest ratio, nonlinear / linear"
    bar = figure.colorbar(mesh, ax=plot, ticks=np.log(marks / limit), label=label)
    bar.ax.set_yticklabels([f"{mark:g}" for mark in marks])
    bar.ax.minorticks_off()
    plot.set(xlabel=x_label, ylabel=y_label, title=title)
    # Removes the version that matplotlib would add, so that equal files give equal pictures.
    metadata = {"Software": None} if str(output).endswith(".png") else None
    figure.savefig(output, dpi=150, metadata=metadata)


def main():
    """Reads the command line and draws the map."""
    parser = argparse.ArgumentParser(
        description="Draw a map's ratio over its first two axes, with its boundary."
    )
    parser.add_argument("file", help="result of `sweep run`")
    parser.add_argument("-o", "--output", help="image to write (default: FILE with .png)")
    arguments = parser.parse_args()
    draw(arguments.file, arguments.output or pathlib.Path(arguments.file).with_suffix(".png"))


if __name__ == "__main__":
    main()
