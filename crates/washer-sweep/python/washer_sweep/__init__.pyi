"""The public names, with their types. Lengths are in m, masses in kg, angles in rad, times in s."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from washer_sweep._errors import Interrupted, PlanError
from washer_sweep._explanation import Explanation
from washer_sweep._types import ArrowStream, Diagnostic, Parameter

__all__ = [
    "NUMERICS_VERSION",
    "ArrowStream",
    "Diagnostic",
    "Explanation",
    "Interrupted",
    "Parameter",
    "Plan",
    "PlanError",
    "Result",
    "__version__",
    "dwell",
    "explain",
    "fit",
    "modes",
    "optimise",
    "parameters",
    "read",
    "stability",
]

NUMERICS_VERSION: int
"""The version of the numerics. Builds with the same versions of package and numerics compute the
same bits."""
__version__: str
"""The version of the package."""

@final
class Plan:
    """A validated plan: a machine, a spin, a method of integration and axes."""

    def __new__(cls, grid: Mapping[str, Any], *, set: Mapping[str, float] | None = None) -> Plan:
        """Creates a plan from a mapping with the keys of a grid file. `set` overrides constants.

        Raises `PlanError` with all mistakes. Their lines and columns are those of the mapping as
        TOML, which the text shows.
        """

    @staticmethod
    def from_toml(
        source: str | PathLike[str], *, set: Mapping[str, float] | None = None
    ) -> Plan:
        """Reads a plan from a grid file, or from the text of one.

        A string with a line break or `=` is a text. `set` overrides constants by their names, in
        the unit with which each name ends, such as `unbalance_mass_kg`. Raises `PlanError` with all
        mistakes.
        """

    def evaluate(
        self,
        table: ArrowStream | Mapping[str, ArrayLike],
        *,
        threads: int | None = None,
        progress: bool = False,
    ) -> Result:
        """Evaluates both models at each row of a table. The result's rows are in the same order.

        The table has n rows and a column of n numbers for each axis of the plan, in the unit with
        which its name ends; an axis with a single value may be left out. The result has n rows, and
        `result.units` has the unit of each of its columns. `threads` is the number of threads, by
        default one for each core; `progress` shows the progress. Every value has to lie between the
        least and the greatest value of its axis, because the steps of the method are chosen for the
        ranges of the axes. A row of the result therefore depends on the plan and on its own values
        alone, and has the bits of a run with this point.

        Raises `PlanError` for columns and values that do not fit, before the computation, and
        `Interrupted` on Ctrl-C.
        """

    def run(
        self,
        out: str | PathLike[str] | None = None,
        *,
        threads: int | None = None,
        progress: bool = True,
        fresh: bool = False,
    ) -> Result:
        """Evaluates both models at every point of the grid.

        The result has a row for each point, in grid order: the first axis varies slowest. `threads`
        is the number of threads, by default one for each core.

        With `out` it also writes a Parquet file, byte for byte as `sweep run` does. An interrupted
        run keeps its rows beside the file, and the same call continues it; `fresh` starts over.
        """

    def trace(
        self,
        at: Mapping[str, float] | None = None,
        *,
        all: bool = False,
        model: str | None = None,
        every: float = 0.01,
        turns: bool = False,
        rates: bool = False,
        states: bool = False,
        forces: bool = False,
        angle: bool = False,
        start: Mapping[str, float] | None = None,
    ) -> Result:
        """Computes time histories of both models at one point, every `every` s, or with `turns`
        once a turn.

        The result has a row for each instant, with `time_s` in s, displacements in m and angles in
        rad. `at` gives a value to each axis, and to any other parameter, in the unit with which its
        name ends. With `all` it gives values to some axes only, and every point with these values
        has a history, in one table with the columns `point` and the axes. `model` restricts the
        table to the `nonlinear` or the `linear` model. `rates` adds rates and accelerations of the
        channels, `states` the ten coordinates and their speeds, `forces` the forces of springs,
        dampers, stops, bushings and feet, and `angle` the drum's angle. `start` gives the initial
        state: deviations q1 to q10 (m, rad) and speeds u1 to u10 (per s). If a model fails, a
        warning says so, and its values are null from then on.
        """

    def boundary(
        self,
        quantity: str = "ratio_max",
        *,
        limit: float | None = None,
        tolerance: float | None = None,
        lattice: int = 6,
        out: str | PathLike[str] | None = None,
        threads: int | None = None,
        progress: bool = True,
        fresh: bool = False,
    ) -> Result:
        """Traces the curve on which a quantity is at its limit, over the first two axes.

        `quantity` is a column of numbers of this plan's rows for which greater or lesser values are
        worse, or an expression of columns as in `sweep require`. `limit` is in the column's unit;
        by default it is the column's own. `tolerance` is the width of the final brackets, in the
        unit of the second axis. `lattice` is the number of cells along each axis that are searched
        first. The result has a row for each crossing, and one for each line without any. With `out`
        the search writes that file, and the same call continues it after an interruption.
        """

    @property
    def name(self) -> str: ...
    @property
    def axes(self) -> dict[str, tuple[float, float]]:
        """The axes in order, each with its least and greatest value."""

    def to_dict(self) -> dict[str, Any]:
        """Returns the plan with the keys of a grid file, with all defaults and constants."""

    def __len__(self) -> int:
        """Returns the number of points."""

@final
class Result:
    """A table of rows, which libraries with Arrow read without a copy: `polars.DataFrame(result)`,
    `pyarrow.table(result)`, `pandas.DataFrame.from_arrow(result)`.

    A notebook shows the figure of `sweep plot`. Units and descriptions are also in the metadata of
    each field.
    """

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def __arrow_c_schema__(self) -> object: ...
    def __getitem__(self, name: str, /) -> NDArray[Any]:
        """Returns a column as an array of shape `(len(result),)`: numbers in the unit that
        `result.units` gives, with nan for null, or objects with None.
        """

    def __contains__(self, name: str, /) -> bool: ...
    def __len__(self) -> int: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def units(self) -> dict[str, str]: ...
    @property
    def descriptions(self) -> dict[str, str]: ...
    @property
    def kind(
        self,
    ) -> Literal[
        "map", "boundary", "trace", "modes", "stability", "dwell", "fit", "study", "differences"
    ]: ...
    @property
    def plan(self) -> dict[str, Any]:
        """The plan of the result with the keys of a grid file; for differences, both results."""

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the result as `.parquet`, or a figure of it as `.svg`, `.pdf`, `.png` or `.html`.

        Parquet files have the bytes that the command writes. An existing file is overwritten only
        if it has the same kind.
        """

    def _repr_svg_(self) -> str | None: ...

