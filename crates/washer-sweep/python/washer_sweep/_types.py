"""Types for annotations."""

from __future__ import annotations

from typing import Any, Protocol, TypedDict


class ArrowStream(Protocol):
    """A table with Arrow's C stream, such as those of polars, pyarrow, pandas and DuckDB."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...


class Diagnostic(TypedDict):
    """A mistake in an input."""

    file: str | None
    """The file, or the name of the option, text or table."""
    line: int | None
    """The line, from 1."""
    column: int | None
    """The column, from 1."""
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
