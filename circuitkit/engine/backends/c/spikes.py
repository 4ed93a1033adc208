"""Which sums have sources that are mostly zero, as spikes are, and their matrices column by column.

A sum over all terms reads every synapse; by columns only those of the sources that are not zero are read,
which in a network of spiking neurons are few in every substep. See `active.h`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.engine.operations import FloatArray, IndexArray, Map, Noise, PointerArray, Recall, Sum
from circuitkit.engine.program import Program

# Terms from which a copy of the matrix is worth its memory, and how many of them a source must have on
# average: finding the active sources costs about as much as a term for each source.
_MANY_TERMS = 10_000
_TERMS_OF_A_SOURCE = 4

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Columns:
    """A matrix of a sum column by column.

    Attributes:
        begins: Where the terms of every source begin, shape (n_sources + 1,).
        targets: The sums to which they are added, ascending for every source, shape (n_terms,).
        weights: Their weights, shape (n_terms,), or () as in the sum.
    """

    begins: PointerArray
    targets: IndexArray
    weights: FloatArray


_KNOWN: WeakKeyDictionary[Sum, Columns] = WeakKeyDictionary()


def columns(operation: Sum) -> Columns:
    """Return the matrix of a sum column by column; made once and kept as long as the sum."""
    if operation not in _KNOWN:
        _KNOWN[operation] = _columns(operation)
    return _KNOWN[operation]


def _columns(operation: Sum) -> Columns:
    from scipy.sparse import csr_array  # 0.1 s, which only large circuits need

    weights, shape = operation.weights, (operation.stop - operation.start, n_sources(operation))
    values = weights if weights.ndim else np.zeros(len(operation.sources), np.int8)
    # Pointers as narrow as the sources, if they can be: otherwise scipy makes wide ones of both.
    is_narrow = len(operation.sources) <= np.iinfo(np.int32).max
    pointers = operation.indptr.astype(np.int32 if is_narrow else np.int64, copy=False)
    matrix = csr_array((values, operation.sources, pointers), shape=shape).tocsc()
    targets = matrix.indices.astype(np.int32, copy=False)
    return Columns(matrix.indptr.astype(np.int64), targets, matrix.data if weights.ndim else weights)


def n_sources(operation: Sum) -> int:
    """Return the number of rows among which its sources are."""
    return int(operation.sources.max()) + 1


def sums_of_spikes(program: Program) -> set[Sum]:
    """Return the sums that are worth being done by columns, of a program for one circuit."""
    large = [each for each in program.operations if isinstance(each, Sum) and _is_large(each)]
    if not large:
        return set()
    zeros = _mostly_zero(program)
    return {
        each for each in large if zeros[each.base : each.base + n_sources(each)].all() and _is_in_order(each)
    }


def _is_large(operation: Sum) -> bool:
    n_terms = len(operation.sources)
    return (
        n_terms >= _MANY_TERMS
        and operation.weights.ndim < 2  # noqa: PLR2004  # no sweep
        and n_terms >= _TERMS_OF_A_SOURCE * n_sources(operation)
        and bool(np.isfinite(operation.weights).all())  # an infinite one times zero is not zero
    )


def _is_in_order(operation: Sum) -> bool:
    """Check whether the terms of every sum come in the order of their sources."""
    ascends = np.diff(operation.sources) >= 0
    first = operation.indptr[1:-1]  # of the sums behind the first one
    ascends[first[(first > 0) & (first < len(operation.sources))] - 1] = True
    return bool(ascends.all())


def _mostly_zero(program: Program) -> BoolArray:
    """Return rows that only get what a comparison lets through, or the past of such rows, shape (n_rows,).

    They are found by ruling out: a row that counts spikes adds them to itself, so it is one of them if
    nothing else speaks against it.
    """
    zeros = np.zeros(program.n_rows, dtype=np.bool_)
    for start, stop, _ in _written(program, np.ones_like(zeros)):
        zeros[start:stop] = True
    zeros[0] = True
    n_before = -1
    while n_before != np.count_nonzero(zeros):
        n_before = int(np.count_nonzero(zeros))
        for start, stop, are_zero in _written(program, zeros):
            zeros[start:stop] &= are_zero
    return zeros


def _written(program: Program, zeros: BoolArray) -> Iterator[tuple[int, int, BoolArray]]:
    """Give the first row and the one after the last of all that is written, and whether it is mostly zero."""
    for operation in program.operations:
        match operation:
            case Map(count=count, results=results, rows=rows, picks=picks):
                names = {name: zeros[row : row + count] for name, row in rows.items()}
                names |= {name: zeros[pick] for name, pick in picks.items()}
                for start, expression in results:
                    yield start, start + count, _is_zero(expression, names)
            case Recall(memory=memory, start=start, stop=stop, slots=slots):
                yield start, stop, zeros[program.memories[memory].sources[slots]]
            case Sum(start=start, stop=stop) | Noise(start=start, stop=stop):
                yield start, stop, np.zeros(1, dtype=np.bool_)


def _is_zero(expression: Expression, names: Mapping[str, BoolArray]) -> BoolArray:
    """Find where an expression is mostly zero if the names are: a guess, on which no number depends."""
    zero = np.zeros(1, dtype=np.bool_)
    match expression:
        case Number(value=value):
            zero = np.array([value == 0])
        case Name(name=name):
            zero = names.get(name, zero)
        case Unary(operand=operand):
            zero = _is_zero(operand, names)
        case (
            Binary(operator="*", left=left, right=right) | Call(function="where", arguments=(_, left, right))
        ):
            zero = _is_zero(left, names) | _is_zero(right, names)
        case Binary(operator="+" | "-", left=left, right=right):
            zero = _is_zero(left, names) & _is_zero(right, names)
        case Binary(operator="/", left=left):
            zero = _is_zero(left, names)
        case Binary(operator="<" | "<=" | ">" | ">=") | Call(function="heaviside"):
            zero = np.ones(1, dtype=np.bool_)
    return zero
