"""The files of an MJCF: itself, all that it includes, attaches and loads, and all that these do.

Each is looked at before MuJoCo opens it, which would wait at a named pipe for ever, and read a device up to
the end of the memory.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from html import unescape
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.reading import MIB, decoded, open_file, read_bytes, require_printable, resolved

MOST_MJCF, MOST_ASSET = 64 * MIB, 1024 * MIB
_FOLDERS = ("meshdir", "texturedir", "assetdir")  # attributes that say where files are looked for
_VERBS = {"include": "includes", "model": "attaches"}  # by the element that names a file
_XML = re.compile(rb"(\xef\xbb\xbf)?\s*<")
_HEAD = 64  # bytes that show whether it is XML
# Values are looked into, too, so that no quotation mark in a text hides what follows it.
_ATTRIBUTE = re.compile(r"""(?P<key>[\w:.-]+)\s*=\s*(?P<quote>["'])(?=(?P<value>.*?)(?P=quote))""", re.DOTALL)


class Attribute(NamedTuple):
    """An attribute of an element, which may name a file."""

    tag: str
    key: str
    value: str

    @property
    def is_of_file(self) -> bool:
        """Whether MuJoCo takes it for the name of a file; configurations of plug-ins may be others."""
        return self.key.startswith("file")


@dataclass(frozen=True)
class MjcfFile:
    """A file that an MJCF consists of.

    Attributes:
        path: Where it lies.
        content: Its bytes if it is XML; nothing else is read.
        error: Why it cannot be opened; None if it can.
        named_by: The file that names it, and the attribute; None for the MJCF itself.
    """

    path: Path
    content: bytes
    error: InputError | None
    named_by: tuple[MjcfFile, Attribute] | None

    @cached_property
    def root(self) -> ET.Element | None:
        """Its outermost element; None if it is no XML that can be understood."""
        with suppress(ET.ParseError, ValueError, LookupError):
            return ET.fromstring(self.content)
        return None

    @cached_property
    def attributes(self) -> tuple[Attribute, ...]:
        """Those that may be of files; of XML that is not understood, whatever may be an attribute."""
        if self.root is not None:
            every = (
                Attribute(e.tag, key, value) for e in self.root.iter() for key, value in e.attrib.items()
            )
        else:
            found = _ATTRIBUTE.finditer(self.content.decode("utf-8-sig", "replace"))
            every = (Attribute("", match["key"], unescape(match["value"])) for match in found)
        return tuple(
            dict.fromkeys(
                each
                for each in every
                if each.is_of_file or each.key in _FOLDERS or "." in each.value or "/" in each.value
            )
        )

    def title(self, top: Path) -> str:
        """Its path from a folder, with who names it."""
        if self.named_by is None:
            return self.path.name
        by, attribute = self.named_by
        verb = _VERBS.get(attribute.tag, "loads")
        return f"{os.path.relpath(self.path, top)}, which {by.path.name} {verb}"

    def place_of(self, attribute: Attribute) -> tuple[int, int]:
        """The line and the column of an attribute's value."""
        text = self.content.decode("utf-8-sig", "replace")
        for match in _ATTRIBUTE.finditer(text):
            if match["key"] == attribute.key and unescape(match["value"]) == attribute.value:
                before = text[: match.start("value")]
                return before.count("\n") + 1, len(before) - before.rfind("\n")
        return 1, 1


def files_of(path: Path) -> list[MjcfFile]:
    """All files of an MJCF, itself first: a file is one of them if any attribute names it.

    So kinds of assets, and configurations of plug-ins, that nobody has thought of here are among them, too.
    Files that are not there are left to MuJoCo, which knows where else it looks.
    """
    new = [_file(path, None)]
    known = {resolved(path): new[0]}
    folders = {""}
    while new:
        told = {each.value for file in new for each in file.attributes if each.key in _FOLDERS}
        asked = list(known.values()) if told - folders else new
        folders |= told
        new = []
        for file in asked:
            for attribute in file.attributes:
                for found in _there((path.parent, file.path.parent), folders, attribute):
                    place = resolved(found)
                    if place not in known:
                        known[place] = _file(found, (file, attribute))
                        new.append(known[place])
    return list(known.values())


def require_files(path: Path) -> None:
    """Refuse an MJCF with a file that is no regular file, is too large, or is XML but no printable text.

    Raises:
        InputError: The MJCF cannot be read, or a file that it names; says where it is named.
    """
    for each in files_of(path):
        try:
            if each.error is not None:
                raise each.error
            if each.named_by is None or each.path.suffix.lower() == ".xml":
                require_printable(decoded(each.content, str(each.path)), str(each.path))
        except InputError as error:
            if each.named_by is None:
                raise
            by, attribute = each.named_by
            if attribute.is_of_file:
                place = (str(by.path), *by.place_of(attribute), attribute.key)
                raise InputError(
                    *(one if one.is_placed else Problem(*place, one.message) for one in error.problems)
                ) from error


def _file(path: Path, named_by: tuple[MjcfFile, Attribute] | None) -> MjcfFile:
    """Look at a file, and read it if it is XML."""
    try:
        is_xml = named_by is None or path.suffix.lower() == ".xml"
        if not is_xml:
            with open_file(path, "a regular file", MOST_ASSET) as file, suppress(OSError):
                is_xml = _XML.match(file.read(_HEAD)) is not None
        content = read_bytes(path, "the path of an MJCF file", MOST_MJCF) if is_xml else b""
    except InputError as error:
        return MjcfFile(path, b"", error, named_by)
    return MjcfFile(path, content, None, named_by)


def _there(tops: tuple[Path, ...], folders: set[str], attribute: Attribute) -> Iterator[Path]:
    """What an attribute may stand for; MuJoCo looks beside the file, and where `compiler` says."""
    if attribute.key in _FOLDERS:
        return
    inner = dict.fromkeys((attribute.value, os.path.basename(attribute.value)))  # noqa: PTH119 - `strippath`
    for top in dict.fromkeys(tops):
        for folder in sorted(folders):
            for name in filter(None, inner):
                found = os.path.join(top, folder, name)  # noqa: PTH118 - of thousands of numbers, too
                with suppress(OSError, ValueError):  # a name that is too long, or has a NUL
                    if os.path.exists(found) and not os.path.isdir(found):  # noqa: PTH110, PTH112
                        yield Path(found)
