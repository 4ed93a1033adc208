"""`Table`: hands out the rows of the table on which operations work."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from circuitkit.engine.state import FloatArray


class Table:
    """Rows in the order in which they are asked for; row 0 is zero.

    Attributes:
        n_rows: How many there are so far.
    """

    def __init__(self) -> None:
        self.n_rows = 1
        self._initial: list[tuple[int, int, npt.ArrayLike]] = []

    def take(self, count: int, initial: npt.ArrayLike = 0.0) -> int:
        """Return the first of `count` new rows, which begin with these values."""
        start = self.n_rows
        self.n_rows += count
        self.begin_with(start, count, initial)
        return start

    def begin_with(self, start: int, count: int, initial: npt.ArrayLike) -> None:
        """Let rows begin with these values."""
        if np.any(initial):
            self._initial.append((start, count, initial))

    def initial(self) -> FloatArray:
        """Return the value of every row at the start, shape (n_rows,), [SI]."""
        values = np.zeros(self.n_rows)
        for start, count, initial in self._initial:
            values[start : start + count] = initial
        return values
