"""Writing results: a file is whole or not there, and what is read back shows whether it was damaged.

What is being written has a name such as `.circuitkit-1f0c5a9e.part.csv` beside its target and is locked for
as long as its process lives. So what a killed process left can be told from what another one is writing, and
the next that writes into the folder takes it away.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.reading import MOST_TABLE, read_bytes
from circuitkit.base.signals import tidied_up_when_ended

if sys.platform != "win32":
    import fcntl

_SCRATCH = re.compile(r"\.circuitkit-[0-9a-f]{8}\.part(\.\w+)?")
_NOT_SYNCED = frozenset(
    {errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES}
)  # by this kind of file system
_OPEN_FILES = ("/dev/std", "/dev/fd/", "/proc/")  # Linux's names for them

_MARK = "circuitkit-seal:"
SEAL = _MARK + "0" * 64
_SEALED = re.compile(_MARK.encode() + rb"[0-9a-f]{64}")


class OutputError(CircuitkitError):
    """A result cannot be written; the message names the file and the reason."""


class DamagedFileError(CircuitkitError):
    """A file is not what was written; the message says what to do."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, which takes the place of `path` once it is written and on the disk.

    Folders that are missing are made. If the body raises, or SIGTERM ends the process, an older file at
    `path` stays as it was and the temporary one is removed. A file that is there keeps its permissions, a
    link to it stays a link. What is no regular file, such as `/dev/stdout`, is written directly.

    Args:
        path: The file to write.

    Yields:
        The name to write to; it has the suffix of `path`, by which many writers choose the format.

    Raises:
        OutputError: The file cannot be written: a folder of that name, no permission, a full disk.
    """
    try:
        if path.is_dir():
            message = f"cannot write '{path}': it is a folder; name a file in it"
            raise OutputError(message)
        if _is_special(path):
            yield path
            return
        target = path.resolve()
        _make_folder(target.parent)
        mode = _mode_to_keep(target)
        with scratch(target.parent, target.suffix) as part:
            if mode is not None:
                part.chmod(mode | 0o600)
            yield part
            _sync(part)
            if mode is not None:
                part.chmod(mode)
            part.replace(target)
            _sync(target.parent)
    except (OSError, RuntimeError, ValueError) as error:
        if not isinstance(error, OSError) and not _is_of_the_name(path):
            raise
        message = f"cannot write '{path}': {reason(error)}"
        raise OutputError(message) from error
    for note in tuple(_LISTENERS):
        note(target)


_LISTENERS: list[Callable[[Path], object]] = []


@contextmanager
def noting_what_is_written(note: Callable[[Path], object]) -> Iterator[None]:
    """Have a function called with the resolved path of every file that is written in the block."""
    _LISTENERS.append(note)
    try:
        yield
    finally:
        _LISTENERS.remove(note)


def write_text(path: Path, text: str) -> None:
    """Write a text file as `replacing` does: in UTF-8, whatever the locale and the system are.

    Raises:
        OutputError: The file cannot be written.
    """
    with replacing(path) as part:
        # What is no text, such as a byte of a file name, is written as an escape.
        part.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, so that they are on the disk; those that are there stay.

    Raises:
        OutputError: One cannot be made: a file has its name, no permission.
    """
    try:
        _make_folder(folder)
    except (OSError, RuntimeError, ValueError) as error:
        message = f"cannot write to '{folder}': {reason(error)}"
        raise OutputError(message) from error


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Have a folder for this block alone, among blocks like it in all processes of this machine.

    The folder is made if it is missing, and goes again if it is empty then. Where the file system or the
    system have no locks, nothing is asked.

    Raises:
        OutputError: Another block has it, or it cannot be made.
    """
    missing = not folder.exists()
    make_folder(folder)
    lock = None
    try:
        try:
            if sys.platform != "win32":
                lock = os.open(folder, os.O_RDONLY)
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            message = f"cannot write to '{folder}': another run writes there; name another folder, or wait"
            raise OutputError(message) from error
        except OSError:  # a folder that may not be read, or no locks on this file system
            pass
        yield
    finally:
        if missing:
            with suppress(OSError):
                folder.rmdir()
        if lock is not None:
            os.close(lock)


def _make_folder(folder: Path) -> None:
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        file = next((each for each in (folder, *folder.parents) if os.path.lexists(each)), folder)
        raise OSError(error.errno, f"'{file.name}' is no folder") from error
    for each in missing:
        _sync(each.parent)


def reason(error: Exception) -> str:
    """The operating system's words for what went wrong, such as `No space left on device`."""
    return (error.strerror if isinstance(error, OSError) else "") or str(error) or type(error).__name__


