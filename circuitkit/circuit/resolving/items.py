"""What a file declares, with where it stands; and everything that is wrong so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar, Unpack

from circuitkit.base.errors import Problem
from circuitkit.base.source import FileModel, Place, Pointing
from circuitkit.circuit.graph import NO_ORIGIN, Origin
from circuitkit.circuit.models import NeuronModel, SynapseModel
from circuitkit.circuit.parts import Part

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
        warnings: What is doubtful.
        addresses: Every address of a value that was met so far; only kept if there are overrides.
        in_progress: The chain of parameters and inputs that are being worked out.
        neuron_models: The neuron models that the files declare, by name.
        synapse_models: The synapse models that the files declare, by name.
    """

    overrides: Mapping[str, object] = field(default_factory=dict)
    seed: int = 0
    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    addresses: dict[str, None] = field(default_factory=dict)
    in_progress: list[str] = field(default_factory=list)
    neuron_models: dict[str, NeuronModel] = field(default_factory=dict)
    synapse_models: dict[str, SynapseModel] = field(default_factory=dict)
