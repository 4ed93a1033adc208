"""What reaches a neuron (eq. 11): one `Sum` for single synapses into neighbouring rows, one for each projection."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.graph import Population
from circuitkit.engine.lowering.cells import Group
from circuitkit.engine.operations import Sum


@dataclass(frozen=True)
class Term:
    """One term of a sum.

    Attributes:
        target: Row of the sum.
        rank: What decides about the order of a sum's terms.
        source: Row that is read.
        weight: What it is multiplied by, [SI].
    """

    target: int
    rank: int
    source: int
    weight: float


class Terms:
    """The terms of many sums, sorted by the row of the sum and then by rank."""

    def __init__(self, terms: Sequence[Term]) -> None:
        targets = np.array([term.target for term in terms], dtype=np.int64)
        ranks = np.array([term.rank for term in terms], dtype=np.int64)
        order = np.lexsort((ranks, targets))
        self._targets = targets[order]
        self._sources = np.array([term.source for term in terms], dtype=np.int32)[order]
        self._weights = np.array([term.weight for term in terms], dtype=np.float64)[order]

    def sum_of(self, start: int, stop: int) -> Sum:
        """The sums of these rows; zero for one that has no terms."""
        indptr = np.searchsorted(self._targets, np.arange(start, stop + 1)).astype(np.int64)
        part = slice(int(indptr[0]), int(indptr[-1]))
        return frozen_sum(start, indptr - indptr[0], self._sources[part], self._weights[part])

    def has_any(self, start: int, stop: int) -> bool:
        """Whether one of these rows has a term."""
        begin, end = np.searchsorted(self._targets, (start, stop))
        return bool(begin < end)


def frozen_sum(
    start: int,
    indptr: npt.NDArray[np.int64],
    sources: npt.NDArray[np.int32],
    weights: npt.NDArray[np.float64],
    *,
    add: bool = False,
    base: int = 0,
) -> Sum:
    """A `Sum` of read-only views of these arrays."""
    views = [array.view() for array in (indptr, sources, weights)]
    for view in views:
        view.flags.writeable = False
    return Sum(start, start + len(indptr) - 1, *views, add=add, base=base)


def ranges(groups: Sequence[Group]) -> Iterator[tuple[int, int, str]]:
    """Neighbouring activation rows (start, stop) that are summed together: single neurons, or a population.

    The third is the population's name, empty for single neurons.
    """
    start = stop = -1
    for group in groups:
        for block in group.blocks:
            end = block.activation + block.size
            if isinstance(block.node, Population):
                if start >= 0:
                    yield start, stop, ""
                yield block.activation, end, block.node.name
                start = -1
            else:
                start, stop = (start if start >= 0 else block.activation), end
    if start >= 0:
        yield start, stop, ""
