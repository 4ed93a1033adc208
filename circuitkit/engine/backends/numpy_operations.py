"""From an operation of a program to numpy calls, bound to their arrays once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.engine.backends.numpy_expression import bind_expression
from circuitkit.engine.operations import Map, Operation, Sum
from circuitkit.engine.state import FloatArray

Call: TypeAlias = Callable[[], object]
_MAX_PADDING = 256  # zeros with which short sums may be filled up to the length of their neighbours
_MAX_CHAIN = 4


def bind_operation(operation: Operation, table: FloatArray) -> Iterator[Call]:
    """The calls that do an operation on a table of shape (n_rows, B)."""
    match operation:
        case Sum():
            yield from _bind_sum(operation, table)
        case Map():
            yield from _bind_map(operation, table)


def _bind_map(operation: Map, table: FloatArray) -> Iterator[Call]:
    count, batch = operation.count, table.shape[1]
    variables = {name: table[row : row + count] for name, row in operation.rows.items()}
    for name, rows in operation.picks.items():
        variables[name] = np.empty((count, batch), dtype=table.dtype)
        yield partial(table.take, rows.astype(np.intp), 0, variables[name], "clip")
    constants = {name: _spread(value, count, batch) for name, value in operation.constants.items()}
    written = [table[row : row + count] for row, _ in operation.results]
    # With one result numpy itself may read and write the same rows; more need a place to wait.
    places = written if len(written) == 1 else [np.empty_like(rows) for rows in written]
    for place, (_, expression) in zip(places, operation.results, strict=True):
        yield from bind_expression(expression, constants, variables, place)
    if places is not written:
        for rows, place in zip(written, places, strict=True):
            yield partial(np.copyto, rows, place)


def _bind_sum(operation: Sum, table: FloatArray) -> Iterator[Call]:
    for start, stop in _alike(operation.indptr):
        yield from _bind_rectangle(operation, start, stop, table)


def _alike(indptr: npt.NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Ranges of neighbouring sums that are filled up to one length without much waste."""
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
    batch, count = table.shape[1], stop - start
    lengths = np.diff(operation.indptr[start : stop + 1])
    total = table[operation.start + start : operation.start + stop]
    if not lengths.any():
        if not operation.add:
            yield partial(total.fill, 0.0)
        return
    shape = (int(lengths.max()), count)
    rows, weights = np.zeros(shape, dtype=np.intp), np.zeros((*shape, batch), dtype=table.dtype)
    for column in range(count):
        part = slice(int(operation.indptr[start + column]), int(operation.indptr[start + column + 1]))
        n = part.stop - part.start
        rows[:n, column] = operation.sources[part].astype(np.intp) + operation.base
        given = operation.weights if operation.weights.ndim == 0 else operation.weights[part]
        weights[:n, column] = given if operation.weights.ndim in {0, 2} else given[:, np.newaxis]
    terms = np.empty((*shape, batch), dtype=table.dtype)
    yield partial(table.take, rows, 0, terms, "clip")
    yield partial(np.multiply, terms, weights, terms)
    yield from _add_in_order([*([total] if operation.add else []), *terms], total)


def _add_in_order(terms: Sequence[FloatArray], total: FloatArray) -> Iterator[Call]:
    """Add terms of shape (n, B), one after the other."""
    first, *others = terms
    if not others:
        yield partial(np.copyto, total, first)
        return
    # Sums stand in turn in two arrays: numpy is slow where an array of one element is operand and result.
    places = [total if (len(others) - i) % 2 else np.empty_like(total) for i in range(len(others))]
    for summed, term, place in zip([first, *places], others, places, strict=False):
        yield partial(np.add, summed, term, place)


def _spread(values: FloatArray, count: int, batch: int) -> FloatArray:
    """Constants of shape (), (count,) or (count, B) as (count, B): numpy is slower when it broadcasts."""
    column = values[:, np.newaxis] if values.ndim == 1 else values
    return np.array(np.broadcast_to(column, (count, batch)), order="C")
