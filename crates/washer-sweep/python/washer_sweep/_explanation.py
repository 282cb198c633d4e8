"""What `explain` returns."""


class Explanation(dict):
    """What was found at a point: the keys of `sweep explain --json`.

    As text, and in a notebook, it is what `sweep explain` prints.
    """

    def __init__(self, found, text):
        super().__init__(found)
        self.text = text

    def __reduce__(self):
        return type(self), (dict(self), self.text)

    def __str__(self):
        return self.text

    def _repr_pretty_(self, printer, cycle):
        printer.text(self.text)
