"""Columns as CSV, which every reader of CSV reads as the same numbers; and its cells as numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

_CHUNK = 4096  # lines that are made at once: Python's numbers take four times the memory of an array's


def csv_lines(columns: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a table of numbers, several at a time.

    A column is one of floats in every line, `0.0` and never `0`, or a reader that looks at the first lines
    takes it for whole numbers. Each has as many digits as it takes to read the same number again.

    Args:
        columns: By name, as many numbers each.
    """
    arrays = [np.asarray(values, dtype=np.float64) for values in columns.values()]
    yield csv_line(columns)
    for start in range(0, max(map(len, arrays), default=0), _CHUNK):
        parts = [array[start : start + _CHUNK] for array in arrays]
        lists = [
            part.tolist() if np.isfinite(part).all() else [csv_number(value) for value in part.tolist()]
            for part in parts
        ]
        yield csv_line(*zip(*lists, strict=True))


def csv_line(*rows: Any) -> str:  # noqa: ANN401 - whatever `csv` writes
    """Lines with the fields of each row, quoted where they must be."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def csv_number(value: float) -> str:
    """A float as text; what is no number is `NaN`, as readers know it."""
    return "NaN" if value != value else repr(float(value))  # noqa: PLR0124 - only NaN differs from itself


def read_number(cell: str) -> float:
    """The number in a cell, as all readers of CSV read it: no `1_0` and no digits of other scripts.

    Raises:
        ValueError: There is none.
    """
    if "_" in cell or not cell.isascii():
        message = f"could not convert string to float: {cell!r}"
        raise ValueError(message)
    return float(cell)
