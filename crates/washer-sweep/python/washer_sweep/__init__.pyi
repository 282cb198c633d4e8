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
"""Builds of one version and this number compute the same bits."""
__version__: str

@final
class Plan:
    """A validated plan: a machine, a spin, a method, axes."""

    def __new__(cls, grid: Mapping[str, Any], *, set: Mapping[str, float] | None = None) -> Plan:
        """A plan with the keys of a grid file. `set` overrides constants.

        Raises `PlanError` with every mistake. Lines and columns are those of the dictionary as
        TOML, which the text shows.
        """

    @staticmethod
    def from_toml(
        source: str | PathLike[str], *, set: Mapping[str, float] | None = None
    ) -> Plan:
        """A plan from a grid file, or from the text of one. `set` overrides constants.

        A string with a line break or `=` is a text. Raises `PlanError` with every mistake.
        """

    def evaluate(
        self,
        table: ArrowStream | Mapping[str, ArrayLike],
        *,
        threads: int | None = None,
        progress: bool = False,
    ) -> Result:
        """Both models at each row of a table: rows of designs in, rows of results out, in order.

        The columns are the plan's axes; one of a single value may be left out. Every value lies on
        its axis, from the least to the greatest: the plan's axes are the space of designs, for
        which the method's steps are chosen. So a row depends on the plan and its own values alone,
        and has the bits of a run with this point.

        Raises `PlanError` for columns and values that do not fit, before any work, and
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
        """The map: both models at every point of the grid.

        With `out` it writes that Parquet file, byte for byte as `sweep run` does. An interrupted
        run keeps what is done, and the same call goes on; `fresh` starts over.
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
        """Time histories of both models at one point, every `every` s, or by `turns` once a turn.

        `at` gives a value to each axis, and to any other parameter. `all` traces every point that
        it leaves, in one table with columns `point` and the axes. `model` names the one to
        integrate, `nonlinear` or `linear`. `rates` adds rates and accelerations of the channels,
        `states` the ten coordinates and their speeds, `forces` those of springs, dampers, stops
        and bushings, and what the feet carry, `angle` the drum's. `start` begins away from
        equilibrium: q1 to q10 (m, rad), u1 to u10 (per s). Warns of a model that
        failed; its values are null from there on.
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
        """The curve on which a quantity is at its limit, over the first two axes.

        `quantity` is any column of numbers that rows of this plan can have and that is bad one way,
        `limit` a number in its unit; without one, the column's own.
        `tolerance` is the width of the final brackets. With `out` the search writes that file and
        goes on there after an interruption.
        """

    @property
    def name(self) -> str: ...
    @property
    def axes(self) -> dict[str, tuple[float, float]]:
        """The axes in order, each with its least and greatest value."""

    def to_dict(self) -> dict[str, Any]:
        """Every default and constant in place, with the keys of a grid file."""

    def __len__(self) -> int:
        """How many points."""

@final
class Result:
    """Rows of a result, which any library that speaks Arrow takes without a copy:
    `polars.DataFrame(result)`, `pyarrow.table(result)`, `pandas.DataFrame.from_arrow(result)`.

    A notebook shows the program's own figure of it. Units and descriptions are in each field's
    metadata as well.
    """

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def __arrow_c_schema__(self) -> object: ...
    def __getitem__(self, name: str, /) -> NDArray[Any]:
        """A column as an array of NumPy's: numbers with nan for null, else objects with None."""

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
        """The plan that it came of, as its file carries it; of differences, what was compared."""

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the file as `.parquet`, or a figure as `.svg`, `.png` or `.html`.

        Parquet files have the bytes that the command writes. Nothing but a file of the same kind
        is written over.
        """

    def _repr_svg_(self) -> str | None: ...

def modes(
    plan: Plan | None = None,
    *,
    speeds_rpm: Sequence[float] | NDArray[np.float64] | None = None,
    at: Mapping[str, float] | None = None,
) -> Result:
    """Natural frequencies, damping and resonances over spin speeds, by default 0 to 1200 rpm.

    Of the plan's machine, axes left aside unless `at` gives them values; without a plan, of the
    built-in machine.
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
    """The candidates of a study file: what is least over its parameters, within its conditions.

    `set` gives constants over those of its grid. With `out` it writes that Parquet file, byte for
    byte as `sweep optimise` does, and goes on there after an interruption.
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
    """The periodic response of both models at each point of the plan's grid and each constant
    speed, and how fast disturbances of it grow. Speeds vary fastest.

    With `out` it writes that Parquet file, byte for byte as `sweep stability` does, and goes on
    there after an interruption.
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
    """What each point of the plan's grid ends in that is held at each constant speed: a row for
    each motion that is found.

    `starts` a speed, kicks of up to `kick` rad/s among them, or with `carry` the motion of the
    speed before; `threshold` asks for the smallest kick that does not come back; `longest` seconds
    at most; `sections` keeps so many states once a turn, a row each. With `out` it writes that
    Parquet file, byte for byte as `sweep dwell` does.
    """

def explain(
    plan: Plan,
    at: Mapping[str, float] | None = None,
    *,
    speeds_rpm: Sequence[float] | NDArray[np.float64] | None = None,
    threads: int | None = None,
) -> Explanation:
    """Why the linear model fails at one point: the unstable speeds that the run passes, what grows
    there, and what would close them.

    `at` gives a value to each axis, and to any other parameter. `speeds_rpm` are even speeds to
    look at; by default each rpm from half of the slowest mode's frequency to the fastest speed of
    the run.
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
    """The numbers of the plan's machine that make it follow a measured run-up, or several.

    A table has `time_s`, perhaps `speed_rpm`, and channels with their units, such as
    `tub_front_y_m_per_s2`; NaN where no sample is. `free` are names, or `name=from:to`; every table
    has its `own`, and its constants in `at`. `known` are tolerances of fixed numbers, such as
    `tub_mass_kg=2%`, `default` or `none`. The keys are those of `sweep fit --json`.
    """

def parameters(plan: Plan | None = None) -> list[Parameter]:
    """Every number that can be set or swept, with its value in the plan or the built-in machine."""

def read(path: str | PathLike[str]) -> Result:
    """Reads a result file of any kind, and makes sure of every byte."""
