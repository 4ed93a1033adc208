"""The one way in: what comes from outside is read here, whatever it holds.

Only regular files of a limited size are read: a device never ends, and a named pipe waits for a writer. Text
is UTF-8 and printable. What cannot be opened is said by an `Unopened` problem, which a file that names it
takes to the line that does.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import stat
import sys
from io import BufferedReader
from pathlib import Path

from circuitkit.base.errors import InputError, Problem, Unopened, suggest

MIB = 2**20
MOST_TEXT = 16 * MIB  # of what people write; a file of this size takes a minute
MOST_TABLE = 1024 * MIB
INTEGERS_END = 2**63  # tables, C and random generators have no larger whole numbers
LONGEST_NAME = 200  # of what messages, tables and pictures show; a path to a field is one, too

# Not printable: controls, surrogates, what is no character, private use; and what changes the order of the
# text or is there without being seen. The joiners U+200C and U+200D are allowed: Persian and emoji need them.
_UNPRINTABLE = (
    "\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\xad\u061c\u180e\u200b\u200e\u200f\u202a-\u202e\u2060-\u206f"
    "\ud800-\uf8ff\ufdd0-\ufdef\ufeff\ufff0-\ufffb\ufffe\uffff\U000e0000-\U000e0fff\U000f0000-\U0010ffff"
)
_ANY_UNPRINTABLE = re.compile(f"[{_UNPRINTABLE}]")
_ANY_NOT_IN_NAMES = re.compile(f"[{_UNPRINTABLE}\t\n\r\x85\u200c\u200d\u2028\u2029]")
_ANY_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # names of files in it may have what is no text
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def open_file(path: str | Path, what: str, most: int) -> BufferedReader:
    """Open a regular file to read bytes.

    Args:
        path: The file.
        what: What it should be, for messages, such as "a YAML file".
        most: The largest size, [bytes].

    Raises:
        InputError: It is not there, is no regular file, is too large, or may not be read.
    """
    try:
        file = open(path, "rb", opener=_without_waiting)  # noqa: SIM115 - the caller closes it
    except (OSError, ValueError) as error:  # a ValueError for a NUL
        raise InputError(_unopened(path, what, error)) from error
    found = os.fstat(file.fileno())
    if not stat.S_ISREG(found.st_mode):
        message = f"found {_KINDS.get(stat.S_IFMT(found.st_mode), 'no regular file')}; allowed: {what}"
    elif found.st_size > most:
        message = (
            f"found a file of {found.st_size / MIB:.4g} MiB; allowed: {what} of up to {most / MIB:g} MiB"
        )
    else:
        return file
    file.close()
    raise InputError(Unopened(str(path), 1, 1, "", message))


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a named pipe is opened at once, whether or not somebody writes to it."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _unopened(path: str | Path, what: str, error: OSError | ValueError) -> Problem:
    shown = str(path)
    if isinstance(error, FileNotFoundError):
        hint = suggest(Path(path).name, _beside(Path(path)))
        return Unopened(shown, 1, 1, "", f"there is no such file; allowed: {what}", hint)
    if isinstance(error, IsADirectoryError):
        return Unopened(shown, 1, 1, "", f"found a folder; allowed: {what}")
    reason = str(error)
    if isinstance(error, OSError):
        unconnected = error.errno == errno.ENXIO  # what opening a socket says
        reason = "it is a socket or a device" if unconnected else error.strerror or type(error).__name__
    return Unopened(shown, 1, 1, "", f"cannot be read: {reason}; allowed: {what}")


def _beside(path: Path) -> list[str]:
    """The names of the files of the same kind in the same folder."""
    yaml = path.suffix in {".yaml", ".yml", ""}
    try:
        return sorted(other.name for other in path.parent.glob("*.y*ml" if yaml else f"*{path.suffix}"))
    except (OSError, ValueError):
        return []


def is_file(path: Path) -> bool:
    """Whether there is a regular file of this name; no name makes it fail, however long or odd."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def resolved(path: Path) -> Path:
    """The absolute path without links, as far as there are files; a circle of links stays as it is."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):
        return path


def read_bytes(path: str | Path, what: str, most: int = MOST_TEXT) -> bytes:
    """Read a regular file; see `open_file`.

    Raises:
        InputError: It cannot be opened, or ends later than it says.
    """
    with open_file(path, what, most) as file:
        try:
            size = os.fstat(file.fileno()).st_size  # `read(most)` makes room for all of it
            content = file.read(min(size, most) + 1)
            content += file.read(most + 1 - len(content)) if len(content) > size else b""
        except OSError as error:
            raise InputError(_unopened(path, what, error)) from error
    if len(content) > most:
        message = f"found a file that is larger than it says; allowed: {what} of up to {most / MIB:g} MiB"
        raise InputError(Unopened(str(path), 1, 1, "", message))
    return content


def checksum_of(path: str | Path, what: str, most: int = sys.maxsize) -> str:
    """SHA-256 of a regular file, which may be larger than the memory; see `open_file`.

    Raises:
        InputError: It cannot be opened or read.
    """
    with open_file(path, what, most) as file:
        try:
            return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise InputError(_unopened(path, what, error)) from error


def environment(variable: str) -> str:
    """The value of a variable of the environment, without spaces around it; empty if it is not set.

    Raises:
        InputError: It has a control character.
    """
    value = os.environ.get(variable, "").strip()
    if (found := _ANY_CONTROL.search(value)) is not None:
        message = f"{_called(found[0])}; allowed: printable text, or unset it"
        raise InputError(Problem("", 0, 0, f"${variable}", message))
    return value


def read_text(path: str | Path, what: str, most: int = MOST_TEXT) -> str:
    """Read a text file in UTF-8, with or without a byte order mark.

    Raises:
        InputError: It cannot be opened, is not UTF-8, or has characters that are not printable.
    """
    text = decoded(read_bytes(path, what, most), str(path))
    require_printable(text, str(path))
    return text


def decoded(content: bytes, path: str) -> str:
    """Bytes in UTF-8 as text.

    Raises:
        InputError: They are not UTF-8.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start]
        line, column = before.count(b"\n") + 1, error.start - (before.rfind(b"\n") + 1) + 1
        byte = content[error.start]
        message = f"found the byte 0x{byte:02x}, which is no UTF-8; allowed: a text file in UTF-8"
        hint = "it may be UTF-16: save it as UTF-8" if content[:2] in {b"\xff\xfe", b"\xfe\xff"} else ""
        raise InputError(Problem(path, line, column, "", message, hint)) from error


