"""The files a circuit is made of: the circuit file and those it includes, each as far as it can be read.

What is wrong in one place must not hide what is wrong in another. So a file with complaints is cut down to
what is sound, and remembers which names it lost, so that nobody complains about these a second time.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from circuitkit.base.errors import Problem, suggest
from circuitkit.base.reading import is_file, resolved
from circuitkit.base.source import (
    Data,
    Document,
    Finding,
    Place,
    model_problems,
    scan_yaml,
    shipped_file,
    shipped_names,
)
from circuitkit.base.source.validation import OTHER_KIND
from circuitkit.circuit.spec import CircuitSpec, FileSpec, InstanceSpec

FOLDER = "circuits"

NAMED_SECTIONS = (
    "parameters",
    "inputs",
    "neurons",
    "populations",
    "outputs",
    "neuron_models",
    "synapse_models",
)
LISTED_SECTIONS = ("synapses", "projections")
_MOST_INSTANCES = 2_000


@dataclass(frozen=True)
class Part:
    """One file of a circuit.

    Attributes:
        document: The text's data and marks.
        spec: What is sound of it.
        numbers: For every synapse and projection of `spec`, its number in the document, where they differ.
        lost: Names that are declared, but not soundly.
        lost_sections: Whether so much is unsound that any name may be missing.
        within: Which instance it stands for, in words for messages; empty outside instances.
    """

    document: Document
    spec: FileSpec
    numbers: dict[str, tuple[int, ...]] = field(default_factory=dict)
    lost: frozenset[str] = frozenset()
    lost_sections: bool = False
    within: str = ""


@dataclass(frozen=True)
class Instance:
    """A circuit inside another one.

    Attributes:
        spec: The entry that includes it.
        part: The file with the entry.
        number: Which entry of `include` it is.
        module: What is inside.
    """

    spec: InstanceSpec
    part: Part
    number: int
    module: Module


@dataclass(frozen=True)
class Module:
    """Files that share one set of names.

    Attributes:
        parts: The files; included ones first, the one that gave the module its name last.
        instances: The circuits inside, in order.
        lost_instances: Names of instances whose files cannot be read.
    """

    parts: tuple[Part, ...]
    instances: tuple[Instance, ...] = ()
    lost_instances: frozenset[str] = frozenset()

    @property
    def spec(self) -> CircuitSpec:
        """The circuit file in its own terms.

        Raises:
            TypeError: The module stands for no whole circuit: its file is unsound, or made to be included.
        """
        spec = self.parts[-1].spec
        if not isinstance(spec, CircuitSpec):
            message = "these files are no whole circuit"
            raise TypeError(message)
        return spec

    @property
    def parameter_names(self) -> frozenset[str]:
        """The names of the parameters that the files declare, without those inside of instances."""
        return frozenset(name for part in self.parts for name in part.spec.parameters)


def read_module(document: Document) -> tuple[Module, list[Problem]]:
    """Read a circuit file and all that it includes, also through others.

    Args:
        document: The circuit file.

    Returns:
        What the files declare, and everything wrong with the form of the files.
    """
    reader = _Reader()
    return reader.module(document, CircuitSpec, (), ""), reader.problems


@dataclass
class _Reader:
    problems: list[Problem] = field(default_factory=list)
    files: dict[Path, Part | None] = field(default_factory=dict)
    instances: int = 0

    def module(
        self, document: Document, model: type[FileSpec], including: tuple[Path, ...], within: str
    ) -> Module:
        """Return the files that share their names with a document, and the instances in them."""
        gathering = _Gathering(within)
        self.add(gathering, self.part(document, model), including)
        return Module(tuple(gathering.parts), tuple(gathering.instances), frozenset(gathering.lost_instances))

    def part(self, document: Document, model: type[FileSpec]) -> Part:
        """Find what is sound of a document; complains about the rest."""
        spec, findings = model_problems(document, model, document.data)
        if spec is not None:
            return Part(document, spec)
        self.problems.extend(finding.problem for finding in findings)
        return _sound_part(document, findings)

    def add(self, gathering: _Gathering, part: Part, including: tuple[Path, ...]) -> None:
        """Add a file after those that it includes."""
        here = resolved(Path(part.document.path))
        gathering.done.add(here)
        if gathering.within:
            part = replace(part, within=gathering.within)
        lost = part.lost_sections
        for number, entry in enumerate(part.spec.include):
            place: Place = ("include", number) if isinstance(entry, str) else ("include", number, "file")
            name = entry if isinstance(entry, str) else entry.file
            path = _included_path(part.document, name)
            if self.is_circle(part, place, path, (*including, here)):
                lost = lost or isinstance(entry, str)
            elif isinstance(entry, InstanceSpec):
                self.add_instance(gathering, Instance(entry, part, number, Module(())), (*including, here))
            elif resolved(path) not in gathering.done:
                included = self.read(part, place, name)
                lost |= included is None
                if included is not None:
                    self.add(gathering, included, (*including, here))
        gathering.parts.append(replace(part, lost_sections=lost) if lost else part)

    def add_instance(self, gathering: _Gathering, instance: Instance, including: tuple[Path, ...]) -> None:
        """Add a circuit inside the one that is being read."""
        entry, part, place = instance.spec, instance.part, ("include", instance.number)
        self.instances += 1
        if self.instances > _MOST_INSTANCES:
            if self.instances == _MOST_INSTANCES + 1:
                message = f"found more than {_MOST_INSTANCES} instances in all; allowed: fewer"
                self.problems.append(part.document.problem(place, message))
            gathering.lost_instances.add(entry.name)
            return
        included = self.read(part, (*place, "file"), entry.file)
        if included is None:
            gathering.lost_instances.add(entry.name)
            return
        mark = part.document.mark(place)
        within = f"in the instance '{entry.name}' of {part.document.path}:{mark.line}:{mark.column}"
        inside = _Gathering(f"{within}, {gathering.within}" if gathering.within else within)
        self.add(inside, included, including)
        module = Module(tuple(inside.parts), tuple(inside.instances), frozenset(inside.lost_instances))
        gathering.instances.append(replace(instance, module=module))

    def read(self, part: Part, place: Place, name: str) -> Part | None:
        """Read an included file, read once however often it is included; None after complaining."""
        path = _included_path(part.document, name)
        here = resolved(path)
        if here in self.files:
            return self.files[here]
        self.files[here] = None
        document, problems = scan_yaml(path)
        if document is None and not problems[0].is_placed:
            complaint, hint = _unreadable(path, name, problems[0])
            problems = [part.document.problem(place, complaint, hint)]
        self.problems.extend(problems)
        if document is not None:
            self.files[here] = self.part(document, FileSpec)
        return self.files[here]

    def is_circle(self, part: Part, place: Place, path: Path, including: tuple[Path, ...]) -> bool:
        """Check whether a file includes itself, perhaps through others; complains if so."""
        if resolved(path) not in including:
            return False
        start = including.index(resolved(path))
        circle = " -> ".join(each.name for each in (*including[start:], path))
        message = f"found a circle of includes: {circle}; allowed: includes that end"
        self.problems.append(part.document.problem(place, message))
        return True


@dataclass
class _Gathering:
    """A module in the making."""

    within: str
    parts: list[Part] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    lost_instances: set[str] = field(default_factory=set)
    done: set[Path] = field(default_factory=set)


def _included_path(document: Document, name: str) -> Path:
    """Find the path of an included file: from here, or of a shipped circuit if it is a bare name."""
    path = Path(document.path).parent / name
    bare = not Path(name).suffix and len(Path(name).parts) == 1
    return (shipped_file(FOLDER, f"{name}.yaml") if bare and not is_file(path) else None) or path


def _unreadable(path: Path, name: str, problem: Problem) -> tuple[str, str]:
    """Tell about an included file that cannot be opened in the words of the file that includes it."""
    found, _, _ = problem.message.partition("; allowed")
    if not found.startswith("there is no"):
        which = found.replace("found ", "is ", 1)
        return f"found '{name}', which {which}; allowed: the path of a circuit file from here", ""
    there = sorted(sibling.name for sibling in path.parent.glob("*.y*ml"))
    hint = suggest(path.name, there if path.suffix else [*shipped_names(FOLDER), *there])
    allowed = "a path from here" if path.suffix else "a path from here, or the name of a shipped circuit"
    return f"found '{name}', but there is no file '{path}'; allowed: {allowed}", hint


def _sound_part(document: Document, findings: Iterable[Finding]) -> Part:
    """Find what is left of a file without the parts that are complained about."""
    data = document.data
    findings = list(findings)
    if not isinstance(data, dict) or any(finding.kind == OTHER_KIND for finding in findings):
        return Part(document, FileSpec(), lost_sections=True)
    sound: dict[str, Data] = json.loads(json.dumps(data))  # a copy to take things out of
    lost: set[str] = set()
    bad_entries: dict[str, set[int]] = {section: set() for section in LISTED_SECTIONS}
    lost_sections = False
    for finding in sorted(findings, key=lambda each: each.kind != "extra_forbidden"):
        section, *inner = finding.place
        if finding.kind == "extra_forbidden":
            _without(sound, finding.place)
            lost_sections |= not inner and bool(suggest(str(section), (*NAMED_SECTIONS, *LISTED_SECTIONS)))
        elif section in NAMED_SECTIONS and inner:
            lost.add(str(inner[0]))
            _without(sound, (section, inner[0]))
        elif section in LISTED_SECTIONS and inner:
            bad_entries[str(section)].add(int(inner[0]))
        else:
            sound.pop(str(section), None)
            lost_sections |= section in {*NAMED_SECTIONS, "include"}
    numbers: dict[str, tuple[int, ...]] = {}
    for section, bad in bad_entries.items():
        if isinstance(entries := sound.get(section), list):
            numbers[section] = tuple(number for number in range(len(entries)) if number not in bad)
            sound[section] = [entries[number] for number in numbers[section]]
    spec, rest = model_problems(document, FileSpec, sound)
    if spec is None or rest:
        return Part(document, FileSpec(), {}, frozenset(lost), lost_sections=True)
    return Part(document, spec, numbers, frozenset(lost), lost_sections)


def _without(data: Data, place: Place) -> None:
    """Remove an entry of nested mappings and lists."""
    for part in place[:-1]:
        data = data[part] if isinstance(data, dict | list) else None  # type: ignore[index]
    if isinstance(data, dict):
        data.pop(str(place[-1]), None)
