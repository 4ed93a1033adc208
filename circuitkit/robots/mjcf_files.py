"""The files of an MJCF: itself and all that it includes or loads, each looked at before MuJoCo opens it.

MuJoCo would wait at a named pipe for ever, and read a device up to the end of the memory.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.reading import MIB, open_file, read_text, resolved

MOST_MJCF, MOST_ASSET = 64 * MIB, 1024 * MIB
_NAMES = re.compile(
    r"""\b(?P<key>file\w*|meshdir|texturedir|assetdir)\s*=\s*(?P<quote>["'])(?P<name>.*?)(?P=quote)"""
)


def require_files(path: Path) -> None:
    """Refuse an MJCF with a file that is no regular file, is too large, or is XML but no printable text.

    Files that are not there are left to MuJoCo, which knows where else it looks.

    Raises:
        InputError: The MJCF cannot be read, or a file that it names; says where it is named.
    """
    text = read_text(path, "the path of an MJCF file", MOST_MJCF)
    done, waiting, folders = {resolved(path)}, [(path, text)], [path.parent]
    while waiting:
        here, text = waiting.pop()
        named = list(_NAMES.finditer(text))
        folders += [path.parent / unescape(each["name"]) for each in named if each["key"].endswith("dir")]
        for match in named:
            for file in _there(unescape(match["name"]), [here.parent, *folders]):
                if resolved(file) in done or match["key"].endswith("dir"):
                    continue
                done.add(resolved(file))
                try:
                    if file.suffix.lower() == ".xml":
                        waiting.append((file, read_text(file, "the path of an MJCF file", MOST_MJCF)))
                    else:
                        open_file(file, "a regular file", MOST_ASSET).close()
                except InputError as error:
                    raise _at(error, here, text, match) from error


def _there(name: str, folders: list[Path]) -> Iterator[Path]:
    """Where a file may be meant: beside the file that names it, or in one of the folders of the model."""
    for file in dict.fromkeys(folder / name for folder in folders if name):
        try:
            if file.exists() and not file.is_dir():
                yield file
        except (OSError, ValueError):
            continue


def _at(error: InputError, file: Path, text: str, match: re.Match[str]) -> InputError:
    """What is wrong with a file, said where it is named, if it has no line of its own."""
    before = text[: match.start("name")]
    line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
    place = (str(file), line, column, match["key"])
    return InputError(*(each if each.is_placed else Problem(*place, each.message) for each in error.problems))
