"""What `explain` and `fit` return."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Explanation(dict[str, Any]):
    """What was found: the keys of `sweep explain --json`, or of `sweep fit --json`.

    As text, and in a notebook, it is what the command prints.
    """

    text: str

    def __init__(self, found: Mapping[str, Any], text: str) -> None:
        super().__init__(found)
        self.text = text

    def __reduce__(self) -> tuple[type[Explanation], tuple[dict[str, Any], str]]:
        return type(self), (dict(self), self.text)

    def __str__(self) -> str:
        return self.text

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(self.text)
