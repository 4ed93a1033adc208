"""Sparse matrices of any numbers: what is accepted is what scipy makes of it, and nothing crashes."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import io
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from circuitkit.circuit.resolving.matrices import MatrixFileError, read_matrix

SHAPE = (3, 4)
W = np.array([[0, 1.5, 0, -2], [0, 0, 0, 0], [3, 0, 0.25, 0]])


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def table_of(path: Path) -> np.ndarray:
    (indptr, sources), weights = read_matrix(path, *SHAPE)
    assert (indptr.dtype, sources.dtype) == (np.int64, np.int32)
    return sparse.csr_matrix((weights, sources, indptr), shape=SHAPE).toarray()


@pytest.mark.parametrize("form", ["csr", "csc", "coo", "dia"])
@pytest.mark.parametrize("kind", [sparse.csr_matrix, sparse.csr_array])
@pytest.mark.parametrize("number", ["<f8", ">f8", "<f4", "i2"])
@pytest.mark.parametrize("compressed", [True, False])
def test_every_format_is_read(form, kind, number, compressed):
    table = np.rint(W).astype(number) if number == "i2" else W.astype(number)
    saved = io.BytesIO()
    sparse.save_npz(saved, kind(table.astype(table.dtype.newbyteorder("="))).asformat(form))
    saved.seek(0)
    with np.load(saved) as arrays:
        found = {name: arrays[name] for name in arrays}
    found["data"] = found["data"].astype(number)
    (np.savez_compressed if compressed else np.savez)("w.npz", **found)
    np.testing.assert_array_equal(table_of(Path("w.npz")), table)


@pytest.mark.parametrize("size", [(1, 2), (3, 1), (3, 2), (1, 4), (3, 4)])
def test_blocks_are_read(size):
    sparse.save_npz("w.npz", sparse.bsr_matrix(W, blocksize=size))
    np.testing.assert_array_equal(table_of(Path("w.npz")), W)


@pytest.mark.parametrize("number", ["i1", "u1", ">i2", "i4", "u8"])
@pytest.mark.parametrize("form", ["csr", "csc", "coo", "bsr"])
def test_indices_may_be_of_the_smallest_type_that_holds_them(form, number):
    table = np.zeros((4, 300 if form == "bsr" else 100))
    table[0, 5], table[3, -1] = 1, 2
    matrix = sparse.bsr_matrix(table, blocksize=(2, 10)) if form == "bsr" else sparse.csr_matrix(table)
    parts = ("row", "col") if form == "coo" else ("indices", "indptr")
    found = {name: getattr(matrix.asformat(form), name).astype(number) for name in parts}
    np.savez("w.npz", format=form, shape=table.shape, data=matrix.asformat(form).data, **found)
    (indptr, sources), weights = read_matrix(Path("w.npz"), *table.shape)
    read = sparse.csr_matrix((weights, sources, indptr), shape=table.shape)
    np.testing.assert_array_equal(read.toarray(), table)


@pytest.mark.parametrize(
    ("form", "arrays", "message"),
    [
        ("lil", {}, "found a matrix in the format 'lil'; allowed: csr, csc, coo, bsr, dia"),
        ("bsr", {"data": np.ones((1, 2, 4))}, "found blocks of 2 x 4; allowed: blocks that fill 3 x 4"),
        ("bsr", {"data": np.ones((1, 3, 3))}, "found blocks of 3 x 3; allowed: blocks that fill 3 x 4"),
        ("bsr", {"data": np.ones((0, 0, 2))}, "found blocks of 0 x 2; allowed: blocks that fill 3 x 4"),
        ("bsr", {"data": np.ones((0, 3, 0))}, "found blocks of 3 x 0; allowed: blocks that fill 3 x 4"),
        ("coo", {"data": np.ones(1), "row": [3], "col": [0]}, "found 3 in 'row'; allowed: 0 to 2"),
        ("coo", {"data": np.ones(1), "row": [0], "col": [-1]}, "found -1 in 'col'; allowed: 0 to 3"),
        ("coo", {"data": np.ones(1), "coords": [[0], [0], [0]]}, "found coordinates of 3 axes; allowed: 2"),
        ("coo", {"data": np.ones(1), "row": [0], "col": [0, 1]}, "found 1 rows and 2 columns; allowed: one of each for every entry"),
        ("dia", {"data": np.ones((1, 4)), "offsets": [4]}, "found diagonals that are not there, or twice; allowed: -2 to 3"),
        ("dia", {"data": np.ones((1, 4)), "offsets": [-3]}, "found diagonals that are not there, or twice; allowed: -2 to 3"),
        ("dia", {"data": np.ones((2, 4)), "offsets": [1, 1]}, "found diagonals that are not there, or twice; allowed: -2 to 3"),
        ("csc", {"data": np.ones(1), "indices": [0], "indptr": [0, 1]}, "found 2 numbers in 'indptr'; allowed: 5"),
        ("csc", {"data": np.ones(2), "indices": [0], "indptr": [0, 1, 1, 1, 1]}, "found 'data' of the shape (2,); allowed: 1 axes, up to 1 numbers"),
    ],
)  # fmt: skip
def test_arrays_that_do_not_belong_together_are_refused(form, arrays, message):
    np.savez("w.npz", format=form, shape=SHAPE, **arrays)
    with pytest.raises(MatrixFileError) as caught:
        read_matrix(Path("w.npz"), *SHAPE)
    assert str(caught.value) == f"cannot read 'w.npz': {message}"


def test_coordinates_may_be_one_array():
    rows, columns = np.nonzero(W)
    np.savez("w.npz", format="coo", shape=SHAPE, data=W[rows, columns], coords=[rows, columns])
    np.testing.assert_array_equal(table_of(Path("w.npz")), W)


dtypes = st.sampled_from(["i1", "<i4", ">i4", "<i8", ">i8", "u4", "u8", "f8", "?", "c16", "U2"])
numbers = st.integers(-2, 6) | st.sampled_from([2**31, 2**32, 2**32 + 1, 2**40, -(2**31), 2**62])


@st.composite
def arrays(draw):
    values = draw(st.lists(numbers, max_size=6))
    with np.errstate(all="ignore"):
        try:
            array = np.array(values, dtype=draw(dtypes))
        except (OverflowError, ValueError):
            array = np.array(values, dtype=np.int64)
    return array.reshape(draw(st.sampled_from([array.shape, (1, -1), (-1, 1)]))) if array.size else array


names = {
    "csr": ("indices", "indptr"), "csc": ("indices", "indptr"), "bsr": ("indices", "indptr"),
    "coo": ("row", "col"), "dia": ("offsets",), "nonsense": ("row",),
}  # fmt: skip


@settings(deadline=None, max_examples=400)
@given(
    st.sampled_from(sorted(names)), arrays(), arrays(), arrays(),
    st.sampled_from([SHAPE, (4, 3), (3, 4, 1), (-3, -4), (3,)]), st.booleans(),
)  # fmt: skip
def test_arrays_of_any_numbers_are_refused_or_mean_what_scipy_takes_them_for(
    form, a, b, data, shape, as_float
):
    data = data.astype(float, copy=False) if as_float and data.dtype.kind in "iu" else data
    if form == "bsr":
        data = data.reshape(-1, 1, 1)
    elif form == "dia":
        data = data.reshape(len(a), -1) if len(a) and data.size % len(a) == 0 else data.reshape(1, -1)
    given_arrays = dict(zip(names[form], (a, b), strict=False)) | {"data": data}
    np.savez("w.npz", format=form.encode(), shape=shape, **given_arrays)
    try:
        found = table_of(Path("w.npz"))
    except MatrixFileError:
        return
    a, b, data = (each.astype(each.dtype.newbyteorder("=")) for each in (a, b, data))  # scipy takes no other
    maker = getattr(sparse, f"{form}_matrix")
    parts = {"coo": (data, (a, b)), "dia": (data, a)}.get(form, (data, a, b))
    np.testing.assert_array_equal(found, maker(parts, shape=SHAPE).toarray())


good = io.BytesIO()
sparse.save_npz(good, sparse.csr_matrix(W))


@settings(deadline=None, max_examples=300)
@given(st.integers(0, len(good.getvalue()) - 1), st.integers(0, 255), st.booleans())
def test_a_damaged_archive_is_refused_or_read_as_it_was(position, byte, cut):
    content = bytearray(good.getvalue())
    content[position] = byte
    Path("w.npz").write_bytes(content[:position] if cut else content)
    with suppress(MatrixFileError):
        np.testing.assert_array_equal(table_of(Path("w.npz")), W)


def test_an_array_of_another_name_may_be_the_weights():
    indptr, sources = np.array([0, 2, 2, 4]), np.array([1, 3, 0, 2])
    np.savez("w.npz", indptr=indptr, indices=sources, shape=SHAPE, weight=np.ones(4))
    with pytest.raises(MatrixFileError, match="found the arrays weight; allowed: those of a sparse matrix"):
        table_of(Path("w.npz"))


def member(header: str, numbers: bytes = b"") -> bytes:
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + numbers


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 4)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-3, -4)}",
        "{'descr': '|O', 'fortran_order': False, 'shape': (3, 4)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4)}",
        "{'descr': '<U1000000000', 'fortran_order': False, 'shape': (3, 4)}",
        "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3, 4)}",
        "((((((((((((((((((((((((((((((",
        "__import__('os')",
        "",
    ],
)
def test_a_header_is_not_believed(header):
    with zipfile.ZipFile("w.npz", "w") as file:
        file.writestr("arr_0.npy", member(header))
    with pytest.raises(MatrixFileError):
        table_of(Path("w.npz"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "nan,1,2,3\n1,2,3,4\n1,2,3,4\n",
            "found 'nan' in 'w.csv', line 1, column 1; allowed: a finite number",
        ),
        (
            "0,1,2,3\n1,2,inf,4\n1,2,3,4\n",
            "found 'inf' in 'w.csv', line 2, column 3; allowed: a finite number",
        ),
        ("0;1;2;3\n", "separate the columns by commas"),
        ("source;target\n1;0\n", "separate the columns by commas"),
        ("0,5;1,5\n1,5;2,5\n", "separate the columns by commas, and write decimals with points"),
        ("0,1,2,3\n1,2\n", "found 2 values in 'w.csv', line 2; allowed: 4, as in the line above"),
        ("0,1,2,3\n1,,2,3\n", "found '' in 'w.csv', line 2, column 2; allowed: a finite number"),
        ('"","V1","V2"\n"1",0,1\n', "or a table of numbers alone, without names of rows and columns"),
        ("source,target\n", "found no numbers in 'w.csv'"),
        (
            "# a, b\n0,1,2,3\n# c, d\n1,x,2,3\n",
            "found 'x' in 'w.csv', line 4, column 2; allowed: a finite number",
        ),
        (
            "source,targt\n1,2\n",
            "found the columns source, targt; allowed: source, target and, if it has one, weight",
        ),
        ("", "found no numbers in 'w.csv'"),
        (
            "source,source,target\n1,1,1\n",
            "found the columns source, source, target; allowed: source, target",
        ),
    ],
)
def test_a_table_that_cannot_be_read_says_line_and_column(text, message):
    Path("w.csv").write_text(text, encoding="utf-8")
    with pytest.raises(MatrixFileError) as caught:
        table_of(Path("w.csv"))
    assert message in str(caught.value)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("header", ["source,target,weight", '"source","target","weight"'])
def test_tables_of_other_programs_are_read(mark, end, header):
    rows = [header, "1,0,1.5", "3,0,-2", "0,2,3", "2,2,0.25"]
    Path("w.csv").write_text(mark + end.join(rows) + end, encoding="utf-8", newline="")
    np.testing.assert_array_equal(table_of(Path("w.csv")), W)


def test_what_is_no_parquet_is_told_in_one_line_of_the_library():
    Path("w.parquet").write_bytes(b"nothing of the kind")
    with pytest.raises(
        MatrixFileError, match=r"^cannot read 'w.parquet': Parquet [^\n]+; allowed: a Parquet file$"
    ):
        read_matrix(Path("w.parquet"), *SHAPE)
