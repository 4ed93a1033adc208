"""The files a circuit is made of: the circuit file and those it includes, each as far as it can be read.

What is wrong in one place must not hide what is wrong in another. So a file with complaints is cut down to
what is sound, and remembers which names it lost, so that nobody complains about these a second time.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from circuitkit.circuit.spec import CircuitSpec, FileSpec
from circuitkit.errors import Problem, suggest
from circuitkit.source import Data, Document, Finding, Place, model_problems, scan_yaml

NAMED_SECTIONS = ("parameters", "inputs", "neurons", "outputs")


@dataclass(frozen=True)
class Part:
    """One file of a circuit.

    Attributes:
        document: The text's data and marks.
        spec: What is sound of it.
        synapse_numbers: For every synapse of `spec`, its number in the document.
        lost: Names that are declared, but not soundly.
        lost_sections: Whether so much is unsound that any name may be missing.
    """

    document: Document
    spec: FileSpec
    synapse_numbers: tuple[int, ...]
    lost: frozenset[str] = frozenset()
    lost_sections: bool = False


def part_of(spec: CircuitSpec) -> Part:
    """The part of a whole spec: with line and column if it came from a file, or is a copy of one that did."""
    document = spec.parts[-1].document if spec.parts else Document("", None, {})
    return Part(document, spec, tuple(range(len(spec.synapses))))


def read_parts(document: Document) -> tuple[tuple[Part, ...], list[Problem]]:
    """Read a circuit file and all that it includes, also through others.

    Args:
        document: The circuit file.

    Returns:
        The parts, included ones first and the circuit file last, and everything wrong with their form.
    """
    reader = _Reader([], [], set())
    reader.add(document, CircuitSpec, ())
    return tuple(reader.parts), reader.problems


@dataclass(frozen=True)
class _Reader:
    parts: list[Part]
    problems: list[Problem]
    done: set[Path]

    def add(self, document: Document, model: type[FileSpec], including: tuple[Path, ...]) -> None:
        """Add a document after those that it includes."""
        here = Path(document.path).resolve()
        self.done.add(here)
        findings = model_problems(document, model, document.data)[1]
        self.problems.extend(finding.problem for finding in findings)
        part = _sound_part(document, findings)
        lost = part.lost_sections
        for number, name in enumerate(part.spec.include):
            lost |= not self.include(document, ("include", number), name, (*including, here))
        self.parts.append(Part(document, part.spec, part.synapse_numbers, part.lost, lost))

    def include(self, document: Document, place: Place, name: str, including: tuple[Path, ...]) -> bool:
        """Add an included file, and say whether it could be read."""
        path = Path(document.path).parent / name
        if path.resolve() in including:
            start = including.index(path.resolve())
            circle = " -> ".join(each.name for each in (*including[start:], path))
            message = f"found a circle of includes: {circle}; allowed: includes that end"
            self.problems.append(document.problem(place, message))
            return True
        if path.resolve() in self.done:
            return True
        if not path.exists():
            hint = suggest(path.name, sorted(sibling.name for sibling in path.parent.glob("*.y*ml")))
            message = f"found '{name}', but there is no file '{path}'; allowed: a path from here"
            self.problems.append(document.problem(place, message, hint))
            return False
        included, problems = scan_yaml(path)
        self.problems.extend(problems)
        if included is not None:
            self.add(included, FileSpec, including)
        return included is not None


def _sound_part(document: Document, findings: Iterable[Finding]) -> Part:
    """What is left of a file without the parts that are complained about."""
    data = document.data
    if not isinstance(data, dict):
        return Part(document, FileSpec(), (), lost_sections=True)
    sound: dict[str, Data] = json.loads(json.dumps(data))  # a copy to take things out of
    lost: set[str] = set()
    bad_synapses: set[int] = set()
    lost_sections = False
    for finding in sorted(findings, key=lambda each: each.kind != "extra_forbidden"):
        section, *inner = finding.place
        if finding.kind == "extra_forbidden":
            _without(sound, finding.place)
        elif section in NAMED_SECTIONS and inner:
            lost.add(str(inner[0]))
            _without(sound, (section, inner[0]))
        elif section == "synapses" and inner:
            bad_synapses.add(int(inner[0]))
        else:
            sound.pop(str(section), None)
            lost_sections |= section in {*NAMED_SECTIONS, "include"}
    numbers: tuple[int, ...] = ()
    if isinstance(synapses := sound.get("synapses"), list):
        numbers = tuple(number for number in range(len(synapses)) if number not in bad_synapses)
        sound["synapses"] = [synapses[number] for number in numbers]
    spec, rest = model_problems(document, FileSpec, sound)
    if spec is None or rest:
        return Part(document, FileSpec(), (), frozenset(lost), lost_sections=True)
    return Part(document, spec, numbers, frozenset(lost), lost_sections)


def _without(data: Data, place: Place) -> None:
    """Remove an entry of nested mappings and lists."""
    for part in place[:-1]:
        data = data[part] if isinstance(data, dict | list) else None  # type: ignore[index]
    if isinstance(data, dict):
        data.pop(str(place[-1]), None)
