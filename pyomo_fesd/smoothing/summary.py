"""A summary of the transformation, for users."""

from collections import Counter, defaultdict

from pyomo_fesd.smoothing.sources import plain_name


class Summary:
    """Counts by the names of components without indices; prints as text.

    Attributes
    ----------
    changed : Counter
        constraints, objectives, conditions and named Expressions that were changed
    replaced : int
        absolute values in them
    pairs : int
        complementarity pairs added: one for each different z of a source, none where bounds decide the sign
    left : dict of Counter
        absolute values that were left alone, by reason
    """

    def __init__(self):
        self.changed, self.replaced, self.pairs = Counter(), 0, 0
        self.left = defaultdict(Counter)

    def note_changed(self, source, replaced: int, pairs: int) -> None:
        """Count one source."""
        self.changed[plain_name(source)] += 1
        self.replaced += replaced
        self.pairs += pairs

    def note_left(self, source, reason: str) -> None:
        """Count one absolute value that is left alone."""
        self.left[reason][plain_name(source)] += 1

    def __repr__(self):
        lines = [f"{self.replaced} absolute values replaced, {self.pairs} pairs"]
        lines += [f"    {name}: {n} changed" for name, n in self.changed.items()]
        for reason, names in self.left.items():
            lines += [f"left alone: {reason}", *(f"    {name}: {n}" for name, n in names.items())]
        return '\n'.join(lines)

    __str__ = __repr__
