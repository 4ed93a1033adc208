"""Sparse matrices as scipy saves them, checked before anything is made of their numbers.

CSR stays as it is, and every other format becomes the coordinates of its entries. scipy itself, whose C code
believes its arrays, is not asked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from circuitkit.base.archive import REAL, TEXT, WHOLE, Archive, ArchiveError
from circuitkit.base.errors import listing

Ints = npt.NDArray[np.int64]
Numbers = npt.NDArray[Any]
Shape = tuple[int, int]
# Rows, columns and values of the entries, in any order.
Entries = tuple[Ints, Ints, Numbers]
_NAMES = frozenset(
    ["format", "shape", "data", "indices", "indptr", "row", "col", "coords", "offsets", "_is_array"]
)  # `_is_array` says that a sparse array was saved, not a sparse matrix


def form_of(archive: Archive) -> str:
    """The format of a sparse matrix, such as "csc"; CSR if it does not say.

    Raises:
        ArchiveError: There is an array of another name, which may be values of which the name is wrong.
    """
    if other := sorted(set(archive.members) - _NAMES):
        message = f"found the arrays {listing(other)}; allowed: those of a sparse matrix as scipy saves it"
        raise ArchiveError(message)
    if "format" not in archive.members:
        return "csr"
    found = archive.array("format", TEXT, 0, 1).item()
    return found.decode("latin-1") if isinstance(found, bytes) else str(found)


def shape_of(archive: Archive) -> tuple[int, ...]:
    """The shape of a sparse matrix."""
    return tuple(int(length) for length in archive.array("shape", WHOLE, 1, 8))


def rows_of(archive: Archive, shape: Shape) -> tuple[Ints, Ints, Numbers | None]:
    """Where each row of a CSR matrix begins, the columns of its entries, and their values if it has any.

    Raises:
        ArchiveError: The arrays do not belong together.
    """
    starts, columns = _compressed(archive, shape[0], shape[1], shape[0] * shape[1])
    if "data" not in archive.members:
        return starts, columns, None
    return starts, columns, _values(archive, 1, len(columns))


def entries_of(archive: Archive, form: str, shape: Shape) -> Entries:
    """The entries of a matrix in another format.

    Args:
        archive: The open file.
        form: As scipy calls it, such as "csc".
        shape: Of the matrix, which is known to be right.

    Raises:
        ArchiveError: The arrays do not belong together, or the format is not known.
    """
    readers: Mapping[str, Callable[[Archive, Shape], Entries]] = {
        "csc": _columns, "coo": _coordinates, "bsr": _blocks, "dia": _diagonals
    }  # fmt: skip
    if form not in readers:
        message = f"found a matrix in the format '{form}'; allowed: csr, {listing(readers)}"
        raise ArchiveError(message)
    return readers[form](archive, shape)


def _columns(archive: Archive, shape: Shape) -> Entries:
    starts, rows = _compressed(archive, shape[1], shape[0], shape[0] * shape[1])
    columns = np.repeat(np.arange(shape[1]), np.diff(starts))
    return rows, columns, _values(archive, 1, len(rows))


def _coordinates(archive: Archive, shape: Shape) -> Entries:
    most = shape[0] * shape[1]
    if "coords" in archive.members:  # as scipy may save them in future
        coords = archive.array("coords", WHOLE, 2, 2 * most)
        if len(coords) != 2:  # noqa: PLR2004 - rows and columns
            message = f"found coordinates of {len(coords)} axes; allowed: 2"
            raise ArchiveError(message)
        found = (coords[0], coords[1])
    else:
        found = (archive.array("row", WHOLE, 1, most), archive.array("col", WHOLE, 1, most))
    rows, columns = _indices(found[0], shape[0], "row"), _indices(found[1], shape[1], "col")
    if len(rows) != len(columns):
        message = f"found {len(rows)} rows and {len(columns)} columns; allowed: one of each for every entry"
        raise ArchiveError(message)
    return rows, columns, _values(archive, 1, len(rows))


def _blocks(archive: Archive, shape: Shape) -> Entries:
    data = archive.array("data", REAL, 3, shape[0] * shape[1])
    high, wide = data.shape[1:]
    if high < 1 or wide < 1 or shape[0] % high or shape[1] % wide:
        message = f"found blocks of {high} x {wide}; allowed: blocks that fill {shape[0]} x {shape[1]}"
        raise ArchiveError(message)
    starts, across = _compressed(archive, shape[0] // high, shape[1] // wide, shape[0] * shape[1])
    across = across.astype(np.int64)  # their own type may not hold the columns that they stand for
    if len(data) != len(across):
        message = f"found {len(data)} blocks for {len(across)} indices; allowed: one for each"
        raise ArchiveError(message)
    down = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    rows = np.broadcast_to(down[:, None, None] * high + np.arange(high)[:, None], data.shape)
    columns = np.broadcast_to(across[:, None, None] * wide + np.arange(wide), data.shape)
    return rows.ravel(), columns.ravel(), data.ravel()


def _diagonals(archive: Archive, shape: Shape) -> Entries:
    most = shape[0] + shape[1] - 1
    offsets = archive.array("offsets", WHOLE, 1, most)
    data = archive.array("data", REAL, 2, most * max(shape))
    inside = (offsets > -shape[0]) & (offsets < shape[1])
    if not inside.all() or len(np.unique(offsets)) < len(offsets) or len(data) != len(offsets):
        message = f"found diagonals that are not there, or twice; allowed: -{shape[0] - 1} to {shape[1] - 1}"
        raise ArchiveError(message)
    columns = np.broadcast_to(np.arange(data.shape[1]), data.shape)
    rows = columns - offsets.astype(np.int64)[:, None]
    there = (rows >= 0) & (rows < shape[0]) & (columns < shape[1]) & (data != 0)
    return rows[there], columns[there], data[there]


def _compressed(archive: Archive, lines: int, across: int, most: int) -> tuple[Ints, Ints]:
    """Where each of the lines begins, and the indices in them."""
    starts = archive.array("indptr", WHOLE, 1, lines + 1)
    indices = _indices(archive.array("indices", WHOLE, 1, most), across, "indices")
    if len(starts) != lines + 1:
        message = f"found {len(starts)} numbers in 'indptr'; allowed: {lines + 1}"
        raise ArchiveError(message)
    if starts[0] != 0 or starts[-1] != len(indices) or (starts[1:] < starts[:-1]).any():
        message = "found rows that do not follow each other; allowed: a sparse matrix as scipy saves it"
        raise ArchiveError(message)
    return starts.astype(np.int64), indices


def _indices(numbers: Numbers, end: int, name: str) -> Ints:
    """Refuse indices that are not there, in their own type: a conversion would wrap them."""
    if len(numbers) and (numbers.min() < 0 or numbers.max() >= end):
        found = numbers.min() if numbers.min() < 0 else numbers.max()
        message = f"found {found} in '{name}'; allowed: 0 to {end - 1}"
        raise ArchiveError(message)
    return numbers


def _values(archive: Archive, ndim: int, count: int) -> Numbers:
    values = archive.array("data", REAL, ndim, count)
    if len(values) != count:
        message = f"found {len(values)} values for {count} entries; allowed: one for each"
        raise ArchiveError(message)
    return values
