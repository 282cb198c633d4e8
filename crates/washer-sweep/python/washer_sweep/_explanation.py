"""The class of the results of `explain` and `fit`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Explanation(dict[str, Any]):
    """The result of `explain` or `fit`, with the keys of the command's `--json`.

    Its text, which a notebook shows, is that of the command.
    """

    text: str

    def __init__(self, data: Mapping[str, Any], text: str) -> None:
        super().__init__(data)
        self.text = text

    def __reduce__(self) -> tuple[type[Explanation], tuple[dict[str, Any], str]]:
        return type(self), (dict(self), self.text)

    def __str__(self) -> str:
        return self.text

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(self.text)
