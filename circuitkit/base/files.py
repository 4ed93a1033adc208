"""Writing results: a file is either whole or not there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from circuitkit.base.errors import CircuitkitError


class OutputError(CircuitkitError):
    """A result cannot be written; the message names the file and the reason."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, which takes the place of `path` once it is written.

    Folders that are missing are made. If the body raises, an older file at `path` stays as it was and the
    temporary one is removed. What is no regular file, such as `/dev/stdout`, is written directly.

    Args:
        path: The file to write.

    Yields:
        The name to write to; it has the suffix of `path`, by which many writers choose the format.

    Raises:
        OutputError: The file cannot be written: a folder of that name, no permission, a full disk.
    """
    target = path.resolve()
    if target.is_dir():
        message = f"cannot write '{path}': it is a folder; name a file in it"
        raise OutputError(message)
    direct = target.exists() and not target.is_file()
    part = target if direct else target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        _make_folder(target.parent)
        yield part
        if not direct:
            part.replace(target)
    except OSError as error:
        message = f"cannot write '{path}': {reason(error)}"
        raise OutputError(message) from error
    finally:
        if not direct:
            with suppress(OSError):
                part.unlink()


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        file = next((each for each in (folder, *folder.parents) if each.exists()), folder)
        raise OSError(error.errno, f"'{file.name}' is no folder") from error


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 as `replacing` does.

    Raises:
        OutputError: The file cannot be written.
    """
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def reason(error: OSError) -> str:
    """The operating system's words for what went wrong, such as `No space left on device`."""
    return error.strerror or str(error) or type(error).__name__
