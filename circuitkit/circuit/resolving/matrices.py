"""Matrix files of projections: CSV, NPZ (of numpy or scipy) and Parquet, to sparse rows of targets.

A table of numbers has a row for every target and a column for every source, as W in eq. 11; where it is zero
there is no synapse. A table with the columns `source` and `target`, and perhaps `weight`, has a row for every
synapse.
"""

from __future__ import annotations

import csv
import importlib
import io
import math
import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from circuitkit.base.archive import REAL, ArchiveError, open_archive
from circuitkit.base.errors import CircuitkitError, InputError, MissingDependencyError, Problem, listing
from circuitkit.base.reading import MIB, MOST_TABLE, decoded, open_file, read_text
from circuitkit.base.tables import read_number
from circuitkit.circuit.resolving import sparse
from circuitkit.circuit.resolving.connectivity import Connections

Weights = npt.NDArray[np.float64] | None
Matrix = tuple[Connections, Weights]
_SPARSE_KEYS = frozenset({"indices", "indptr", "shape"})
_COLUMNS = ("source", "target", "weight")
_NUMBERS_OF_ARROW = re.compile(r"u?int(8|16|32|64)|halffloat|float|double")
MOST_MATRIX = 16 * 1024 * MIB
_LONGEST_LINE = 64 * MIB
_SEPARATORS = ";\t "
_SEPARATE = "; separate the columns by commas, and write decimals with points"


class MatrixFileError(CircuitkitError):
    """A matrix file cannot be used: what was found in it, and what is allowed."""


def read_matrix(path: Path, n_target: int, n_source: int) -> Matrix:
    """Read the synapses of a matrix file, with their weights if the file has any.

    Args:
        path: The file; its suffix says what it is.
        n_target: Number of targets, which is the number of rows of a table of numbers.
        n_source: Number of sources, which is the number of columns.

    Raises:
        MatrixFileError: The file is missing or damaged, of another shape, or holds what is no finite number.
        MissingDependencyError: Reading Parquet needs a package that is not installed.
    """
    readers: Mapping[str, Callable[[Path, int, int], Matrix]] = {
        ".csv": _read_csv,
        ".npz": _read_npz,
        ".parquet": _read_parquet,
    }
    if path.suffix not in readers:
        message = f"found a matrix file '{path.name}'; allowed: {listing(readers)}"
        raise MatrixFileError(message)
    try:
        return readers[path.suffix](path, n_target, n_source)
    except MatrixFileError:
        raise
    except InputError as error:
        problem = error.problems[0]
        if problem.is_placed:
            raise MatrixFileError(str(problem)) from error
        if problem.message.startswith("there is no"):
            message = f"there is no file '{path}'; allowed: a matrix file by path from here"
        else:
            message = f"cannot read '{path}': {problem.message}"
        raise MatrixFileError(message) from error
    except ArchiveError as error:
        message = f"cannot read '{path}': {error}"
        raise MatrixFileError(message) from error
    except MemoryError as error:
        message = f"cannot read '{path}': it needs more memory than there is; allowed: a smaller one"
        raise MatrixFileError(message) from error


def _read_csv(path: Path, n_target: int, n_source: int) -> Matrix:
    begin, header = _header(path)
    if header is None:
        return _dense(_numbers(path, 0), n_target, n_source)
    _check_columns(header)
    table = _numbers(path, begin)
    if table.shape[1] != len(header):
        raise _fault(path, begin, len(header))
    columns = dict(zip(header, table.T, strict=True))
    return _edges(columns, n_target, n_source)


def _header(path: Path) -> tuple[int, list[str] | None]:
    """How many lines the header and what is above it take, and its names; None if the table has none."""
    with open_file(path, "a CSV file", MOST_TABLE) as file:
        above = 0
        while (line := file.readline(_LONGEST_LINE)).strip() in {b"", b"\xef\xbb\xbf"} or line[:1] == b"#":
            if not line:
                return 0, None
            above += 1
    first = decoded(line, str(path))
    try:
        cells = [cell.strip() for cell in next(csv.reader([first]))]
    except csv.Error as error:  # a carriage return in the middle of a line
        message = f"found a line that is no CSV: {error}; allowed: numbers or names with commas between them"
        raise InputError(Problem(str(path), above + 1, 1, "", message)) from error
    if any(_is_number(cell) for cell in cells):
        return 0, None
    return above + 1, cells


def _is_number(cell: str) -> bool:
    try:
        read_number(cell)
    except ValueError:
        return False
    return True