@contextmanager
def scratch(folder: Path, suffix: str = "", *, is_folder: bool = False) -> Iterator[Path]:
    """A new file or folder in `folder` that is gone after the block, unless it was renamed in it.

    It goes also when the block raises, and when SIGTERM or SIGHUP ends the process. What SIGKILL leaves is
    taken away by the next process that comes here.

    Args:
        folder: Where it is made; must be there.
        suffix: The end of its name.
        is_folder: Make a folder, which only this user can enter.
    """
    _take_away_leftovers(folder)
    with tidied_up_when_ended():
        made, lock = _make(folder, suffix if re.fullmatch(r"\.\w{1,16}", suffix) else "", is_folder=is_folder)
        try:
            yield made
        finally:
            os.close(lock)
            with suppress(OSError):
                shutil.rmtree(made, ignore_errors=True) if is_folder else made.unlink()


def _make(folder: Path, suffix: str, *, is_folder: bool) -> tuple[Path, int]:
    """Make what nobody else has, and lock it: its path, and what holds the lock while it is open."""
    while True:
        made = folder / f".circuitkit-{secrets.token_hex(4)}.part{suffix}"
        try:
            if is_folder:
                made.mkdir(mode=0o700)
            else:
                os.close(os.open(made, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except FileExistsError:
            continue
        lock = os.open(os.devnull if sys.platform == "win32" else made, os.O_RDONLY)
        _lock(lock, wait=True)
        if made.exists():  # nobody took it for a left-over before it was locked
            return made, lock
        os.close(lock)


def _lock(opened: int, *, wait: bool) -> bool:
    """Lock an open file; False if another has it, or the file system has no locks."""
    if sys.platform == "win32":
        return False
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True


@cache  # once for each folder: what is left later is left for the next process
def _take_away_leftovers(folder: Path) -> None:
    """Remove what processes left that were killed while they wrote."""
    with suppress(OSError):
        for entry in [each for each in os.scandir(folder) if _SCRATCH.fullmatch(each.name)]:
            with suppress(OSError):
                opened = os.open(entry.path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
                try:
                    if _lock(opened, wait=False):
                        is_folder = entry.is_dir(follow_symlinks=False)
                        shutil.rmtree(entry.path) if is_folder else Path(entry.path).unlink()
                finally:
                    os.close(opened)


def _is_special(path: Path) -> bool:
    """Whether it is a pipe, a device or the like, or a name for an open file."""
    return (path.exists() and not path.is_file()) or str(path.absolute()).startswith(_OPEN_FILES)


def _is_of_the_name(path: Path) -> bool:
    """Whether the system refuses the name itself: a NUL in it, or links that lead back to themselves."""
    try:
        path.resolve()
    except (RuntimeError, ValueError):
        return True
    return False


def _mode_to_keep(target: Path) -> int | None:
    """Permissions of a file that is there; None if there is none.

    Raises:
        PermissionError: It may not be written; renaming would not ask.
    """
    if not target.exists():
        return None
    if not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return target.stat().st_mode & 0o7777


def _sync(path: Path) -> None:
    """Have the system write a file, or the names in a folder, to the disk."""
    if sys.platform == "win32" and path.is_dir():
        return
    try:
        opened = os.open(path, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
    except OSError as error:
        if error.errno not in _NOT_SYNCED:
            raise


def seal(part: Path) -> None:
    """Put the checksum of a file in the place of the `SEAL` that it has somewhere in its own bytes, once.

    So the checksum moves with the file, and renaming one renames both. `verified` reads it.
    """
    content = part.read_bytes()
    place = content.index(SEAL.encode())
    with part.open("r+b") as file:
        file.seek(place)
        file.write(_sealing(content))


def verified(path: Path, remedy: str) -> bytes:
    """The bytes of a file, if they are those that were sealed.

    Args:
        path: The file.
        remedy: What to do about a damaged one, for the message.

    Raises:
        DamagedFileError: A bit of it differs, or it was never sealed.
        InputError: It cannot be read.
    """
    content = read_bytes(path, "what was written here", MOST_TABLE)
    found = _SEALED.findall(content)
    if len(found) != 1 or found[0] != _sealing(content.replace(found[0], SEAL.encode())):
        what = "its bytes are not those that were written" if found else "it has no checksum"
        message = f"'{path}' is damaged: {what}; {remedy}"
        raise DamagedFileError(message)
    return content


def _sealing(content: bytes) -> bytes:
    return f"{_MARK}{hashlib.sha256(content).hexdigest()}".encode()
