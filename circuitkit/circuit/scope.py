"""What a circuit's files declare, merged: names, values of parameters, and the complaints so far."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from circuitkit.circuit.graph import NO_ORIGIN, Origin
from circuitkit.circuit.parts import Part
from circuitkit.circuit.spec import InputSpec, NeuronSpec, OutputSpec, ParameterSpec, SynapseSpec
from circuitkit.circuit.values import (
    LostNameError,
    ValueProblemError,
    evaluate,
    unknown_parameter,
)
from circuitkit.errors import Problem, listing, suggest
from circuitkit.source import FileModel, Place
from circuitkit.units import DIMENSIONLESS, Quantity, Unit

SpecT = TypeVar("SpecT", bound=FileModel)
# Tables of results have a column of this name.
RESERVED_NAME = "time_s"
# Far beyond any use, and far from Python's limit of recursion.
_LONGEST_CHAIN = 50


@dataclass(frozen=True)
class Item(Generic[SpecT]):
    """Something that a file declares, with where it stands."""

    name: str
    spec: SpecT
    part: Part
    place: Place

    @property
    def origin(self) -> Origin:
        """Where its name stands."""
        mark = self.part.document.mark(self.place)
        path = self.part.document.path
        return Origin(path, mark.key_line, mark.key_column) if path else NO_ORIGIN

    @property
    def value_place(self) -> Place:
        """Where the value of a parameter stands: a parameter may be written `1 mm` or `{value: 1 mm}`."""
        return ("value",) if (*self.place, "value") in self.part.document.marks else ()

    def problem(self, inner: Place, message: str, hint: str = "", *, at_key: bool = False) -> Problem:
        """A complaint about a part of it."""
        return self.part.document.problem((*self.place, *inner), message, hint, at_key=at_key)

    def seen_from(self, part: Part) -> str:
        """Where it stands, in words for a message about another place."""
        origin = self.origin
        return f"on line {origin.line}" if part is self.part else f"at {origin}"


@dataclass
class Scope:
    """What the files declare, and everything that is wrong with it so far.

    Attributes:
        parts: The files; the circuit file is the last one.
        overrides: Values that take the place of parameters of the files.
        errors: What is wrong.
        warnings: What is doubtful.
    """

    parts: Sequence[Part]
    overrides: Mapping[str, float | str] = field(default_factory=dict)
    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    used_parameters: set[str] = field(default_factory=set)
    _values: dict[str, Quantity | None] = field(default_factory=dict)
    _in_progress: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Merge the sections of all files, and complain about names that are declared twice.

        A parameter may be declared again by a file that includes the other one: the including file's value
        counts, and must be of the same dimension.
        """
        self.lost = frozenset().union(*(part.lost for part in self.parts))
        self.incomplete = any(part.lost_sections for part in self.parts)
        self._included: dict[str, list[Item[ParameterSpec]]] = {}
        self.parameters: dict[str, Item[ParameterSpec]] = self._merged("parameters")
        self.inputs: dict[str, Item[InputSpec]] = self._merged("inputs")
        self.neurons: dict[str, Item[NeuronSpec]] = self._merged("neurons")
        self.outputs: dict[str, Item[OutputSpec]] = self._merged("outputs")
        self.nodes: dict[str, tuple[str, Item[InputSpec] | Item[NeuronSpec] | Item[OutputSpec]]] = {}
        self._claim_names()

    def _merged(self, section: str) -> dict[str, Item[SpecT]]:
        merged: dict[str, Item[SpecT]] = {}
        for part in self.parts:
            for name, spec in getattr(part.spec, section).items():
                item = Item(name, spec, part, (section, name))
                if section == "parameters" and name in merged and merged[name].part is not part:
                    self._included.setdefault(name, []).append(merged[name])  # type: ignore[arg-type]  # a parameter
                    merged[name] = item
                elif name in merged:
                    first = merged[name].seen_from(part)
                    message = f"the name '{name}' is declared twice, first {first}; allowed: each name once"
                    self.errors.append(item.problem((), message, at_key=True))
                else:
                    merged[name] = item
        return merged

    def _claim_names(self) -> None:
        """Inputs, neurons and outputs share one set of names."""
        for kind, items in (("input", self.inputs), ("neuron", self.neurons), ("output", self.outputs)):
            for name, item in items.items():
                if name == RESERVED_NAME:
                    message = f"found the name '{name}', which tables use for the time; allowed: another name"
                    self.errors.append(item.problem((), message, at_key=True))
                if name in self.nodes:
                    other, first = self.nodes[name]
                    taken = f"the name '{name}' is taken by an {other} {first.seen_from(item.part)}"
                    message = f"{taken}; allowed: a name of its own".replace("an neuron", "a neuron")
                    self.errors.append(item.problem((), message, at_key=True))
                else:
                    self.nodes[name] = (kind, item)
        for name, parameter in self.parameters.items():
            if name in self.nodes:
                kind, first = self.nodes[name]
                where = first.seen_from(parameter.part)
                message = f"the parameter has the same name as the {kind} {where}; give one another name"
                self.warnings.append(parameter.problem((), message, at_key=True))

    def synapses(self) -> Iterator[Item[SynapseSpec]]:
        """The synapses of all files, in order."""
        for part in self.parts:
            for number, spec in zip(part.synapse_numbers, part.spec.synapses, strict=True):
                yield Item("", spec, part, ("synapses", number))

    def is_lost(self, name: str) -> bool:
        """Whether a missing name may be missing only because of something that is reported already."""
        return self.incomplete or name in self.lost

    def unknown(self, what: str, name: str, allowed: str, names: Sequence[str]) -> tuple[str, str]:
        """Message and hint about a name that is not among the names allowed here."""
        found = f"unknown {what} '{name}'"
        if name in self.nodes or name in self.parameters:
            kind = self.nodes[name][0] if name in self.nodes else "parameter"
            found = f"found '{name}', which is {'an' if kind[0] in 'io' else 'a'} {kind}"
        return f"{found}; allowed: {allowed}: {listing(names)}", suggest(name, names)

    def value(
        self, item: Item[SpecT], inner: Place, value: object, unit: Unit | None = None, reason: str = ""
    ) -> Quantity | None:
        """The quantity that a value stands for, or None after complaining.

        Args:
            item: What the value belongs to.
            inner: Where in the item it stands.
            value: As written.
            unit: A unit of the dimension that is allowed; None for any.
            reason: Why this dimension, for the message.
        """
        try:
            quantity = evaluate(value, self._look_up)
        except ValueProblemError as error:
            self.errors.append(item.problem(inner, error.message, error.hint))
        except LostNameError:
            pass
        else:
            return quantity if unit is None or self.fits(item, inner, quantity, unit, reason) else None
        return None

    def fits(self, item: Item[SpecT], inner: Place, quantity: Quantity, unit: Unit, reason: str = "") -> bool:
        """Whether a quantity has the dimension of a unit; complains if not."""
        if quantity.dimension == unit.dimension:
            return True
        allowed = f"{unit.dimension}, such as '1 {unit}'" if any(unit.dimension) else "a number without unit"
        because = f", since {reason}" if reason else ""
        message = f"found {quantity} ({quantity.dimension}); allowed: {allowed}{because}"
        hint = f"did you mean '{quantity} {unit}'?" if quantity.unit == DIMENSIONLESS else ""
        self.errors.append(item.problem(inner, message, hint))
        return False

    def pair(
        self, item: Item[SpecT], key: str, values: tuple[float | str, float | str], unit: Unit
    ) -> tuple[Quantity, Quantity] | None:
        """Two values of which the second must be larger, or None after complaining."""
        reason = f"the unit is {unit}"
        low, high = (self.value(item, (key, i), value, unit, reason) for i, value in enumerate(values))
        if low is None or high is None:
            return None
        if low.value_si >= high.value_si:
            message = f"found {low} before {high}; allowed: the smaller value, then the larger one"
            self.errors.append(item.problem((key,), message))
            return None
        return low, high

    def parameter(self, name: str) -> Quantity | None:
        """The value of a declared parameter, or None after complaining."""
        if name not in self._values:
            item = self.parameters[name]
            inner = item.value_place
            if name in self._in_progress:
                circle = " -> ".join((*self._in_progress[self._in_progress.index(name) :], name))
                message = f"found a circle of parameters: {circle}; allowed: parameters that end in a value"
                self.errors.append(item.problem(inner, message))
                return None
            if len(self._in_progress) >= _LONGEST_CHAIN:
                message = f"found more than {_LONGEST_CHAIN} parameters in a chain; allowed: fewer"
                self.errors.append(item.problem(inner, message))
                return None
            self._in_progress.append(name)
            quantity = self.value(item, inner, item.spec.value)
            for included in self._included.get(name, ()):
                before = self.value(included, included.value_place, included.spec.value)
                if before is not None and quantity is not None:
                    reason = f"{included.seen_from(item.part)} it is {before}"
                    quantity = quantity if self.fits(item, inner, quantity, before.unit, reason) else None
            if quantity is not None and name in self.overrides:
                reason = f"the file has {quantity}"
                quantity = self.value(item, inner, self.overrides[name], quantity.unit, reason)
            self._in_progress.pop()
            self._values[name] = quantity
        return self._values[name]

    def _look_up(self, name: str) -> Quantity:
        if name not in self.parameters:
            if self.is_lost(name):
                raise LostNameError
            raise unknown_parameter(name, self.parameters)
        self.used_parameters.add(name)
        quantity = self.parameter(name)
        if quantity is None:
            raise LostNameError
        return quantity