def require_printable(text: str, path: str) -> None:
    """Refuse a text of several lines that is not printable.

    Raises:
        InputError: It is not; says where.
    """
    if (found := _ANY_UNPRINTABLE.search(text)) is not None:
        before = text[: found.start()]
        line, column = before.count("\n") + 1, found.start() - (before.rfind("\n") + 1) + 1
        raise InputError(Problem(path, line, column, "", f"{_called(found[0])}; allowed: printable text"))


def not_a_text(text: str) -> str:
    """The complaint about a text that is not printable; empty if it is."""
    found = _ANY_UNPRINTABLE.search(text)
    return "" if found is None else f"{_called(found[0])}; allowed: printable text"


def not_a_name(text: str) -> str:
    """The complaint about a name that is too long or not printable on a line; empty if it is."""
    if len(text) > LONGEST_NAME:
        return f"found a name of {len(text)} characters; allowed: up to {LONGEST_NAME}"
    found = _ANY_NOT_IN_NAMES.search(text)
    return "" if found is None else f"{_called(found[0])} in a name; allowed: printable text on one line"


def _called(character: str) -> str:
    is_control = ord(character) < 0x20 or 0x7F <= ord(character) < 0xA0  # noqa: PLR2004 - ASCII, Latin-1
    return f"found the {'control' if is_control else 'invisible'} character U+{ord(character):04X}"
