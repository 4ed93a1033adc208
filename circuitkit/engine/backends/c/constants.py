"""The numbers that generated C refers to: data, so that other weights do not need another compilation."""

from __future__ import annotations

import numpy as np

from circuitkit.engine.state import FloatArray

_PADDING = 8  # as many numbers as are ever loaded at once


class Constants:
    """Collects arrays in two blocks: numbers that all members share, and rows with one for each member."""

    def __init__(self) -> None:
        self._shared: list[FloatArray] = []
        self._own: list[FloatArray] = []
        self._n_shared = 0
        self._n_own = 0
        self._known: dict[int, tuple[FloatArray, int]] = {}

    def share(self, values: FloatArray) -> int:
        """Return place of the first number of an array of shape (), (n,) or (n, 1)."""
        if (known := self._known.get(id(values))) is not None:
            return known[1]
        self._known[id(values)] = values, self._n_shared  # held, so that the identity stays taken
        flat = values.ravel()
        # What loads several at once may read beyond the end.
        padded = np.concatenate([flat, np.repeat(flat[-1:], _PADDING)]) if values.ndim else flat
        self._shared.append(padded)
        self._n_shared += len(padded)
        return self._n_shared - len(padded)

    def own(self, values: FloatArray) -> int:
        """Return place of the first row of an array of shape (n, B)."""
        if (known := self._known.get(id(values))) is not None:
            return known[1]
        self._known[id(values)] = values, self._n_own
        self._own.append(values)
        self._n_own += len(values)
        return self._n_own - len(values)

    def shared_numbers(self) -> FloatArray:
        """Return all shared numbers, one after the other."""
        return np.concatenate([*self._shared, np.zeros(1)])

    def own_rows(self, batch: int) -> FloatArray:
        """Return all rows with a number for each member, shape (n, B)."""
        return np.concatenate([*self._own, np.zeros((0, batch))])
