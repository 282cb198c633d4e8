"""The exceptions of the package. They are classes in Python, because an extension cannot derive a
class with fields from an exception by the stable C API of Python 3.11."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from washer_sweep import Diagnostic, Result


class PlanError(ValueError):
    """The input is not a valid plan, or does not fit the plan. Nothing was computed.

    The text shows each mistake with its place, as the command does. `diagnostics` has a dictionary
    for each mistake: `file`, `line`, `column`, `message`, `expected` and `hint`, which may be None.
    """

    diagnostics: list[Diagnostic]

    def __init__(self, text: str, diagnostics: list[Diagnostic]) -> None:
        super().__init__(text)
        self.diagnostics = diagnostics

    def __reduce__(self) -> tuple[type[PlanError], tuple[str, list[Diagnostic]]]:
        return type(self), (self.args[0], self.diagnostics)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped the computation.

    `result` has the rows up to then, or is None if they are in a file.
    """

    result: Result | None

    def __init__(self, text: str, result: Result | None) -> None:
        super().__init__(text)
        self.result = result
