"""Which maps share a loop: every further pass over long rows costs the time in which memory gives them.

A map joins the last loop before it over as many rows, if nothing between them reads or writes what it does
otherwise. Rows that one map of a loop writes and another one reads or writes must begin at the same row: then
every i finds what the operations one after the other would have left.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from circuitkit.circuit.expressions.expression import Binary, Expression, Name, Number
from circuitkit.engine.backends.c.pieces import written_ranges
from circuitkit.engine.operations import Map, Noise, Operation, Recall, Remember, Sum

_MANY_ROWS = 1024  # below, rows stay in the processor's own cache
_MOST_MAPS = 8  # of a loop: long functions are no faster, and like ones are compiled once
_FAR = 16  # operations back to which a loop is looked for

Range: TypeAlias = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Loop:
    """Maps over as many rows, done one after the other for every i.

    Attributes:
        maps: At least one.
    """

    maps: tuple[Map, ...]


def fused(operations: Iterable[Operation]) -> Iterator[Operation | Loop]:
    """Yield the same operations, with loops in place of maps.

    Args:
        operations: What is done one after the other.
    """
    groups: list[list[Operation]] = []
    for operation in map(_as_map, operations):
        if (group := _loop_for(operation, groups)) is not None:
            group.append(operation)
        else:
            groups.append([operation])
    for group in groups:
        maps = tuple(each for each in group if isinstance(each, Map))
        yield Loop(maps) if maps else group[0]


def _as_map(operation: Operation) -> Operation:
    """Sums of one term each, of neighbouring rows, are a map with the same additions."""
    if not isinstance(operation, Sum):
        return operation
    n = operation.stop - operation.start
    if n < _MANY_ROWS or len(operation.sources) != n:
        return operation
    each = np.arange(n)
    first = operation.base + int(operation.sources[0])
    if (operation.indptr[:-1] != each).any() or (operation.sources - operation.sources[0] != each).any():
        return operation
    before: Expression = Name("before") if operation.add else Number(0.0)
    rows = {"source": first, "before": operation.start} if operation.add else {"source": first}
    total = Binary("+", before, Binary("*", Name("weight"), Name("source")))
    return Map(n, ((operation.start, total),), rows, {}, {"weight": operation.weights})


def _loop_for(operation: Operation, groups: Sequence[list[Operation]]) -> list[Operation] | None:
    """Return the operations that a map may join."""
    if not isinstance(operation, Map) or operation.count < _MANY_ROWS:
        return None
    for group in reversed(groups[-_FAR:]):
        if len(group) < _MOST_MAPS and all(_go_together(operation, each) for each in group):
            return group
        if any(_depend(operation, each) for each in group):
            return None
    return None


def _go_together(later: Map, earlier: Operation) -> bool:
    """Check whether two maps may share a loop."""
    if not isinstance(earlier, Map) or earlier.count != later.count:
        return False
    rows = [(row, row + later.count) for each in (earlier, later) for row in each.rows.values()]
    picked = [*_picked(earlier), *_picked(later)]
    written = [*written_ranges(earlier), *written_ranges(later)]
    return not _meet(picked, written) and all(
        one == other or not _meet([one], [other]) for one in [*rows, *written] for other in written
    )


def _depend(later: Operation, earlier: Operation) -> bool:
    """Check whether two operations may not change places."""
    changed, before = [*written_ranges(later)], [*written_ranges(earlier)]
    return (
        _meet(changed, before)
        or _meet(changed, [*_read_ranges(earlier)])
        or _meet([*_read_ranges(later)], before)
    )


def _meet(some: Iterable[Range], others: Sequence[Range]) -> bool:
    return any(start < end and begin < stop for start, stop in some for begin, end in others)


def _read_ranges(operation: Operation) -> Iterator[Range]:
    """Return ranges in which the rows lie that an operation reads."""
    match operation:
        case Map(count=count, rows=rows):
            yield from ((row, row + count) for row in rows.values())
            yield from _picked(operation)
        case Sum(start=start, stop=stop, sources=sources, base=base):
            yield start, stop
            if len(sources):
                yield base + int(sources.min()), base + int(sources.max()) + 1
        case Noise(start=start, stop=stop) | Recall(start=start, stop=stop):
            yield start, stop
        case Remember(sources=sources) if len(sources):
            yield int(sources.min()), int(sources.max()) + 1


def _picked(operation: Map) -> Iterator[Range]:
    for rows in operation.picks.values():
        yield int(rows.min()), int(rows.max()) + 1
