"""Exceptions. They are Python's own classes, because the stable C API of Python 3.11 lets no
extension derive from one with fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from washer_sweep import Diagnostic, Result


class PlanError(ValueError):
    """What was given makes no plan, or does not fit one. Nothing was done.

    The text shows each mistake at its place, as the command does. `diagnostics` has a dictionary
    for each: `file`, `line`, `column`, `message`, `expected` and `hint`, None where there is none.
    """

    diagnostics: list[Diagnostic]

    def __init__(self, text: str, diagnostics: list[Diagnostic]) -> None:
        super().__init__(text)
        self.diagnostics = diagnostics

    def __reduce__(self) -> tuple[type[PlanError], tuple[str, list[Diagnostic]]]:
        return type(self), (self.args[0], self.diagnostics)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended the work.

    `result` has the rows that were computed, each whole, or is None where a file keeps them.
    """

    result: Result | None

    def __init__(self, text: str, result: Result | None) -> None:
        super().__init__(text)
        self.result = result
