"""What several files declare, put together: each name once, and what is doubtful about names.

`Item` is something that a file declares, with where it stands; `Findings` has all that is wrong so far.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar, Unpack

from circuitkit.base.errors import Problem
from circuitkit.base.source import FileModel, Place, Pointing
from circuitkit.base.units import UNIT_SYMBOLS
from circuitkit.circuit.graph import NO_ORIGIN, Origin
from circuitkit.circuit.models import NeuronModel, SynapseModel
from circuitkit.circuit.parts import Part
from circuitkit.circuit.spec import ParameterSpec

SpecT = TypeVar("SpecT", bound=FileModel)


@dataclass(frozen=True, slots=True)
class Item(Generic[SpecT]):
    """Something that a file declares.

    Attributes:
        name: Its name in the file; empty for what has none.
        spec: What the file says.
        part: The file.
        place: Where in the file.
    """

    name: str
    spec: SpecT
    part: Part
    place: Place

    @property
    def origin(self) -> Origin:
        """Where its name stands."""
        path = self.part.document.path
        if not path:
            return NO_ORIGIN
        mark = self.part.document.mark(self.place)
        return Origin(path, mark.key_line, mark.key_column)

    @property
    def value_place(self) -> Place:
        """Where the value of a parameter stands: a parameter may be written `1 mm` or `{value: 1 mm}`."""
        return ("value",) if (*self.place, "value") in self.part.document.marks else ()

    def problem(self, inner: Place, message: str, hint: str = "", **pointing: Unpack[Pointing]) -> Problem:
        """Return a complaint as `Document.problem` does, about a part of the item."""
        if self.part.within:
            message = f"{message} ({self.part.within})"
        return self.part.document.problem((*self.place, *inner), message, hint, **pointing)

    def seen_from(self, part: Part) -> str:
        """Find where it stands, in words for a message about another place."""
        origin = self.origin
        return f"on line {origin.line}" if part.document is self.part.document else f"at {origin}"


@dataclass
class Findings:
    """What is shared by all scopes of a circuit.

    Attributes:
        overrides: Values that take the place of the files', by address, such as `lateral.q1.slope`.
        seed: Seed of distributions and random connections.
        errors: What is wrong.
        warnings: What is doubtful, and may change results.
        unused: What has no effect on an output; who runs the circuit need not be told.
        addresses: Every address of a value that was met so far; only kept if there are overrides.
        in_progress: The chain of parameters and inputs that are being worked out.
        neuron_models: The neuron models that the files declare, by name.
        synapse_models: The synapse models that the files declare, by name.
    """

    overrides: Mapping[str, object] = field(default_factory=dict)
    seed: int = 0
    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    unused: list[Problem] = field(default_factory=list)
    addresses: dict[str, None] = field(default_factory=dict)
    in_progress: list[str] = field(default_factory=list)
    neuron_models: dict[str, NeuronModel] = field(default_factory=dict)
    synapse_models: dict[str, SynapseModel] = field(default_factory=dict)


# Tables of results have a column of this name.
RESERVED_NAME = "time_s"
# What expressions for members of populations and for synapses of projections call numbers.
_INDICES = frozenset({"i", "j", "n", "n_source", "n_target"})


def merged(parts: Sequence[Part], section: str, findings: Findings) -> dict[str, Item[Any]]:
    """Return a section of all files; complains about names that are declared twice."""
    found: dict[str, Item[Any]] = {}
    for part in parts:
        for name, spec in getattr(part.spec, section).items():
            item = Item(name, spec, part, (section, name))
            if name in found:
                _complain_of_second(item, found[name], findings)
            else:
                found[name] = item
    return found


def merged_parameters(
    parts: Sequence[Part], findings: Findings
) -> tuple[dict[str, Item[ParameterSpec]], dict[str, list[Item[ParameterSpec]]]]:
    """Return the parameters of all files, and those of included files that another one took the place of.

    A parameter may be declared again by a file that includes the other one: the including file's counts,
    and must be of the same dimension.
    """
    found: dict[str, Item[ParameterSpec]] = {}
    replaced: dict[str, list[Item[ParameterSpec]]] = {}
    for part in parts:
        for name, spec in part.spec.parameters.items():
            item = Item(name, spec, part, ("parameters", name))
            if name in found and found[name].part is part:
                _complain_of_second(item, found[name], findings)
                continue
            if name in found:
                replaced.setdefault(name, []).append(found[name])
            found[name] = item
    return found, replaced


def _complain_of_second(item: Item[Any], first: Item[Any], findings: Findings) -> None:
    where = first.seen_from(item.part)
    message = f"the name '{item.name}' is declared twice, first {where}; allowed: each name once"
    findings.errors.append(item.problem((), message, at_key=True))


def claim_names(
    sections: Mapping[str, Mapping[str, Item[Any]]], findings: Findings
) -> dict[str, tuple[str, Item[Any]]]:
    """Return inputs, neurons, populations and outputs, by their kinds: they share one set of names."""
    nodes: dict[str, tuple[str, Item[Any]]] = {}
    for kind, items in sections.items():
        for name, item in items.items():
            if name == RESERVED_NAME:
                message = f"found the name '{name}', which tables use for the time; allowed: another name"
                findings.errors.append(item.problem((), message, at_key=True))
            if name in nodes:
                other, first = nodes[name]
                taken = f"the name '{name}' is taken by {a_kind(other)} {first.seen_from(item.part)}"
                message = f"{taken}; allowed: a name of its own"
                findings.errors.append(item.problem((), message, at_key=True))
            else:
                nodes[name] = (kind, item)
    return nodes


def doubt_names(
    parameters: Mapping[str, Item[ParameterSpec]],
    nodes: Mapping[str, tuple[str, Item[Any]]],
    findings: Findings,
) -> None:
    """Doubt parameters that have the name of a node, of a unit, or of an index."""
    has_populations = any(kind == "population" for kind, _ in nodes.values())
    for name, parameter in parameters.items():
        if name in nodes:
            kind, first = nodes[name]
            where = first.seen_from(parameter.part)
            message = f"the parameter has the same name as the {kind} {where}; give one another name"
            findings.warnings.append(parameter.problem((), message, at_key=True))
        if name in UNIT_SYMBOLS:
            message = (
                f"the parameter has the same name as the unit {name}, which it still means after a number"
            )
            message = f"{message} (1 {name}); give it another name"
            findings.warnings.append(parameter.problem((), message, at_key=True))
        if name in _INDICES and has_populations:
            message = f"the index {name} hides it in expressions of populations and projections"
            findings.warnings.append(parameter.problem((), f"{message}; give it another name", at_key=True))


def refuse_inner_names(
    nodes: Mapping[str, tuple[str, Item[Any]]], instances: Collection[str], findings: Findings
) -> None:
    """Refuse names with dots in a file with instances, where they belong to what is inside."""
    for name, (kind, item) in nodes.items():
        first, dot, _ = name.partition(".")
        if dot and first in instances:
            belongs = f"the name '{name}' belongs to the instance '{first}'"
            message = f"{belongs}; allowed: {a_kind(kind)} without a dot"
            findings.errors.append(item.problem((), message, at_key=True))


def a_kind(kind: str) -> str:
    """Return a kind of thing with its article."""
    return f"{'an' if kind[0] in 'io' else 'a'} {kind}"
