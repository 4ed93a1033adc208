"""The normal form of a circuit file: order, spacing and spelling made alike, comments and meaning kept.

Sections and keys stand in the order of the language, quantities are spelt `-80 mm`, lines are at most 110
characters wide. Names keep their order, which may count. The text is refused rather than changed in meaning.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from circuitkit.base.errors import CircuitkitError, InputError, UnitError
from circuitkit.base.files import write_text
from circuitkit.base.reading import read_text
from circuitkit.base.source import (
    Data,
    find_data_file,
    keys_of,
    model_problems,
    parse_yaml,
    scan_text,
)
from circuitkit.base.source.commented import Collection, CommentedText, Entry, Scalar, read_commented
from circuitkit.base.source.rewriting import write_commented
from circuitkit.base.source.validation import model_at
from circuitkit.base.units import DIMENSIONLESS, parse_quantity
from circuitkit.circuit.authoring.difference import compare_circuits
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.circuit.load import parse_circuit
from circuitkit.circuit.models import NEURON_MODEL_NAMES, neuron_model
from circuitkit.circuit.parts import FOLDER
from circuitkit.circuit.spec import CircuitSpec, FileSpec

WIDTH = 110
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_SECTIONS = tuple(FileSpec.model_fields)
_NAMED = frozenset(("parameters", "inputs", "neurons", "outputs", "populations"))
_LISTED = frozenset(("synapses", "projections"))
_MODELS = frozenset(("neuron_models", "synapse_models"))
_LAST = ("initial", "noise", "description")  # of an entry, behind its model's parameters
_TEXTS = frozenset(
    ("description", "source", "unit", "name", "model", "role", "from", "to", "file", "as", "gate")
)


class FormatError(CircuitkitError):
    """The normal form would not mean the same; this is a defect of circuitkit, not of the file."""


@dataclass(frozen=True)
class Formatted:
    """A circuit file and its normal form.

    Attributes:
        path: The file.
        before: Its text.
        after: The text of its normal form.
    """

    path: Path
    before: str
    after: str

    @property
    def changes(self) -> bool:
        """Whether the file is in another form."""
        return self.before != self.after

    def patch(self) -> Iterator[str]:
        """Find what changes, as lines of a unified diff; none if nothing changes."""
        before, after = (text.splitlines(keepends=True) for text in (self.before, self.after))
        return difflib.unified_diff(before, after, str(self.path), f"{self.path} (normal form)")

    def write(self) -> None:
        """Put the normal form into the file, which keeps its permissions; nothing is done if it is there.

        Raises:
            OutputError: The file cannot be written.
        """
        if not self.changes:
            return
        write_text(self.path, self.after)


def format_file(path_or_name: str | Path) -> Formatted:
    """Return the normal form of a circuit file; the file itself stays as it is.

    Args:
        path_or_name: A path, or the name of a shipped circuit.

    Raises:
        InputError: With every error of the file.
    """
    path = find_data_file(path_or_name, FOLDER)
    before = read_text(path, "a YAML file")
    return Formatted(path, before, format_text(before, str(path)))


def format_text(text: str, path: str = "<text>") -> str:
    """Return the normal form of the text of a circuit file, or of a file for others to include.

    Args:
        text: The text.
        path: What stands in messages; includes start from its folder.

    Raises:
        InputError: With every error of the text.
    """
    data, graph = _read(text, path)
    tree = read_commented(text)
    _Orderer(data).order(tree)
    result = write_commented(tree, WIDTH)
    if result != text and not _means_the_same(result, tree, data, graph, path):
        message = (
            f"{path}: the normal form would not mean the same, so the file is left as it is; please report"
        )
        raise FormatError(message)
    return result


def _read(text: str, path: str) -> tuple[dict[str, Data], CircuitGraph | None]:
    """Read the data of a text, and its circuit; a text without a name is for others to include."""
    document, problems = scan_text(text, path)
    if document is None or problems:
        raise InputError(*problems)
    data = document.data
    if isinstance(data, dict) and "circuit" in data:
        return data, parse_circuit(text, path)
    model = FileSpec if isinstance(data, dict) else CircuitSpec
    findings = model_problems(document, model, data)[1]
    if findings or not isinstance(data, dict):
        raise InputError(*(finding.problem for finding in findings))
    return data, None


class _Orderer:
    """Brings the entries of a tree into their order and spelling."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data

    def order(self, tree: CommentedText) -> None:
        """Order a whole file."""
        tree.top.flow = False
        if not tree.has_aliases:
            _sort(tree.top, _SECTIONS)
        for number, section in enumerate(tree.top.entries):
            value, name = section.value, section.name
            is_block = isinstance(value, Collection) and name in _NAMED | _LISTED | _MODELS
            _respace(section, first=number == 0, apart=is_block)
            if not isinstance(value, Collection):
                self._spell(section)
                continue
            value.flow = value.flow and not is_block
            for entry in value.entries if is_block else ():
                self._entry(name, entry, sort=not tree.has_aliases)
            if name not in _MODELS:
                for entry in _below(value):
                    self._spell(entry)

    def _entry(self, section: str, entry: Entry, *, sort: bool) -> None:
        """Order the keys of an input, a neuron and so on."""
        if not (sort and isinstance(entry.value, Collection) and entry.value.is_mapping):
            return
        if section in _MODELS:
            for inner in entry.value.entries:
                if inner.name in {"parameters", "states"} and isinstance(inner.value, Collection):
                    for each in inner.value.entries:
                        if isinstance(each.value, Collection):
                            _sort(each.value, ("unit", "default", "initial", "description"))
            return
        place = (section, 0) if section in _LISTED else (section, entry.name)
        model = model_at(FileSpec, place)
        keys = keys_of(model) if model else ()
        own = [key for key in keys if key not in _LAST]
        _sort(entry.value, (*own, *self._parameters(section, entry.value), *_LAST))

    def _parameters(self, section: str, entry: Collection) -> Sequence[str]:
        """Return the keys that belong to the model, in its order; as written if the model is unknown here."""
        written = [each.name for each in entry.entries]
        model = next((each.value for each in entry.entries if each.name == "model"), None)
        name = model.value if isinstance(model, Scalar) else ""
        own = self.data.get("neuron_models" if section in {"neurons", "populations"} else "synapse_models")
        if isinstance(own, dict) and isinstance(own.get(name), dict):
            return tuple(own[name].get("parameters") or ())
        return neuron_model(name).parameter_names if name in NEURON_MODEL_NAMES else written

    def _spell(self, entry: Entry) -> None:
        """Spell a quantity in the usual way."""
        value = entry.value
        if isinstance(value, Scalar) and entry.name not in _TEXTS and len(value.lines) == 1:
            text = value.lines[0]
            quote = text[:1] if text[:1] in {"'", '"'} else ""
            value.lines = (f"{quote}{normal_quantity(value.value)}{quote}",) if value.value else value.lines


