"""What archives hold is checked before it is read: each refusal, word for word."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from circuitkit.base.archive import REAL, TEXT, WHOLE, ArchiveError, open_archive


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.fixture
def packed(tmp_path):
    """Writes an archive of members by name."""

    def write(**members: np.ndarray | bytes) -> Path:
        with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
            for name, content in members.items():
                file.writestr(name, content if isinstance(content, bytes) else npy(content))
        return tmp_path / "a.npz"

    return write


def read(path: Path, name: str = "a", kinds: str = REAL, ndim: int = 1, most: int = 3) -> np.ndarray:
    with open_archive(path, 2**20) as archive:
        return archive.array(name, kinds, ndim, most)


@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
@pytest.mark.parametrize(
    ("values", "kinds"),
    [([1.5, -2], REAL), ([True], REAL), ([3], WHOLE), (["x" * 16], TEXT), ([b"x" * 64], TEXT), ([], REAL)],
)
def test_what_is_as_it_must_be_is_read(packed, values, kinds, version):
    file = io.BytesIO()
    np.lib.format.write_array(file, np.array(values), version)
    np.testing.assert_array_equal(read(packed(**{"a.npy": file.getvalue()}), kinds=kinds), np.array(values))


@pytest.mark.parametrize(
    ("values", "asked", "message"),
    [
        ([1j], {}, "found complex numbers in 'a'; allowed: real numbers"),
        ([1.0], {"kinds": WHOLE}, "found real numbers in 'a'; allowed: whole numbers"),
        ([True], {"kinds": WHOLE}, "found truth values in 'a'; allowed: whole numbers"),
        ([1], {"kinds": TEXT}, "found numbers in 'a'; allowed: a text"),
        (["x"], {}, "found data of the type <U1 in 'a'; allowed: real numbers"),
        ([1, 2, 3, 4], {}, "found 'a' of the shape (4,); allowed: 1 axes, up to 3 numbers"),
        ([[1]], {}, "found 'a' of the shape (1, 1); allowed: 1 axes, up to 3 numbers"),
        ([b"x" * 65], {"kinds": TEXT}, "found 'a' of the shape (1,), but another size; allowed: a whole file"),
        ([1], {"name": "b"}, "found the arrays a; allowed: with one that is called b"),
    ],
)  # fmt: skip
def test_what_is_not_is_refused(packed, values, asked, message):
    with pytest.raises(ArchiveError) as caught:
        read(packed(**{"a.npy": np.array(values)}), **asked)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"a.txt": b""}, "found the member 'a.txt'; allowed: arrays (NAME.npy), each once"),
        ({"a\x1b.npy": b""}, "found the member 'a\\x1b.npy'; allowed: arrays (NAME.npy), each once"),
        ({f"{'n' * 70}.dat": b""}, f"found the member '{'n' * 60}'; allowed: arrays (NAME.npy), each once"),
        ({f"a{i}.npy": b"" for i in range(33)}, "found 33 members; allowed: 32"),
        ({"a.npy": b"nonsense"}, "found no array in 'a'; allowed: what numpy.savez writes"),
        ({"a.npy": npy(np.ones(3))[:-1]}, "found 'a' of the shape (3,), but another size; allowed: a whole file"),
        ({"a.npy": npy(np.ones(3)) + b"x"}, "found 'a' of the shape (3,), but another size; allowed: a whole file"),
    ],
)  # fmt: skip
def test_members_that_are_no_arrays_are_refused(packed, members, message):
    with pytest.raises(ArchiveError) as caught:
        read(packed(**members))
    assert str(caught.value) == message


def test_as_many_members_as_are_allowed_are_read(packed):
    assert read(packed(**{f"a{i}.npy": np.ones(1) for i in range(32)}), "a31") == 1


def test_a_member_is_there_once(packed):
    path = packed(**{"a.npy": np.ones(1)})
    with zipfile.ZipFile(path, "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("a.npy", b"")
    with pytest.raises(
        ArchiveError, match=r"^found the member 'a\.npy'; allowed: arrays \(NAME\.npy\), each"
    ):
        read(path)


def test_a_comment_is_no_damage_and_a_member_that_is_lost_is(packed):
    path = packed(**{"a.npy": np.ones(1), "b.npy": np.ones(2)})
    with zipfile.ZipFile(path, "a") as file:
        file.comment = b"of the year 2024"
    assert read(path) == 1
    content = bytearray(path.read_bytes())
    content[-16 - 22 + 10] = 3  # "total number of entries in the central directory", APPNOTE.TXT 4.3.16
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match=r"^found 2 of 3 members; allowed: a whole archive$"):
        read(path)


def test_what_is_no_archive_is_said_in_the_words_of_who_reads_it(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"nonsense")
    allowed = "allowed: what numpy.savez or scipy.sparse.save_npz writes"
    with pytest.raises(ArchiveError) as caught:
        read(tmp_path / "a.npz")
    assert str(caught.value) == f"found a damaged archive (File is not a zip file); {allowed}"