def modes(
    plan: Plan | None = None,
    *,
    speeds_rpm: Sequence[float] | NDArray[np.float64] | None = None,
    at: Mapping[str, float] | None = None,
) -> Result:
    """Computes natural frequencies, damping and resonances over spin speeds, by default 0 to 1200
    rpm.

    `speeds_rpm` are m speeds in rpm; the result has a row for each speed and mode. The machine is
    the plan's, with the values in `at`, each in the unit with which its name ends; other axes are
    ignored. Without a plan it is the built-in machine.
    """

def optimise(
    study: str | PathLike[str],
    out: str | PathLike[str] | None = None,
    *,
    set: Mapping[str, float] | None = None,
    threads: int | None = None,
    progress: bool = True,
    fresh: bool = False,
) -> Result:
    """Searches for the candidates of a study file with the least objectives within its constraints.

    `set` overrides constants of the study's grid, in the unit with which each name ends. The result
    has a row for each candidate, in the order in which they were evaluated. With `out` it also
    writes a Parquet file, byte for byte as `sweep optimise` does, and the same call continues after
    an interruption.
    """

def stability(
    plan: Plan,
    speeds_rpm: Sequence[float] | NDArray[np.float64],
    out: str | PathLike[str] | None = None,
    *,
    threads: int | None = None,
    progress: bool = True,
    fresh: bool = False,
) -> Result:
    """Finds the periodic response of both models at each point of the plan's grid and each held
    speed, and the growth of disturbances about it.

    `speeds_rpm` are m speeds in rpm. The result has m rows for each point, or more where a speed
    has several responses, in the order of points, then of speeds. `threads` is the number of
    threads, by default one for each core.

    With `out` it also writes a Parquet file, byte for byte as `sweep stability` does, and the same
    call continues after an interruption.
    """

def dwell(
    plan: Plan,
    speeds_rpm: Sequence[float] | NDArray[np.float64],
    out: str | PathLike[str] | None = None,
    *,
    starts: int = 12,
    kick: float = 6.0,
    carry: Literal["up", "down"] | None = None,
    threshold: bool = False,
    longest: float = 600.0,
    sections: int = 0,
    threads: int | None = None,
    progress: bool = True,
    fresh: bool = False,
) -> Result:
    """Finds the attractors of each point of the plan's grid at each held speed, a row for each.

    `speeds_rpm` are m speeds in rpm. `starts` is the number of starts at a speed; some are kicks of
    up to `kick` rad/s. With `carry` the start is the motion at the next lower (`up`) or higher
    (`down`) speed. `threshold` searches for the smallest kick after which the motion does not
    return. `longest` is the greatest duration of a trajectory in s. `sections` adds that many
    states at successive turns, a row each. With `out` it also writes a Parquet file, byte for byte
    as `sweep dwell` does.
    """

def explain(
    plan: Plan,
    at: Mapping[str, float] | None = None,
    *,
    speeds_rpm: Sequence[float] | NDArray[np.float64] | None = None,
    threads: int | None = None,
) -> Explanation:
    """Explains why the linear model fails at one point: the unstable speeds that the run passes,
    the modes that grow there, and changes of the machine that make these speeds stable.

    `at` gives a value to each axis, and to any other parameter, in the unit with which its name
    ends. `speeds_rpm` are equally spaced speeds in rpm to examine; by default each rpm from half of
    the slowest mode's frequency to the greatest speed of the run.
    """

def fit(
    plan: Plan,
    table: ArrowStream | Mapping[str, ArrayLike] | list[ArrowStream | Mapping[str, ArrayLike]],
    free: Sequence[str],
    *,
    own: Sequence[str] = ...,
    at: Mapping[str, float] | list[Mapping[str, float]] | None = None,
    linear: bool = False,
    shift: bool = True,
    starts: int = 1,
    bootstrap: int = 0,
    known: Sequence[str] = ...,
    draws: int = 64,
    threads: int | None = None,
) -> Explanation:
    """Fits numbers of the plan's machine to one or several measured run-ups.

    A table has n rows, one for each instant: the column `time_s`, optionally `speed_rpm`, and
    channels with their units, such as `tub_front_y_m_per_s2`, with NaN where there is no sample.
    `free` are the names of the numbers to fit, or `name=from:to`; `own` are further ones that have
    a value for each table. `at` has the constants of each table. `known` are tolerances of fixed
    numbers, such as `tub_mass_kg=2%`; all others have those of their kind, or with `none` are
    exact. `draws` is the number of rows for the probability of the verdict, `bootstrap` the number
    of repeated fits. The keys of the result are those of `sweep fit --json`.
    """

def parameters(plan: Plan | None = None) -> list[Parameter]:
    """Lists all numbers that can be set or swept, with their values in the plan or the built-in
    machine.
    """

def read(path: str | PathLike[str]) -> Result:
    """Reads a result file of any kind, and checks its digest."""
