"""What reaches a neuron (eq. 11): a `Sum` for single synapses into neighbouring rows, one for each matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.graph import Population
from circuitkit.engine.lowering.cells import Block, Group
from circuitkit.engine.operations import Sum

Moved = Callable[[npt.NDArray[np.int32]], npt.NDArray[np.int32]]


class Term(NamedTuple):
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


@dataclass(frozen=True, eq=False)
class Matrix:
    """The terms of the sums of a whole block, as a sparse matrix by rows of targets.

    Attributes:
        target: The block.
        indptr: As in `Sum`.
        sources: As in `Sum`, less `base`.
        weights: As in `Sum`.
        base: Row to which the sources are counted.
    """

    target: Block
    indptr: npt.NDArray[np.int64]
    sources: npt.NDArray[np.int32]
    weights: npt.NDArray[np.float64]
    base: int


class Arrivals:
    """All that is added up to activations: terms of single synapses by rank, then matrices in their order."""

    def __init__(self, terms: Sequence[Term], matrices: Sequence[Matrix]) -> None:
        targets = np.array([term.target for term in terms], dtype=np.int64)
        ranks = np.array([term.rank for term in terms], dtype=np.int64)
        order = np.lexsort((ranks, targets))
        self._targets = targets[order]
        self._sources = np.array([term.source for term in terms], dtype=np.int32)[order]
        self._weights = np.array([term.weight for term in terms], dtype=np.float64)[order]
        self._matrices = tuple(matrices)

    def sums(
        self, groups: Sequence[Group], shift: int = 0, moved: Moved = lambda rows: rows
    ) -> Iterator[Sum]:
        """Yield the operations that give the activations of groups their values.

        Args:
            groups: Which; neighbours in rows.
            shift: What is added to the row of an activation to get the row that is written.
            moved: Says which rows are read instead of the usual ones.
        """
        for start, stop in _ranges(groups):
            begin, end = np.searchsorted(self._targets, (start, stop)).tolist()
            matrices = [m for m in self._matrices if start <= m.target.activation < stop]
            begins_with_matrix = begin == end and bool(matrices) and matrices[0].target.size == stop - start
            if not begins_with_matrix:
                indptr = np.searchsorted(self._targets, np.arange(start, stop + 1)) - begin
                sources = moved(self._sources[begin:end])
                yield _frozen_sum(start + shift, indptr, sources, self._weights[begin:end])
            for i, matrix in enumerate(matrices):
                row, base = matrix.target.activation + shift, int(moved(np.array([matrix.base]))[0])
                add = i > 0 or not begins_with_matrix
                yield _frozen_sum(row, matrix.indptr, matrix.sources, matrix.weights, add=add, base=base)


def matrix_sum(matrix: Matrix, start: int) -> Sum:
    """Return the operation that multiplies by a matrix and writes from a row on."""
    return _frozen_sum(start, matrix.indptr, matrix.sources, matrix.weights, base=matrix.base)


def list_sum(start: int, lengths: Sequence[int], sources: npt.ArrayLike, weights: npt.ArrayLike) -> Sum:
    """Return the sums of so many terms each."""
    indptr = np.concatenate([[0], np.cumsum(lengths)])
    rows, values = np.asarray(sources, dtype=np.int32), np.asarray(weights, dtype=np.float64)
    return _frozen_sum(start, indptr, rows, values)


def _frozen_sum(
    start: int,
    indptr: npt.NDArray[np.int64],
    sources: npt.NDArray[np.int32],
    weights: npt.NDArray[np.float64],
    *,
    add: bool = False,
    base: int = 0,
) -> Sum:
    pointers, rows, values = indptr.astype(np.int64, copy=False).view(), sources.view(), weights.view()
    for view in (pointers, rows, values):
        view.flags.writeable = False
    return Sum(start, start + len(indptr) - 1, pointers, rows, values, add, base)


def _ranges(groups: Sequence[Group]) -> Iterator[tuple[int, int]]:
    """Yield rows (start, stop) that are summed together: of single neurons, or of a population."""
    start = stop = -1
    for group in groups:
        for block in group.blocks:
            end = block.activation + block.size
            if isinstance(block.node, Population):
                if start >= 0:
                    yield start, stop
                yield block.activation, end
                start = -1
            else:
                start, stop = (start if start >= 0 else block.activation), end
    if start >= 0:
        yield start, stop
