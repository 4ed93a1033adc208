"""Reads the cases, and makes more of them: typos in every name of the shipped circuits. See README.md."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

HERE = Path(__file__).parent
CIRCUIT = "circuit.yaml"


@dataclass(frozen=True)
class Case:
    """A mistake.

    Attributes:
        title: What the author did, and the file of the case.
        files: Text of every file, by name.
        file: The file to which the complaint must point.
        line: Its line, from 1.
        column: Its column, from 1.
        typo_of: The name that was meant; empty if it is no typo.
        says: Words of the complaint.
        warning: Whether it is only doubtful.
    """

    title: str
    files: dict[str, str]
    file: str
    line: int
    column: int
    typo_of: str = ""
    says: str = ""
    warning: bool = False


def written_cases() -> list[Case]:
    """The cases of the text files beside this one."""
    return [case for file in sorted(HERE.glob("*.txt")) for case in _cases_of(file)]


def _cases_of(file: Path) -> Iterator[Case]:
    head, *bodies = file.read_text(encoding="utf-8").split("\n== ")
    folder = HERE / "bases" / head.removeprefix("base: ").split("\n")[0]
    base = {str(each.relative_to(folder)): each.read_text("utf-8") for each in folder.rglob("*.*")}
    for body in bodies:
        title, *lines = body.replace("→", "\t").replace("⍽", "\u00a0").rstrip("\n").split("\n")
        yield _case(f"{file.stem}: {title}", base, lines)


def _case(title: str, base: dict[str, str], lines: list[str]) -> Case:
    fields: dict[str, str] = {}
    blocks: list[tuple[str, list[str]]] = [(CIRCUIT, [])]
    for line in filter(None, lines):
        if line[:2] in {"  ", "- ", "+ ", "? "} or line in "-+":
            blocks[-1][1].append(line)
        elif line.startswith("file: "):
            blocks.append((line.removeprefix("file: "), []))
        else:
            key, _, value = line.partition(": ")
            fields[key] = value
    unknown = fields.keys() - {"typo of", "says", "warning"}
    assert not unknown, f"{title}: unknown lines {unknown}"
    files, place = dict(base), None
    for name, block in blocks:
        if block:
            place = _apply(files, name, block, title) or place
    assert place is not None, f"{title}: no ^"
    return Case(title, files, *place, fields.get("typo of", ""), fields.get("says", ""), "warning" in fields)


def _apply(files: dict[str, str], name: str, block: list[str], title: str) -> tuple[str, int, int] | None:
    """Change one file as a block says; the place of its ^, if there is one."""
    old = "".join(f"{line[2:]}\n" for line in block if line[0] in " -")
    new = [line for line in block if line[0] in " +?"]
    text = files.get(name, "")
    assert text.count(old) == 1 if name in files else not old, f"{title}: the base has not just one:\n{old}"
    before = text[: text.index(old)]
    files[name] = text.replace(old, "".join(f"{line[2:]}\n" for line in new if line[0] != "?"), 1)
    written = before.count("\n")
    for line in new:
        if line[0] == "?":
            return name, written, line.index("^") - 1
        written += 1
    return None


def typos_of_names(text: str, seed: int) -> Iterator[tuple[str, int, int, str]]:
    """A text with a typo in one of its keys or references, for every one of them.

    Args:
        text: A valid circuit file without includes.
        seed: Seed of the mistakes.

    Yields:
        The spoilt text, line and column of the spoilt name, and what it was.
    """
    generator = random.Random(seed)
    scalars = list(_scalars(yaml.compose(text, yaml.CSafeLoader), ()))
    names = {node.value for node, _ in scalars}
    for node, place in scalars:
        name, start, stop = node.value, node.start_mark.index, node.end_mark.index
        spoilt = _misspelt(name, names, generator)
        if spoilt and _is_reference(place) and text[start:stop] == name:
            line, column = node.start_mark.line + 1, node.start_mark.column + 1
            yield text[:start] + spoilt + text[stop:], line, column, name


def _scalars(node: yaml.Node, place: tuple[str, ...]) -> Iterator[tuple[yaml.ScalarNode, tuple[str, ...]]]:
    """All scalars with their places; that of a key ends in `key`."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            yield key, (*place, "key")
            yield from _scalars(value, (*place, key.value))
    elif isinstance(node, yaml.SequenceNode):
        for each in node.value:
            yield from _scalars(each, (*place, "-"))
    else:
        yield node, place


_TEXTS = {"circuit", "description", "unit", "file", "as"}
_DECLARING = {"parameters", "inputs", "neurons", "outputs", "populations"}
_EQUATIONS = {"neuron_models", "synapse_models"}


def _is_reference(place: tuple[str, ...]) -> bool:
    """Whether a scalar names something that is declared elsewhere, or is a key of the language."""
    declares = len(place) == 2 and place[0] in _DECLARING and place[-1] == "key"
    return not declares and place[0] not in _EQUATIONS and place[-1] not in _TEXTS


def _misspelt(name: str, names: set[str], generator: random.Random) -> str:
    """A slip of the fingers that gives no other name of the text; empty if there is none."""
    if len(name) < _SHORTEST or not name.isidentifier():
        return ""
    slips = sorted(set(_slips(name)) - names)
    return generator.choice([slip for slip in slips if slip.isidentifier()])


def _slips(name: str) -> Iterator[str]:
    for at, letter in enumerate(name):
        before, after = name[:at], name[at + 1 :]
        yield before + letter + letter + after
        yield before + after
        yield before + after[:1] + letter + after[1:]
        yield from (before + other + after for other in _BESIDE.get(letter, ""))


_SHORTEST = 3  # of two letters, one wrong one leaves too little to guess from
_KEYS = ("qwertyuiop", "asdfghjkl", "zxcvbnm")
_BESIDE = {
    row[at]: row[max(at - 1, 0) : at] + row[at + 1 : at + 2] for row in _KEYS for at in range(len(row))
}
