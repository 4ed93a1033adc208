"""The two kinds of arithmetic as operations: sums that reach neurons (eq. 11), and expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.circuit.graph import Population
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.lowering.plan import Block, Group
from circuitkit.engine.operations import FloatArray, IndexArray, Map, Sum

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


def make_map(
    count: int,
    results: Sequence[tuple[int, Expression]],
    rows: Mapping[str, int],
    constants: Mapping[str, FloatArray] | None = None,
    picks: Mapping[str, IndexArray] | None = None,
) -> Map:
    """Make the operation that evaluates expressions side by side; see `Map` for the arguments."""
    folding = _Folding(constants or {})
    folded = tuple((row, folding.fold(expression)) for row, expression in results)
    used = frozenset[str]().union(*(expression.names() for _, expression in folded))
    return Map(
        count,
        folded,
        {name: row for name, row in rows.items() if name in used},
        {name: pick for name, pick in (picks or {}).items() if name in used},
        {name: value for name, value in folding.constants.items() if name in used},
    )


def copy_rows(count: int, source: int, target: int) -> Map:
    """Return the operation that copies rows."""
    return Map(count, ((target, Name("x")),), {"x": source})


class _Folding:
    """Replaces every part of expressions that consists of constants by a constant of its own."""

    def __init__(self, constants: Mapping[str, FloatArray]) -> None:
        self.constants = dict(constants)
        self._known: dict[Expression, Name] = {}

    def fold(self, expression: Expression) -> Expression:
        if not isinstance(expression, Name | Number) and self._is_constant(expression):
            return self._constant(expression)
        match expression:
            case Unary(operator=sign, operand=operand):
                return self._chosen((operand,), lambda part: Unary(sign, part))
            case Binary(operator=joint, left=left, right=right):
                return self._chosen((left, right), lambda *parts: Binary(joint, *parts))
            case Call(function=function, arguments=arguments):
                return self._chosen(arguments, lambda *parts: Call(function, parts))
        return expression

    def _chosen(self, parts: Sequence[Expression], join: Callable[..., Expression]) -> Expression:
        """Turn a function of a choice between constants into a choice between its values.

        So the factor of an exponential step is computed once, also for a neuron that has another one while
        it is refractory.
        """
        folded = [self.fold(part) for part in parts]
        varying = [k for k, part in enumerate(folded) if not self._is_constant(part)]
        match [folded[k] for k in varying]:
            case [Call(function="where", arguments=(condition, *values))] if all(
                map(self._is_constant, values)
            ):
                (k,) = varying
                choices = (self.fold(join(*folded[:k], value, *folded[k + 1 :])) for value in values)
                return Call("where", (condition, *choices))
        return join(*folded)

    def _is_constant(self, expression: Expression) -> bool:
        return expression.names() <= self.constants.keys()

    def _constant(self, expression: Expression) -> Name:
        if expression not in self._known:
            with np.errstate(all="ignore"):
                value = np.asarray(expression.evaluate(self.constants, NUMPY_FUNCTIONS), dtype=np.float64)
            name = Name(f"folded_{len(self._known)}")
            self._known[expression], self.constants[name.name] = name, value
        return self._known[expression]
