"""NPZ archives, of which nothing is believed before it is checked: members, sizes, types and shapes."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile, ZipInfo

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import CircuitkitError, listing
from circuitkit.base.reading import open_file

_SUFFIX = ".npy"
_LAST_RECORD, _TOTAL = (
    22,
    10,
)  # of a ZIP file: its length without the comment, and where the number of members is
_MOST_MEMBERS = 32
_LONGEST_HEADER = 4096
_LONGEST_ITEM = 64  # [bytes]
REAL, WHOLE, TEXT = "biuf", "iu", "SU"  # what numpy calls the kinds of what arrays hold
_ALLOWED = {REAL: "real numbers", WHOLE: "whole numbers", TEXT: "a text"}
_FOUND = {"c": "complex numbers", "f": "real numbers", "b": "truth values", "i": "numbers", "u": "numbers"}
_VERSIONS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


class ArchiveError(CircuitkitError):
    """An archive is damaged, or holds what is not allowed: what was found, and what is allowed."""


@dataclass(frozen=True)
class Archive:
    """An open archive.

    Attributes:
        file: The archive.
        members: Its members by the names of their arrays.
    """

    file: ZipFile
    members: dict[str, ZipInfo]

    def array(self, name: str, kinds: str, ndim: int, most: int) -> npt.NDArray[Any]:
        """Read an array.

        Args:
            name: Its name.
            kinds: `REAL`, `WHOLE` or `TEXT`.
            ndim: How many axes it must have.
            most: How many numbers at most.

        Raises:
            ArchiveError: It is not there, or not what it must be; nothing is made of it then.
        """
        shape, dtype, begin = self._header(name)
        count = math.prod(shape)
        if dtype.kind not in kinds or dtype.subdtype is not None:
            found = _FOUND.get(dtype.kind, f"data of the type {dtype}")
            message = f"found {found} in '{name}'; allowed: {_ALLOWED[kinds]}"
            raise ArchiveError(message)
        if len(shape) != ndim or min(shape, default=0) < 0 or count > most:
            message = f"found '{name}' of the shape {shape}; allowed: {ndim} axes, up to {most} numbers"
            raise ArchiveError(message)
        if begin + count * dtype.itemsize != self.members[name].file_size or dtype.itemsize > _LONGEST_ITEM:
            message = f"found '{name}' of the shape {shape}, but another size; allowed: a whole file"
            raise ArchiveError(message)
        with self.file.open(self.members[name]) as stream:
            found_array: npt.NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
        return found_array

    def shape(self, name: str) -> tuple[int, ...]:
        """The shape of an array, as it declares it.

        Raises:
            ArchiveError: It is no array.
        """
        return self._header(name)[0]

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any], int]:
        """Shape and type of an array, as its header declares them, and where its numbers begin."""
        if name not in self.members:
            message = f"found the arrays {listing(self.members)}; allowed: with one that is called {name}"
            raise ArchiveError(message)
        with self.file.open(self.members[name]) as stream:
            try:
                version = np.lib.format.read_magic(stream)
                shape, _, dtype = _VERSIONS[version](stream, max_header_size=_LONGEST_HEADER)
            except Exception as error:  # what Python's parser and numpy say about a text that is no header
                message = f"found no array in '{name}'; allowed: what numpy.savez writes"
                raise ArchiveError(message) from error
            return tuple(int(length) for length in shape), dtype, stream.tell()


@contextmanager
def open_archive(path: Path, most: int) -> Iterator[Archive]:
    """Open an NPZ file.

    Args:
        path: The file.
        most: Its largest size, [bytes].

    Raises:
        InputError: The file cannot be opened.
        ArchiveError: It is damaged, or something in it is not allowed.
    """
    with open_file(path, "an NPZ file", most) as raw:
        try:
            with ZipFile(raw) as file:
                yield Archive(file, _members(file, _declared(raw, len(file.comment))))
        except (CircuitkitError, MemoryError):
            raise
        except Exception as error:  # zipfile, zlib, lzma, struct and numpy have their own
            said = str(error).partition("\n")[0] or type(error).__name__
            allowed = "what numpy.savez or scipy.sparse.save_npz writes"
            message = f"found a damaged archive ({said}); allowed: {allowed}"
            raise ArchiveError(message) from error


def _declared(raw: IO[bytes], comment: int) -> int:
    """How many members the last record of an archive declares; `comment` bytes follow it."""
    at = raw.tell()
    raw.seek(-(_LAST_RECORD + comment) + _TOTAL, io.SEEK_END)
    total = int.from_bytes(raw.read(2), "little")
    raw.seek(at)
    return total


def _members(file: ZipFile, declared: int) -> dict[str, ZipInfo]:
    infos = file.infolist()
    if len(infos) != declared:  # a wrong length in the list of members makes some of them a part of another
        message = f"found {len(infos)} of {declared} members; allowed: a whole archive"
        raise ArchiveError(message)
    if len(infos) > _MOST_MEMBERS:
        message = f"found {len(infos)} members; allowed: {_MOST_MEMBERS}"
        raise ArchiveError(message)
    members: dict[str, ZipInfo] = {}
    for info in infos:
        name = info.filename.removesuffix(_SUFFIX)
        if not info.filename.endswith(_SUFFIX) or not name.isprintable() or name in members:
            message = f"found the member '{info.filename[:60]}'; allowed: arrays (NAME{_SUFFIX}), each once"
            raise ArchiveError(message)
        members[name] = info
    return members
