"""The files of an MJCF as data: itself, all that it includes, attaches and loads, and all that these do."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from circuitkit.robots.mjcf import compile_mjcf, read_mjcf

_FOLDERS = ("meshdir", "texturedir", "assetdir")  # attributes that say where files are looked for
_VERBS = {"include": "includes", "model": "attaches"}  # by the element that names a file
# Of a compiled model: where its files lie, the sizes with those of these paths, and its address.
_OF_PATHS = re.compile("^_|pathadr|^npaths$|^nbuffer$")
_IN_QUOTES = re.compile(r"""=\s*["']([^"']+)["']""")


@dataclass(frozen=True)
class _File:
    """A file that has been read.

    Attributes:
        title: Its path from the MJCF, with who names it.
        content: Its bytes.
        root: Its outermost element; None if it is no XML.
    """

    title: str
    content: bytes
    root: ET.Element | None

    @property
    def data(self) -> Any:  # noqa: ANN401 - plain data
        """What it says: its elements with their attributes, or the checksum of what is no XML."""
        if self.root is None:
            return {"sha256": hashlib.sha256(self.content).hexdigest()}
        return {_step(self.root, 0): _element(self.root)}

    def names(self) -> Iterator[tuple[str, str]]:
        """Whatever may be the name of a file in it, with what it would be done to that file."""
        if self.root is None:
            if self.content.lstrip()[:1] == b"<":  # XML that this reader does not understand
                for found in _IN_QUOTES.findall(self.content.decode("utf-8", "replace")):
                    yield "loads", found
            return
        for element in self.root.iter():
            for key, value in element.attrib.items():
                if key.startswith("file") or "." in value or "/" in value:
                    yield _VERBS.get(element.tag, "loads"), value

    def folders(self) -> Iterator[str]:
        """The folders in which it says that files lie."""
        for element in () if self.root is None else self.root.iter("compiler"):
            yield from (element.attrib[key] for key in _FOLDERS if key in element.attrib)


def mjcf_files(path: Path) -> dict[str, Any]:
    """All files of an MJCF as data, by their paths from its folder and who names them.

    A file is one of them if any attribute names it: so kinds of assets, and configurations of plug-ins, that
    nobody has thought of here are among them, too. Comments, spaces and the spelling of numbers do not count.
    """
    known: dict[Path, _File] = {}
    folders = {""}
    pending = {path.resolve(): (path, path.name)}
    while pending:
        for place, (file, title) in pending.items():
            known[place] = _read(file, title)
            folders.update(known[place].folders())
        pending = {}
        for place, each in known.items():
            for verb, name in each.names():
                for found in _candidates((path.parent, place.parent), folders, name):
                    if found.resolve() not in known:
                        shown = os.path.relpath(found, path.parent)
                        pending.setdefault(found.resolve(), (found, f"{shown}, which {place.name} {verb}"))
    return {each.title: each.data for each in known.values()}


def compiled_sum(path: Path) -> str:
    """Checksum of the model that MuJoCo compiles of an MJCF: equal if all that MuJoCo read is.

    Raises:
        InputError: It cannot be read, or MuJoCo refuses it.
    """
    model = compile_mjcf(read_mjcf(path), path)
    summed = hashlib.sha256()
    for part in (model, model.opt, model.stat):
        for name in sorted(vars(type(part))):
            value = getattr(part, name)
            if isinstance(value, np.ndarray | np.generic | int | float) and not _OF_PATHS.search(name):
                array = np.asarray(value)
                summed.update(f"{name} {array.dtype} {array.shape} ".encode() + array.tobytes())
    summed.update(model.names + model.text_data)
    return summed.hexdigest()


def _read(file: Path, title: str) -> _File:
    content, root = b"", None
    with suppress(OSError):  # MuJoCo says so where it needs the file
        content = file.read_bytes()
    if content.lstrip()[:1] == b"<" or content[:3] == b"\xef\xbb\xbf":
        with suppress(ET.ParseError, ValueError, LookupError):
            root = ET.fromstring(content)
    return _File(title, content, root)


def _candidates(tops: tuple[Path, ...], folders: set[str], name: str) -> Iterator[Path]:
    """The files that a name may stand for; MuJoCo looks beside the file, and where `compiler` says."""
    for top in dict.fromkeys(tops):
        for folder in sorted(folders):
            for inner in dict.fromkeys((name, Path(name).name)):  # the second for `strippath`
                found = top / folder / inner
                with suppress(OSError, ValueError):  # a name that is too long, or has a NUL
                    if inner and found.is_file():
                        yield found


def _element(element: ET.Element) -> dict[str, Any]:
    """The attributes of an element, and the elements in it by tag and name, or number."""
    data: dict[str, Any] = {key: _value(text) for key, text in element.attrib.items()}
    counts: dict[str, int] = {}
    for inner in element:
        if isinstance(inner.tag, str):  # else it is a comment
            number = counts[inner.tag] = counts.get(inner.tag, -1) + 1
            step = _step(inner, number)
            data[step if step not in data else f"{inner.tag}[{number}]"] = _element(inner)
    return data


def _step(element: ET.Element, number: int) -> str:
    return f"{element.tag}[{element.get('name', number)}]"


def _value(text: str) -> str:
    """The text of an attribute, with one space between words and one way to write each number."""
    return " ".join(map(_word, text.split()))


def _word(word: str) -> str:
    try:
        return repr(float(word))
    except ValueError:
        return word
