"""What the files of a circuit, or of an instance in one, declare: names, and values of parameters."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, TypeVar

from circuitkit.base.errors import listing, suggest
from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Quantity, Unit
from circuitkit.circuit.expressions.values import (
    Amount,
    LookUp,
    LostNameError,
    ValueProblemError,
    compute,
    evaluate,
    unknown_parameter,
)
from circuitkit.circuit.names import node_of
from circuitkit.circuit.parts import Module, Part
from circuitkit.circuit.resolving.declarations import (
    RESERVED_NAME,
    Findings,
    Item,
    SpecT,
    a_kind,
    claim_names,
    doubt_names,
    merged,
    merged_parameters,
    refuse_inner_names,
)
from circuitkit.circuit.spec import (
    FileSpec,
    InputSpec,
    InstanceSpec,
    NeuronSpec,
    OutputSpec,
    ParameterSpec,
    PopulationSpec,
    ProjectionSpec,
    SynapseSpec,
)

WorkedT = TypeVar("WorkedT", Quantity, Amount)
# Far beyond any use, and far from Python's limit of recursion.
_LONGEST_CHAIN = 50
_MOST_COMPARED = 20_000  # errors times names: with more, to look for what was meant each time takes seconds
_MEMBER = re.compile(r"(?P<population>.*)\[(?P<member>[0-9]+)\]")
NODE_SECTIONS = {"input": "inputs", "neuron": "neurons", "population": "populations", "output": "outputs"}


@dataclass(frozen=True, slots=True)
class Located:
    """What a name stands for.

    Attributes:
        kind: "input", "neuron", "population", "member" or "output".
        name: Its name in the whole circuit.
        scope: Where it is declared.
        item: Its declaration.
        member: Number of the member, for a member of a population.
    """

    kind: str
    name: str
    scope: Scope
    item: Item[Any]
    member: int = -1


class Scope:
    """The names of one module, the values of its parameters, and its instances.

    Attributes:
        parts: The files; the one that gave the module its name is the last one.
        prefix: What stands before its names in the whole circuit, such as `lateral.`.
        outer: The scope that it is an instance in.
        entry: The entry of the outer file that makes it an instance.
        instances: The scopes of its own instances, by name.
        findings: What is wrong and doubtful so far, in all scopes.
        used_parameters: Names of parameters that something used.
    """

    def __init__(
        self,
        module: Module,
        findings: Findings,
        outer: Scope | None = None,
        entry: Item[InstanceSpec] | None = None,
    ) -> None:
        self.parts: Sequence[Part] = module.parts
        self.findings = findings
        self.errors, self.warnings = findings.errors, findings.warnings
        self.outer, self.entry = outer, entry
        self.prefix: str = f"{outer.prefix}{entry.name}." if outer and entry else ""
        self.root: Scope = outer.root if outer else self
        self.main: Item[FileSpec] = Item("", self.parts[-1].spec, self.parts[-1], ())
        self.lost: frozenset[str] = frozenset().union(*(part.lost for part in self.parts))
        self.lost_instances = module.lost_instances
        self.incomplete = any(part.lost_sections for part in self.parts)
        self.used_parameters: set[str] = set()
        self._values: dict[str, Quantity | None] = {}
        self._located: dict[str, Located | None] = {}
        self.parameters, self._included = merged_parameters(self.parts, findings)
        self.inputs: dict[str, Item[InputSpec]] = merged(self.parts, "inputs", findings)
        self.neurons: dict[str, Item[NeuronSpec]] = merged(self.parts, "neurons", findings)
        self.populations: dict[str, Item[PopulationSpec]] = merged(self.parts, "populations", findings)
        self.outputs: dict[str, Item[OutputSpec]] = merged(self.parts, "outputs", findings)
        sections = {kind: getattr(self, section) for kind, section in NODE_SECTIONS.items()}
        self.nodes: dict[str, tuple[str, Item[Any]]] = claim_names(sections, findings)
        doubt_names(self.parameters, self.nodes, findings)
        self.instances: dict[str, Scope] = {}
        for instance in module.instances:
            item = Item(instance.spec.name, instance.spec, instance.part, ("include", instance.number))
            self._claim_instance(item)
            self.instances.setdefault(item.name, Scope(instance.module, findings, self, item))
        refuse_inner_names(self.nodes, {*self.instances, *self.lost_instances}, findings)
        self.published: dict[str, Located] = {}
        self._publish()

    def _claim_instance(self, item: Item[InstanceSpec]) -> None:
        taken = self.nodes.get(item.name) or (
            ("instance", self.instances[item.name].entry) if item.name in self.instances else None
        )
        if taken is not None and taken[1] is not None:
            where = taken[1].seen_from(item.part)
            message = (
                f"the name '{item.name}' is taken by {a_kind(taken[0])} {where}; allowed: a name of its own"
            )
            self.errors.append(item.problem(("as",), message))

    def _publish(self) -> None:
        """Collect the outputs that are outputs of what is around, too: those of instances, then its own."""
        for key, scope in self.instances.items():
            chosen = scope.entry.spec.outputs if scope.entry else None
            for inner, output in scope.published.items():
                if chosen is None:
                    self.published[f"{key}.{inner}"] = output
                elif inner in chosen:
                    self._rename_output(scope.entry, inner, chosen[inner], output)
        for name, item in self.outputs.items():
            self.published[name] = Located("output", self.prefix + name, self, item)

    def _rename_output(
        self, entry: Item[InstanceSpec] | None, inner: str, name: str, output: Located
    ) -> None:
        """Take over an output of an instance under another name."""
        if entry is not None and (name in self.nodes or name in self.published or name == RESERVED_NAME):
            message = f"the name '{name}' is taken; allowed: a name of its own"
            self.errors.append(entry.problem(("outputs", inner), message))
            return
        self.published[name] = self._located[name] = output
        self.nodes[name] = ("output", output.item)

    def everything(self) -> Iterator[Scope]:
        """Yield all scopes: those of instances before the one around them."""
        for instance in self.instances.values():
            yield from instance.everything()
        yield self

    def synapses(self) -> Iterator[Item[SynapseSpec]]:
        """Return the synapses of all files, in order."""
        return self._entries("synapses")

    def projections(self) -> Iterator[Item[ProjectionSpec]]:
        """Return the projections of all files, in order."""
        return self._entries("projections")

    def _entries(self, section: str) -> Iterator[Item[Any]]:
        for part in self.parts:
            entries = getattr(part.spec, section)
            numbers = part.numbers.get(section) or range(len(entries))
            for number, spec in zip(numbers, entries, strict=True):
                yield Item("", spec, part, (section, number))

    def is_lost(self, name: str) -> bool:
        """Check whether a missing name may be missing only because of something that is reported already."""
        first, dot, rest = name.partition(".")
        if dot and first in self.instances and self.instances[first].is_lost(rest):
            return True
        return self.incomplete or node_of(name) in self.lost or first in self.lost_instances

    def locate(self, name: str) -> Located | None:
        """Find what the name of a node, a member or an output stands for; None if nothing has it.

        A member need not exist: its number is not compared with the size of the population.
        """
        if name not in self._located:
            self._located[name] = self._locate(name)
        return self._located[name]

    def _locate(self, name: str) -> Located | None:
        if name in self.nodes:
            kind, item = self.nodes[name]
            return Located(kind, self.prefix + name, self, item)
        if match := _MEMBER.fullmatch(name):
            found = self.locate(match["population"])
            if found is None or found.kind != "population":
                return None
            member = int(match["member"])
            return Located("member", f"{found.name}[{member}]", found.scope, found.item, member)
        first, dot, rest = name.partition(".")
        return self.instances[first].locate(rest) if dot and first in self.instances else None

    def names(self, *kinds: str) -> list[str]:
        """Return the names of these kinds that can be used here: its own, then those of its instances."""
        own = [name for name, (kind, _) in self.nodes.items() if kind in kinds]
        inner = [f"{key}.{name}" for key, scope in self.instances.items() for name in scope.names(*kinds)]
        return [*own, *inner]

    def find(
        self,
        item: Item[SpecT],
        inner: Place,
        name: str,
        kinds: Sequence[str],
        what: str,
        allowed: str,
        *,
        at_key: bool = False,
    ) -> Located | None:
        """Find what a name stands for, if that is of one of these kinds; None after complaining.

        Args:
            item: What mentions the name.
            inner: Where in the item.
            name: The name.
            kinds: As in `Located`.
            what: What the name should stand for, such as "source".
            allowed: What is allowed, in words.
            at_key: The name is the key of what stands there.
        """
        located = self.locate(name)
        if located is not None and located.kind in kinds:
            return located
        if located is not None or not self.is_lost(name):
            message, hint = self.unknown(what, name, allowed, self.names(*kinds))
            self.errors.append(item.problem(inner, message, hint, at_key=at_key))
        return None

    def unknown(self, what: str, name: str, allowed: str, names: Sequence[str]) -> tuple[str, str]:
        """Return message and hint about a name that is not among the names allowed here."""
        found = f"unknown {what} '{name}'"
        located = self.locate(name)
        if located is not None:
            found = f"found '{name}', which is {a_kind(located.kind)}"
        elif name in self.parameters:
            found = f"found '{name}', which is a parameter"
        elif name in self.instances:
            found = f"found '{name}', which is an instance"
        return f"{found}; allowed: {allowed}: {listing(names)}", self._suggestion(name, names)

    def _suggestion(self, name: str, names: Sequence[str]) -> str:
        """Find what was probably meant; of a member of a population, too."""
        if not self._may_suggest(names):
            return ""
        whole, bracket, member = name.partition("[")
        if not bracket:
            return suggest(name, names)
        if not member.removesuffix("]").isdecimal() and whole in self.names("population"):
            return f"a member is called by its number, such as {whole}[0]"
        members = [f"{population}[{member}" for population in self.names("population")]
        return suggest(f"{whole}[{member}", members)

    def _may_suggest(self, names: Sequence[str]) -> bool:
        """Whether there is time to look for what was meant, by so many names."""
        return len(self.errors) * len(names) <= _MOST_COMPARED

    def address(self, item: Item[SpecT], inner: Place) -> str:
        """Find how a value is called from outside, such as `lateral.q1.slope`."""
        words = [item.name, *(str(part) for part in inner if part != "value")]
        return self.prefix + ".".join(word for word in words if word)

    def is_given(self, item: Item[SpecT], inner: Place) -> bool:
        """Check whether a value is given from outside."""
        if not self.findings.overrides or (item.place and not item.name):
            return False  # nothing is given, or it is a synapse, which has no name to call it by
        address = self.address(item, inner)
        self.findings.addresses[address] = None
        return address in self.findings.overrides

    def value(
        self, item: Item[SpecT], inner: Place, value: object, unit: Unit | None = None, reason: str = ""
    ) -> Quantity | None:
        """Return the quantity that a value stands for, or None after complaining.

        Args:
            item: What the value belongs to.
            inner: Where in the item it stands.
            value: As written; a value from outside takes its place.
            unit: A unit of the dimension that is allowed; None for any.
            reason: Why this dimension, for the message.
        """
        is_given = item.place[:1] != ("parameters",) and self.is_given(item, inner)
        quantity = self._worked_out(item, inner, evaluate, value, is_given=is_given)
        if quantity is None or unit is None:
            return quantity
        return quantity if self.fits(item, inner, quantity, unit, reason) else None

    def amounts(
        self, item: Item[SpecT], inner: Place, value: object, variables: Mapping[str, Amount]
    ) -> Amount | None:
        """As `value`, of an expression with variables that may be arrays."""
        work = partial(compute, variables=variables)
        return self._worked_out(item, inner, work, value, is_given=self.is_given(item, inner))

    def _worked_out(
        self,
        item: Item[SpecT],
        inner: Place,
        work: Callable[[object, LookUp], WorkedT],
        value: object,
        *,
        is_given: bool,
    ) -> WorkedT | None:
        """Work out a value as written, or the one from outside in its place; None after complaining."""
        scope = self
        if is_given:
            scope, value = self.root, self.findings.overrides[self.address(item, inner)]
        try:
            return work(value, scope.look_up)
        except ValueProblemError as error:
            offset = None if is_given else error.offset  # what comes from outside is no part of the text
            self.errors.append(item.problem(inner, error.message, error.hint, offset=offset))
        except LostNameError:
            pass
        return None

    def fits(
        self, item: Item[SpecT], inner: Place, quantity: Quantity | Amount, unit: Unit, reason: str = ""
    ) -> bool:
        """Check whether a quantity has the dimension of a unit; complains if not."""
        if quantity.unit.dimension == unit.dimension:
            return True
        allowed = f"{unit.dimension}, such as '1 {unit}'" if any(unit.dimension) else "a number without unit"
        because = f", since {reason}" if reason else ""
        message = f"found {quantity} ({quantity.dimension}); allowed: {allowed}{because}"
        is_one_number = isinstance(quantity, Quantity) or isinstance(quantity.value, int | float)
        is_bare = is_one_number and quantity.unit == DIMENSIONLESS
        hint = f"did you mean '{quantity} {unit}'?" if is_bare else ""
        self.errors.append(item.problem(inner, message, hint))
        return False

    def pair(
        self, item: Item[SpecT], key: str, values: tuple[float | str, float | str], unit: Unit
    ) -> tuple[Quantity, Quantity] | None:
        """Return two values of which the second must be larger, or None after complaining."""
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
        """Return the value of a declared parameter, or None after complaining."""
        if name not in self._values:
            item, chain = self.parameters[name], self.findings.in_progress
            full_name = self.prefix + name
            if full_name in chain:
                circle = " -> ".join((*chain[chain.index(full_name) :], full_name))
                message = f"found a circle of parameters: {circle}; allowed: parameters that end in a value"
                self.errors.append(item.problem(item.value_place, message))
                return None
            if len(chain) >= _LONGEST_CHAIN:
                message = f"found more than {_LONGEST_CHAIN} parameters in a chain; allowed: fewer"
                self.errors.append(item.problem(item.value_place, message))
                return None
            chain.append(full_name)
            self._values[name] = self._parameter(name, item)
            chain.pop()
        return self._values[name]

    def _parameter(self, name: str, item: Item[ParameterSpec]) -> Quantity | None:
        """Work out a parameter: as declared, unless an including file, an instance or the caller sets it."""
        quantity = self.value(item, item.value_place, item.spec.value)
        for included in self._included.get(name, ()):
            before = self.value(included, included.value_place, included.spec.value)
            if before is not None and quantity is not None:
                reason = f"{included.seen_from(item.part)} it is {before}"
                fits = self.fits(item, item.value_place, quantity, before.unit, reason)
                quantity = quantity if fits else None
        if self.entry is not None and self.outer is not None and name in self.entry.spec.parameters:
            place = ("parameters", name)
            given = self.outer.value(self.entry, place, self.entry.spec.parameters[name])
            if given is not None and quantity is not None:
                reason = f"{item.seen_from(self.entry.part)} it is {quantity}"
                given = given if self.fits(self.entry, place, given, quantity.unit, reason) else None
            quantity = given
        if quantity is not None and self.is_given(item, ()):
            given = self._worked_out(item, item.value_place, evaluate, None, is_given=True)
            reason = f"the file has {quantity}"
            fits = given is not None and self.fits(item, item.value_place, given, quantity.unit, reason)
            quantity = given if fits else None
        return quantity

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """The names of the parameters that can be used here: its own, then those of its instances."""
        inner = (f"{key}.{name}" for key, scope in self.instances.items() for name in scope.parameter_names)
        return (*self.parameters, *inner)

    def look_up(self, name: str) -> Quantity:
        """Return the value of a parameter.

        Raises:
            ValueProblemError: There is none of this name.
            LostNameError: It is declared, but has no sound value.
        """
        if name not in self.parameters:
            first, dot, rest = name.partition(".")
            if dot and first in self.instances and rest in self.instances[first].parameter_names:
                return self.instances[first].look_up(rest)
            if self.is_lost(name):
                raise LostNameError
            raise unknown_parameter(name, self.parameter_names, hint=self._may_suggest(self.parameter_names))
        self.used_parameters.add(name)
        quantity = self.parameter(name)
        if quantity is None:
            raise LostNameError
        return quantity
