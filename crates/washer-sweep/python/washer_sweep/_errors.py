"""Exceptions. They are Python's own classes, because the stable C API of Python 3.11 lets no
extension derive from one with fields."""


class PlanError(ValueError):
    """What was given makes no plan, or does not fit one. Nothing was done.

    The text shows each mistake at its place, as the command does. `diagnostics` has a dictionary
    for each: `file`, `line`, `column`, `message`, `expected` and `hint`, None where there is none.
    """

    def __init__(self, text, diagnostics):
        super().__init__(text)
        self.diagnostics = diagnostics

    def __reduce__(self):
        return type(self), (self.args[0], self.diagnostics)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended the work.

    `result` has the rows that were computed, each whole, or is None where a file keeps them.
    """

    def __init__(self, text, result):
        super().__init__(text)
        self.result = result
