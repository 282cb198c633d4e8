"""What type checkers know by name."""

from __future__ import annotations

from typing import Any, Protocol, TypedDict


class ArrowStream(Protocol):
    """A table of polars, pyarrow, pandas, DuckDB, or any other that speaks Arrow's C stream."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...


class Diagnostic(TypedDict):
    """One mistake."""

    file: str | None
    """The file, or the name of the option, text or table."""
    line: int | None
    """From 1."""
    column: int | None
    """From 1."""
    message: str
    expected: str | None
    hint: str | None


class Parameter(TypedDict):
    """A number that can be set or swept."""

    name: str
    value: float | None
    unit: str
    description: str
    range: dict[str, Any]
    source: str
