"""Weighted sums in numpy, term by term in the program's order (docs/decisions/0004), in one of three ways.

Which one is taken depends on the program and on whether the batch is large, and none of them on the other
members of the batch. Few terms are gathered into rectangles, whose columns are added; in a large batch they
are added row by row, by the same additions; many terms go through scipy's routine for sparse matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.engine.operations import FloatArray, Sum

Call: TypeAlias = Callable[[], object]
_MAX_PADDING = 256  # zeros with which short sums may be filled up to the length of their neighbours
_SPARSE = 512  # terms from which the sparse routine is faster
_LARGE_BATCH = 256  # members from which rows are added without gathering them before


def bind_sum(operation: Sum, table: FloatArray) -> Iterator[Call]:
    """Bind the calls that do a sum on a table of shape (n_rows, B)."""
    if len(operation.sources) >= _SPARSE and operation.weights.ndim <= 1:
        yield from _bind_sparse(operation, table)
        return
    for start, stop in _alike(operation.indptr):
        yield from _bind_rectangle(operation, start, stop, table)


def _bind_sparse(operation: Sum, table: FloatArray) -> Iterator[Call]:
    # The routine behind `csr_array @`, which would allocate its result and check its arguments at every call.
    from scipy.sparse import _sparsetools  # 0.1 s, which only large circuits need

    batch, count = table.shape[1], operation.stop - operation.start
    total = table[operation.start : operation.stop].reshape(-1)
    values = table[operation.base :].reshape(-1)
    pointers = operation.indptr.astype(np.int32)
    weights = np.ascontiguousarray(np.broadcast_to(operation.weights, operation.sources.shape), table.dtype)
    if not operation.add:
        yield partial(total.fill, 0.0)
    sizes = (count, len(table) - operation.base)
    matrix = (pointers, operation.sources, weights, values, total)
    if batch == 1:
        yield partial(_sparsetools.csr_matvec, *sizes, *matrix)
    else:
        yield partial(_sparsetools.csr_matvecs, *sizes, batch, *matrix)


def _alike(indptr: npt.NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Yield ranges of neighbouring sums that are filled up to one length without much waste."""
    lengths = np.diff(indptr).tolist()
    begin = longest = total = 0
    for end, length in enumerate(lengths):
        longest, total = max(longest, length), total + length
        if longest * (end + 1 - begin) - total > max(_MAX_PADDING, total):
            yield begin, end
            begin, longest, total = end, length, length
    if begin < len(lengths):
        yield begin, len(lengths)


def _bind_rectangle(operation: Sum, start: int, stop: int, table: FloatArray) -> Iterator[Call]:
    """Sums of one length, shorter ones filled up with row 0, which is zero."""
    batch, count = table.shape[1], stop - start
    total = table[operation.start + start : operation.start + stop]
    longest = int(np.diff(operation.indptr[start : stop + 1]).max())
    if longest == 0:
        if not operation.add:
            yield partial(total.fill, 0.0)
        return
    rows = np.zeros((longest, count), dtype=np.intp)
    weights = np.zeros((longest, count, batch if operation.weights.ndim > 1 else 1), dtype=table.dtype)
    for column in range(count):
        part = slice(int(operation.indptr[start + column]), int(operation.indptr[start + column + 1]))
        n = part.stop - part.start
        rows[:n, column] = operation.sources[part].astype(np.intp) + operation.base
        given = operation.weights if operation.weights.ndim == 0 else operation.weights[part]
        weights[:n, column] = given if operation.weights.ndim != 1 else given[:, np.newaxis]
    if batch >= _LARGE_BATCH:
        for column in range(count):
            chosen = rows[:, column].tolist()
            terms = [(table[row], weights[i, column]) for i, row in enumerate(chosen) if row]
            yield from _bind_row(terms, total[column], add=operation.add)
            if len(terms) < longest:  # what is filled up adds zeros, which only make -0 a 0
                yield partial(np.add, total[column], np.zeros(1, dtype=table.dtype), total[column])
        return
    taken = np.empty((longest, count, batch), dtype=table.dtype)
    factors = np.ascontiguousarray(np.broadcast_to(weights, taken.shape))
    yield partial(table.take, rows, 0, taken, "clip")
    yield partial(np.multiply, taken, factors, taken)
    yield from _add_in_order([*([total] if operation.add else []), *taken], total)


def _bind_row(
    terms: Sequence[tuple[FloatArray, FloatArray]], total: FloatArray, *, add: bool
) -> Iterator[Call]:
    """Yield the additions of a column; weights of 1 and -1 need no product for the same bits."""
    product = np.empty_like(total)
    if not terms and not add:
        yield partial(total.fill, 0.0)
    for i, (row, weight) in enumerate(terms):
        is_plus, is_minus = bool((weight == 1.0).all()), bool((weight == -1.0).all())
        if i == 0 and not add:
            yield partial(np.positive, row, total) if is_plus else partial(np.multiply, row, weight, total)
            continue
        if not is_plus and not is_minus:
            yield partial(np.multiply, row, weight, product)
        ufunc = np.subtract if is_minus else np.add
        yield partial(ufunc, total, row if is_plus or is_minus else product, total)


def _add_in_order(terms: Sequence[FloatArray], total: FloatArray) -> Iterator[Call]:
    """Add terms of shape (n, B), one after the other."""
    first, *others = terms
    if not others:
        yield partial(np.positive, first, total)
        return
    # Sums stand in turn in two arrays: numpy is slow where an array of one element is operand and result.
    places = [total if (len(others) - i) % 2 else np.empty_like(total) for i in range(len(others))]
    for summed, term, place in zip([first, *places], others, places, strict=False):
        yield partial(np.add, summed, term, place)