def normal_quantity(text: str) -> str:
    """Give a quantity as one writes it: `-80mm` is `-80 mm`, `100/m` is `100 /m`; any other text as it is."""
    try:
        unit = parse_quantity(text).unit
    except UnitError:
        return text
    number = _NUMBER.match(text.strip().replace("\N{MINUS SIGN}", "-"))
    if unit == DIMENSIONLESS or number is None:
        return text
    symbol = unit.symbol.removeprefix("1") if unit.symbol.startswith("1/") else unit.symbol
    return f"{number[0]} {symbol}"


def _respace(section: Entry, *, first: bool, apart: bool) -> None:
    """Put one empty line above every section, none above the first line; leave single values."""
    if apart:
        section.above.insert(0, "")
    while first and section.above and not section.above[0]:
        del section.above[0]


def _sort(node: Collection, order: Sequence[str]) -> None:
    """Sort entries; what the order does not name stays at its neighbour."""
    rank = {name: number for number, name in reversed(list(enumerate(order)))}
    last = -1
    ranks: dict[str, int] = {}
    for entry in node.entries:
        last = ranks[entry.name] = rank.get(entry.name, last)
    node.entries.sort(key=lambda entry: ranks[entry.name])


def _below(node: Collection) -> Iterator[Entry]:
    """Yield all entries of a list or mapping, with those inside of them."""
    for entry in node.entries:
        yield entry
        if isinstance(entry.value, Collection):
            yield from _below(entry.value)


def _means_the_same(
    after: str, tree: CommentedText, data: Data, graph: CircuitGraph | None, path: str
) -> bool:
    """Check whether a new text has the data, the comments and the circuit of the old one."""
    comments = read_commented(after).comments
    if sorted(comments) != sorted(tree.comments) or not _alike(data, parse_yaml(after, path).data):
        return False
    return graph is None or not compare_circuits(graph, parse_circuit(after, path))


def _alike(one: Data, other: Data) -> bool:
    """Check whether data is the same but for the order of keys and the spelling of quantities."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(each, other[key]) for key, each in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, str) and isinstance(other, str):
        return one == other or normal_quantity(one) == normal_quantity(other)
    return one == other and type(one) is type(other)
