"""Rules of projections to sparse matrices by rows of targets (CSR), row after row.

Nothing here holds more than the result and a block of rows: neither a dense matrix nor pairs of indices.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Sources: TypeAlias = npt.NDArray[np.int32]
Pointers: TypeAlias = npt.NDArray[np.int64]
# Where the synapses of every target begin, shape (n_target + 1,), and the members of the source, ascending.
Connections: TypeAlias = tuple[Pointers, Sources]

_BLOCK = 1 << 19  # numbers held at a time


def all_to_all(n_source: int, n_target: int, *, without_self: bool = False) -> Connections:
    """Return every source to every target, but for a member to itself where that is excluded."""
    degree = n_source - without_self
    sources = np.empty((n_target, degree), dtype=np.int32)
    sources[:] = np.arange(degree, dtype=np.int32)
    if without_self:
        _skip_self(sources, 0)
    return np.arange(n_target + 1, dtype=np.int64) * degree, sources.reshape(-1)


def one_to_one(size: int) -> Connections:
    """Return every source to the target of the same number."""
    return np.arange(size + 1, dtype=np.int64), np.arange(size, dtype=np.int32)


def listed(rows: Sequence[Sequence[int]]) -> Connections:
    """For every target the sources that are listed."""
    indptr = np.zeros(len(rows) + 1, dtype=np.int64)
    np.cumsum([len(row) for row in rows], out=indptr[1:])
    return indptr, np.array([source for row in rows for source in row], dtype=np.int32)


def in_degree(
    degree: int, n_source: int, n_target: int, random: np.random.Generator, *, without_self: bool = False
) -> Connections:
    """To every target from `degree` different sources, all choices equally likely.

    Args:
        degree: Number of sources of every target, up to the number there are.
        n_source: Number of sources.
        n_target: Number of targets.
        random: Source of random numbers.
        without_self: Whether no member connects to itself.
    """
    choices = n_source - without_self
    sources = np.empty((n_target, degree), dtype=np.int32)
    for begin, end in _blocks(n_target, choices if 2 * degree > choices else degree):
        block = sources[begin:end]
        if 2 * degree > choices:
            block[:] = _all_but(_different(choices - degree, choices, end - begin, random), choices)
        else:
            block[:] = _different(degree, choices, end - begin, random)
        if without_self:
            _skip_self(block, begin)
    return np.arange(n_target + 1, dtype=np.int64) * degree, sources.reshape(-1)


def probability(
    chance: float, n_source: int, n_target: int, random: np.random.Generator, *, without_self: bool = False
) -> Connections:
    """Return every pair with the same chance, each independent of the others.

    From pair to pair: the number of pairs up to the next synapse has a geometric distribution.

    Args:
        chance: Probability of a synapse, 0 to 1.
        n_source: Number of sources.
        n_target: Number of targets.
        random: Source of random numbers.
        without_self: Whether no member connects to itself.
    """
    if chance >= 1.0:
        return all_to_all(n_source, n_target, without_self=without_self)
    indptr = np.zeros(n_target + 1, dtype=np.int64)
    n_pairs = n_source * n_target
    expected = n_pairs * chance
    sources = np.empty(int(expected + 12 * np.sqrt(expected) + 100), dtype=np.int32)
    count, last = 0, -1
    block = max(1, min(_BLOCK // 4, int(1.1 * expected) + 16, 2**62 // n_pairs))
    while chance > 0.0:
        # Very rare ones may lie beyond what 64 bits count; they lie beyond the last pair all the same.
        gaps = np.minimum(random.geometric(chance, block).astype(np.uint64), n_pairs + 1).astype(np.int64)
        pairs = np.cumsum(gaps) + last
        last = int(pairs[-1])
        pairs = pairs[: np.searchsorted(pairs, n_pairs)]
        rows, columns = np.divmod(pairs, n_source)
        if without_self:
            rows, columns = rows[rows != columns], columns[rows != columns]
        if len(rows):
            indptr[rows[0] + 1 : rows[-1] + 2] += np.bincount(rows - rows[0])
        sources[count : count + len(columns)] = columns
        count += len(columns)
        if last >= n_pairs:
            break
    np.cumsum(indptr, out=indptr)
    return indptr, sources[:count]


def _blocks(n_rows: int, width: int) -> Iterator[tuple[int, int]]:
    """Return ranges of rows that together hold about a block of numbers."""
    height = max(1, _BLOCK // max(1, width))
    return ((begin, min(begin + height, n_rows)) for begin in range(0, n_rows, height))


def _different(count: int, choices: int, n_rows: int, random: np.random.Generator) -> Sources:
    """In every row `count` different numbers below `choices`, ascending, shape (n_rows, count).

    What was drawn before in a row is drawn anew until all differ, as if drawing one by one and passing over
    repetitions, by which all choices are equally likely.
    """
    drawn = random.integers(0, choices, (n_rows, count), dtype=np.int32)
    drawn.sort(axis=1)
    rows = np.arange(n_rows)
    while len(rows):
        part = drawn[rows]
        repeated = np.zeros(part.shape, dtype=bool)
        repeated[:, 1:] = part[:, 1:] == part[:, :-1]
        has_repeated = repeated.any(axis=1)
        rows, part, repeated = rows[has_repeated], part[has_repeated], repeated[has_repeated]
        part[repeated] = random.integers(0, choices, int(repeated.sum()), dtype=np.int32)
        part.sort(axis=1)
        drawn[rows] = part
    return drawn


def _all_but(left_out: Sources, choices: int) -> Sources:
    """In every row the numbers below `choices` that are not left out, ascending."""
    kept = np.ones((len(left_out), choices), dtype=bool)
    np.put_along_axis(kept, left_out.astype(np.intp), values=False, axis=1)
    return np.nonzero(kept)[1].astype(np.int32).reshape(len(left_out), -1)


def _skip_self(block: Sources, first_row: int) -> None:
    """Numbers from the row's own on become one larger, in place: they were drawn among the others only."""
    own = np.arange(first_row, first_row + len(block), dtype=np.int32)
    block += block >= own[:, None]
