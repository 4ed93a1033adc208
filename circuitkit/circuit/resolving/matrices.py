"""Matrix files of projections: CSV, NPZ (of numpy or scipy) and Parquet, to sparse rows of targets.

A table of numbers has a row for every target and a column for every source, as W in eq. 11; where it is zero
there is no synapse. A table with the columns `source` and `target`, and perhaps `weight`, has a row for every
synapse.
"""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import CircuitkitError, MissingDependencyError, listing
from circuitkit.circuit.resolving.connectivity import Connections

Weights = npt.NDArray[np.float64] | None
Matrix = tuple[Connections, Weights]
_SPARSE_KEYS = frozenset({"indices", "indptr", "shape"})
_COLUMNS = ("source", "target", "weight")


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
    if not path.is_file():
        message = f"there is no file '{path}'; allowed: a matrix file by path from here"
        raise MatrixFileError(message)
    try:
        return readers[path.suffix](path, n_target, n_source)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        message = (
            f"cannot read '{path}': {str(error).splitlines()[0] if str(error) else type(error).__name__}"
        )
        raise MatrixFileError(message) from error


def _read_csv(path: Path, n_target: int, n_source: int) -> Matrix:
    with path.open(encoding="utf-8-sig") as file:
        header = [word.strip() for word in file.readline().split(",")]
    if not header[0].isidentifier():
        return _dense(_numbers(path), n_target, n_source)
    _check_columns(header)
    table = _numbers(path, lines_of_header=1)
    columns = dict(zip(header, table.reshape(-1, len(header)).T, strict=True))
    return _edges(columns, n_target, n_source)


def _numbers(path: Path, lines_of_header: int = 0) -> npt.NDArray[np.float64]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of no data, which is said below
        table = np.loadtxt(path, delimiter=",", ndmin=2, skiprows=lines_of_header, encoding="utf-8-sig")
    if not table.size:
        message = f"found no numbers in '{path}'; allowed: a row for every target, or for every synapse"
        raise MatrixFileError(message)
    return table


def _read_parquet(path: Path, n_target: int, n_source: int) -> Matrix:
    try:
        parquet = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        package, extra = "pyarrow", "data"
        raise MissingDependencyError(package, extra, f"reading '{path}'") from error
    names = list(parquet.read_schema(path).names)
    _check_columns(names)
    table = parquet.read_table(path, columns=[name for name in _COLUMNS if name in names])
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    return _edges(columns, n_target, n_source)


def _check_columns(names: list[str]) -> None:
    if not {"source", "target"} <= set(names) <= set(_COLUMNS):
        message = f"found the columns {listing(names)}; allowed: source, target and, if it has one, weight"
        raise MatrixFileError(message)


def _read_npz(path: Path, n_target: int, n_source: int) -> Matrix:
    with np.load(path, allow_pickle=False) as arrays:
        names = list(arrays)
        if set(names) >= _SPARSE_KEYS and _format(arrays) == "csr":
            _check_shape(tuple(int(n) for n in arrays["shape"]), n_target, n_source)
            indptr = np.asarray(arrays["indptr"], dtype=np.int64)
            sources = np.asarray(arrays["indices"], dtype=np.int32)
            weights = _real(arrays["data"]) if "data" in names else None
            return _checked(indptr, sources, weights, n_source)
        if "format" not in names:
            if len(names) != 1:
                message = (
                    f"found the arrays {listing(names)}; allowed: one, or a sparse matrix as scipy saves it"
                )
                raise MatrixFileError(message)
            return _dense(arrays[names[0]], n_target, n_source)
    from scipy import sparse  # 0.1 s, which only a file of scipy's own needs

    matrix = sparse.load_npz(path).tocsr()
    _check_shape(matrix.shape, n_target, n_source)
    indptr = matrix.indptr.astype(np.int64)
    return _checked(indptr, matrix.indices.astype(np.int32), _real(matrix.data), n_source)


def _format(arrays: Any) -> str:  # noqa: ANN401 - numpy's open file
    found = arrays["format"].item() if "format" in arrays else "csr"
    return found.decode() if isinstance(found, bytes) else str(found)


def _dense(table: npt.NDArray[Any], n_target: int, n_source: int) -> Matrix:
    _check_shape(table.shape, n_target, n_source)
    rows, columns = np.nonzero(table)
    indptr = np.zeros(n_target + 1, dtype=np.int64)
    np.cumsum(np.bincount(rows, minlength=n_target), out=indptr[1:])
    return _checked(indptr, columns.astype(np.int32), _real(table[rows, columns]), n_source)


def _real(weights: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    if np.iscomplexobj(weights):  # casting would drop a part of each
        message = "found complex numbers; allowed: real ones"
        raise MatrixFileError(message)
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
    indptr = np.zeros(n_target + 1, dtype=np.int64)
    np.cumsum(np.bincount(columns["target"].astype(np.int64), minlength=n_target), out=indptr[1:])
    weights = columns["weight"][order].astype(np.float64) if "weight" in columns else None
    return _checked(indptr, sources, weights, n_source)


def _check_shape(shape: tuple[int, ...], n_target: int, n_source: int) -> None:
    if shape != (n_target, n_source):
        found = " x ".join(str(n) for n in shape)
        message = f"found a matrix of {found}; allowed: {n_target} x {n_source}, a row for every target"
        raise MatrixFileError(message)


def _checked(
    indptr: npt.NDArray[np.int64], sources: npt.NDArray[np.int32], weights: Weights, n_source: int
) -> Matrix:
    """Require every pair once and finite weights; put rows in order if need be."""
    if weights is not None and not np.isfinite(weights.sum()):
        wrong = np.flatnonzero(~np.isfinite(weights))
        if len(wrong):
            row, column = _pair(indptr, sources, wrong[0])
            message = f"found {weights[wrong[0]]:g} in row {row}, column {column}; allowed: finite numbers"
            raise MatrixFileError(message)
    if len(sources) and (sources.min() < 0 or sources.max() >= n_source):
        message = f"found the column {sources.max()}; allowed: 0 to {n_source - 1}"
        raise MatrixFileError(message)
    if indptr[0] != 0 or indptr[-1] != len(sources) or (np.diff(indptr) < 0).any():
        message = "found rows that do not follow each other; allowed: a sparse matrix as scipy saves it"
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
    """Return row and column of a synapse, from 0."""
    return int(np.searchsorted(indptr, position, side="right")) - 1, int(sources[position])
