"""A folder of results holds one run: what the run before left goes, and what others put there is named."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from circuitkit.base.errors import InputError, listing
from circuitkit.base.files import OutputError, alone_in, noting_what_is_written, write_text
from circuitkit.base.reading import checksum_of, read_bytes, resolved

MANIFEST = "files.json"
_LOG = logging.getLogger("circuitkit")


@contextmanager
def one_run(
    folder: Path | None, *, resumed: bool = False, own: Collection[str] = (), deep: bool = True
) -> Iterator[None]:
    """Have a folder hold what is written to it in the block, and nothing of an earlier run.

    The files of each run are in `files.json`, with their checksums. With the first file that is written now,
    those of the run before are removed, unless somebody has changed them. What else lies there stays, and a
    warning names it. Two runs at once would leave files of both, so the second one is refused.

    Args:
        folder: The folder; None if nothing is written.
        resumed: Whether the run goes on that wrote what is there.
        own: Names in the folder of which the run itself knows whether they are of it; they are not listed.
        deep: Whether what is written to folders in it belongs to the run.

    Raises:
        OutputError: Another run has the folder, it cannot be made, or the list of its files cannot be one.
    """
    if folder is None:
        yield
        return
    with alone_in(folder):
        yield from _one_run(folder, resumed=resumed, own=own, deep=deep)


def _one_run(folder: Path, *, resumed: bool, own: Collection[str], deep: bool) -> Iterator[None]:
    place = resolved(folder)
    manifest = str(place / MANIFEST)
    if os.path.exists(manifest) and not os.path.isfile(manifest):  # noqa: PTH110, PTH113 - any name will do
        message = (
            f"cannot write '{folder / MANIFEST}': it is no regular file; take it away, or name another folder"
        )
        raise OutputError(message)
    old = _listed(place)
    written: set[str] = set(old) if resumed else set()
    began = False

    def note(path: Path) -> None:
        nonlocal began
        if not path.is_relative_to(place) or not (deep or path.parent == place):
            return
        name = path.relative_to(place).as_posix()
        if not is_own(name):
            written.add(name)
        if not began:
            began = True
            _remove(place, {name: sum_ for name, sum_ in old.items() if name not in written})

    def is_own(name: str) -> bool:
        return name.partition("/")[0] in own

    try:
        with noting_what_is_written(note):
            yield
    finally:
        if began:
            files = {name: checksum for name in sorted(written) if (checksum := _checksum(place / name))}
            _list(place, files)
            ours = {MANIFEST, *own, *(name.partition("/")[0] for name in files)}
            if others := _others(place, ours, deep=deep):
                _LOG.warning("'%s' also holds what this run did not write: %s", folder, listing(others))


def _listed(place: Path) -> Mapping[str, str]:
    """The files of the run before and their checksums; none if nobody says."""
    try:
        files = json.loads(read_bytes(place / MANIFEST, "the files of a run"))["files"]
        return {str(name): str(checksum) for name, checksum in files.items()}
    except (InputError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _list(place: Path, files: Mapping[str, str]) -> None:
    if files:
        text = json.dumps({"format": 1, "files": files}, indent=1, ensure_ascii=False)
        write_text(place / MANIFEST, text + "\n")
    else:
        (place / MANIFEST).unlink(missing_ok=True)


def _remove(place: Path, files: Mapping[str, str]) -> None:
    """Remove files that are as they were written, and folders that are empty then."""
    for name, checksum in files.items():
        path = place / name
        if path.resolve() == path and path.is_relative_to(place) and _checksum(path) == checksum != "":
            with suppress(OSError):
                path.unlink()
                for above in path.relative_to(place).parents[:-1]:
                    (place / above).rmdir()


def _checksum(path: Path) -> str:
    """SHA-256 of a regular file; empty if there is none."""
    try:
        return checksum_of(path, "a file of a run")
    except InputError:
        return ""


def _others(place: Path, ours: Collection[str], *, deep: bool) -> list[str]:
    found = (each for each in place.iterdir() if each.name not in ours and not each.name.startswith("."))
    return sorted(each.name for each in found if deep or each.is_file())