def _numbers(path: Path, begin: int) -> npt.NDArray[np.float64]:
    """The table behind the header; numpy reads files much faster than lines, so it opens this one again."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of no data, which is said below
        try:
            table = np.loadtxt(
                path, delimiter=",", quotechar='"', ndmin=2, skiprows=begin, encoding="utf-8-sig"
            )
        except ValueError as error:
            raise _fault(path, begin) from error
    if not table.size:
        message = f"found no numbers in '{path}'; allowed: a row for every target, or for every synapse"
        raise MatrixFileError(message)
    if not np.isfinite(table.sum()) and not np.isfinite(table).all():
        raise _fault(path, begin)
    return table


def _fault(path: Path, begin: int, width: int = 0) -> MatrixFileError:
    """What is wrong with a table that numpy refused: its first such cell; lines and columns count from 1."""
    lines = csv.reader(io.StringIO(read_text(path, "a CSV file", MOST_TABLE), newline=""))
    try:
        for row in lines:
            if lines.line_num <= begin or not "".join(row).strip() or row[0].startswith("#"):
                continue
            width = width or len(row)
            for column, cell in enumerate(row, 1):
                if not _is_number(cell) or not math.isfinite(float(cell)):
                    hint = _SEPARATE if any(mark in cell for mark in _SEPARATORS) else ""
                    found = f"found '{cell[:60]}' in '{path}', line {lines.line_num}, column {column}"
                    return MatrixFileError(f"{found}; allowed: a finite number{hint}")
            if len(row) != width:
                found = f"found {len(row)} values in '{path}', line {lines.line_num}"
                return MatrixFileError(f"{found}; allowed: {width}, as in the line above")
    except csv.Error as error:
        return MatrixFileError(f"cannot read '{path}', line {lines.line_num}: {error}; allowed: a CSV table")
    return MatrixFileError(f"cannot read '{path}': numpy does not read its numbers; allowed: a CSV table")


def _read_parquet(path: Path, n_target: int, n_source: int) -> Matrix:
    try:
        parquet = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        package, extra = "pyarrow", "data"
        raise MissingDependencyError(package, extra, f"reading '{path}'") from error
    with open_file(path, "a Parquet file", MOST_TABLE) as file:
        try:
            opened = parquet.ParquetFile(file)
            used = _columns_of(opened, n_target * n_source)
            table = opened.read(columns=used)
        except (CircuitkitError, MemoryError):
            raise
        except Exception as error:  # of pyarrow, which has many
            said = str(error).partition("\n")[0] or type(error).__name__
            message = f"cannot read '{path}': {said}; allowed: a Parquet file"
            raise MatrixFileError(message) from error
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    return _edges(columns, n_target, n_source)


def _columns_of(opened: Any, most: int) -> list[str]:  # noqa: ANN401 - pyarrow is not typed
    """The columns of a Parquet file that are read; refuses rows and types that cannot be right."""
    schema, rows = opened.schema_arrow, opened.metadata.num_rows
    _check_columns(list(schema.names))
    if rows > most:
        message = f"found {rows} rows; allowed: up to {most}, each synapse once"
        raise MatrixFileError(message)
    used = [name for name in _COLUMNS if name in schema.names]
    for name in used:
        kind = str(schema.field(name).type)
        if not _NUMBERS_OF_ARROW.fullmatch(kind):
            message = f"found the column {name} of the type {kind[:60]}; allowed: numbers"
            raise MatrixFileError(message)
    return used


def _check_columns(names: list[str]) -> None:
    if not {"source", "target"} <= set(names) <= set(_COLUMNS) or len(set(names)) < len(names):
        shown = listing(name or "(no name)" for name in names)
        message = f"found the columns {shown}; allowed: source, target and, if it has one, weight"
        if len(names) == 1 and any(mark in names[0] for mark in _SEPARATORS):
            message += _SEPARATE
        elif not names[0] or {"source", "target"}.isdisjoint(names):
            message += "; or a table of numbers alone, without names of rows and columns"
        raise MatrixFileError(message)


def _read_npz(path: Path, n_target: int, n_source: int) -> Matrix:
    shape = (n_target, n_source)
    with open_archive(path, MOST_MATRIX) as archive:
        names = list(archive.members)
        if "format" not in names and not set(names) >= _SPARSE_KEYS:
            if len(names) != 1:
                message = (
                    f"found the arrays {listing(names)}; allowed: one, or a sparse matrix as scipy saves it"
                )
                raise MatrixFileError(message)
            _check_shape(archive.shape(names[0]), *shape)
            return _dense(archive.array(names[0], REAL, 2, n_target * n_source), *shape)
        form = sparse.form_of(archive)
        _check_shape(sparse.shape_of(archive), *shape)
        if form == "csr":
            indptr, columns, weights = sparse.rows_of(archive, shape)
            return _checked(
                indptr, columns.astype(np.int32, copy=False), None if weights is None else _real(weights)
            )
        rows, columns, values = sparse.entries_of(archive, form, shape)
    # numpy sorts numbers of two bytes by their digits, six times as fast
    keys = [each.astype(np.min_scalar_type(n - 1)) for each, n in ((columns, n_source), (rows, n_target))]
    order = np.lexsort(keys)
    return _checked(_starts(rows, n_target), columns[order].astype(np.int32), _real(values[order]))


def _starts(targets: npt.NDArray[Any], n_target: int) -> npt.NDArray[np.int64]:
    """Where the synapses of each target begin among all, shape (n_target + 1,)."""
    starts = np.zeros(n_target + 1, dtype=np.int64)
    np.cumsum(np.bincount(targets.astype(np.int64), minlength=n_target), out=starts[1:])
    return starts


def _dense(table: npt.NDArray[Any], n_target: int, n_source: int) -> Matrix:
    _check_shape(table.shape, n_target, n_source)
    rows, columns = np.nonzero(table)
    return _checked(_starts(rows, n_target), columns.astype(np.int32), _real(table[rows, columns]))


def _real(weights: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    with np.errstate(over="ignore"):  # of longer floats; what is not finite is refused
        return np.asarray(weights, dtype=np.float64)


def _edges(columns: Mapping[str, npt.NDArray[Any]], n_target: int, n_source: int) -> Matrix:
    """From a row for every synapse, in any order."""
    for name, size in (("source", n_source), ("target", n_target)):
        numbers = columns[name]
        wrong = np.flatnonzero(~((numbers >= 0) & (numbers < size) & (numbers == np.floor(numbers))))
        if len(wrong):
            at, found = wrong[0], numbers[wrong[0]]
            message = (
                f"found the {name} {found:g} in row {at + 1}; allowed: whole numbers from 0 to {size - 1}"
            )
            raise MatrixFileError(message)
    order = np.lexsort((columns["source"], columns["target"]))
    sources = columns["source"][order].astype(np.int32)
    weights = _real(columns["weight"][order]) if "weight" in columns else None
    return _checked(_starts(columns["target"], n_target), sources, weights)


def _check_shape(shape: tuple[int, ...], n_target: int, n_source: int) -> None:
    if shape != (n_target, n_source):
        found = " x ".join(str(n) for n in shape) or "one number"
        message = f"found a matrix of {found}; allowed: {n_target} x {n_source}, a row for every target"
        raise MatrixFileError(message)


def _checked(indptr: npt.NDArray[np.int64], sources: npt.NDArray[np.int32], weights: Weights) -> Matrix:
    """Require every pair once and finite weights; put rows in order if need be."""
    if weights is not None and not np.isfinite(weights.sum()):
        wrong = np.flatnonzero(~np.isfinite(weights))
        if len(wrong):
            row, column = _pair(indptr, sources, wrong[0])
            found = f"found {weights[wrong[0]]:g} for the synapse from {column} to {row}"
            message = f"{found}; allowed: finite numbers"
            raise MatrixFileError(message)
    if _not_ascending(indptr, sources).any():
        order = np.lexsort((sources, np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))))
        sources, weights = sources[order], None if weights is None else weights[order]
        twice = np.flatnonzero(_not_ascending(indptr, sources))
        if len(twice):
            row, column = _pair(indptr, sources, twice[0])
            message = f"found the synapse from {column} to {row} twice; allowed: each one once"
            raise MatrixFileError(message)
    return (indptr, sources), weights


def _not_ascending(indptr: npt.NDArray[np.int64], sources: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    """Find where a source is not below the next one of the same target, shape (n_synapses - 1,)."""
    wrong = sources[1:] <= sources[:-1]
    starts = indptr[1:-1]
    wrong[starts[(starts > 0) & (starts < len(sources))] - 1] = False
    return wrong


def _pair(
    indptr: npt.NDArray[np.int64],
    sources: npt.NDArray[np.int32],
    position: Any,  # noqa: ANN401 - an index
) -> tuple[int, int]:
    """Return target and source of a synapse, counted from 0 as members are."""
    return int(np.searchsorted(indptr, position, side="right")) - 1, int(sources[position])
