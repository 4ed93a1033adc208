"""`StateNames`: what the states are called, formatted when somebody asks."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, overload

import numpy as np

from circuitkit.engine.operations import IndexArray, PointerArray


class Naming(Protocol):
    """Says what number i of some neurons or synapses is called."""

    def __call__(self, i: int, /) -> str:
        """Return the name."""


@dataclass(frozen=True)
class Listed:
    """Names that stand in a list."""

    names: tuple[str, ...]

    def __call__(self, i: int, /) -> str:
        """Return the name."""
        return self.names[i]


@dataclass(frozen=True)
class Members:
    """Members of a population, or the targets of a projection."""

    name: str

    def __call__(self, i: int, /) -> str:
        """Return the name."""
        return f"{self.name}[{i}]"


@dataclass(frozen=True, eq=False)
class Connections:
    """Synapses of a projection."""

    source: str
    target: str
    indptr: PointerArray
    sources: IndexArray

    def __call__(self, i: int, /) -> str:
        """Return the name."""
        target = int(np.searchsorted(self.indptr, i, side="right")) - 1
        return f"{self.source}[{self.sources[i]}] -> {self.target}[{target}]"


class StateNames(Sequence[str]):
    """Names of states in the order in which their rows are added: `q1.v`, `ring[3].v`, `a -> b.x`."""

    def __init__(self) -> None:
        self._parts: list[tuple[Naming, str]] = []
        self._stops: list[int] = []
        self._rows: list[IndexArray] = []

    def add(self, row: int, count: int, naming: Naming, state: str) -> None:
        """Add the neighbouring rows of a state of some neurons or synapses."""
        if count:
            self._rows.append(np.arange(row, row + count, dtype=np.int32))
            self._parts.append((naming, state))
            self._stops.append(len(self) + count)

    def rows(self) -> IndexArray:
        """Return all rows that have been added, shape (n_states,)."""
        return np.concatenate([np.empty(0, np.int32), *self._rows])

    def __len__(self) -> int:
        return self._stops[-1] if self._stops else 0

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        place = range(len(self))[index]
        part = bisect_right(self._stops, place)
        naming, state = self._parts[part]
        return f"{naming(place - (self._stops[part - 1] if part else 0))}.{state}"
