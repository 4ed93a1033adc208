"""What an MJCF is as data: what its files say, and a checksum of what MuJoCo compiles of them."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from circuitkit.base.errors import InputError
from circuitkit.base.reading import checksum_of
from circuitkit.robots.mjcf import compile_mjcf, read_mjcf
from circuitkit.robots.mjcf_files import MOST_ASSET, MjcfFile, files_of

# Of a compiled model: where its files lie, the sizes with those of these paths, and its address.
_OF_PATHS = re.compile("^_|pathadr|^npaths$|^nbuffer$")


def mjcf_files(path: Path) -> dict[str, Any]:
    """All files of an MJCF as data, by their paths from its folder and who names them.

    Comments, spaces and the spelling of numbers do not count.
    """
    return {each.title(path.parent): _data(each) for each in files_of(path) if each.error is None}


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


def _data(file: MjcfFile) -> Any:  # noqa: ANN401 - plain data
    """What a file says: its elements with their attributes, or the checksum of what is no XML."""
    if file.root is not None:
        return {_step(file.root, 0): _element(file.root)}
    try:
        return {"sha256": checksum_of(file.path, "a regular file", MOST_ASSET)}
    except InputError:
        return {}  # MuJoCo says so where it needs the file


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
