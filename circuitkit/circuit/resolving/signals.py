"""What takes the place of an instance's inputs.

An input of an instance stands for a weighted sum of inputs and neurons around the instance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Unit, parse_unit
from circuitkit.circuit.resolving.declarations import Item, a_kind
from circuitkit.circuit.resolving.nodes import Endpoint, Nodes, in_unit
from circuitkit.circuit.resolving.scope import Located, Scope
from circuitkit.circuit.spec import InstanceSpec, OutputSpec

_SOURCES = ("input", "neuron", "member", "output")


@dataclass(frozen=True, slots=True)
class Term:
    """A node times a factor, [SI]."""

    endpoint: Endpoint
    factor: float


class Signals:
    """What every input of every instance is, in terms of the circuit's own inputs and neurons."""

    def __init__(self, nodes: Nodes) -> None:
        self._nodes = nodes
        self._known: dict[str, tuple[Endpoint, tuple[Term, ...]] | None] = {}

    def input(self, located: Located) -> tuple[Endpoint, tuple[Term, ...]] | None:
        """Return an input as an end, and the weighted sum that takes its place; None if it is unsound."""
        name = located.name
        if name not in self._known:
            scope, entry = located.scope, located.scope.entry
            own_name = name.removeprefix(scope.prefix)
            end = Endpoint(name, parse_unit(located.item.spec.unit))
            if entry is None or scope.outer is None or own_name not in entry.spec.inputs:
                known = self._nodes.endpoint(name)
                self._known[name] = None if known is None else (known, (Term(known, 1.0),))
                return self._known[name]
            place = ("inputs", own_name)
            chain = scope.findings.in_progress
            if name in chain:
                circle = " -> ".join((*chain[chain.index(name) :], name))
                message = (
                    f"found a circle of inputs: {circle}; allowed: inputs that end in a node of the circuit"
                )
                scope.errors.append(entry.problem(place, message))
                return None
            chain.append(name)
            terms = list(self._terms(scope.outer, entry, place, end))
            chain.pop()
            self._known[name] = (end, tuple(_merged(terms))) if terms else None
        return self._known[name]

    def _terms(
        self, outer: Scope, entry: Item[InstanceSpec], place: Place, inner: Endpoint
    ) -> Iterator[Term]:
        """Find what an entry of an instance feeds to one of its inputs."""
        written = entry.spec.inputs[str(place[1])]
        if isinstance(written, str):
            yield from self._scaled(outer, entry, place, written, 1.0, inner, DIMENSIONLESS)
            return
        if not written:
            outer.errors.append(entry.problem(place, "found an empty sum; allowed: at least one name"))
        for name, value in written.items():
            factor = outer.value(entry, (*place, name), value)
            if factor is not None:
                at = (*place, name)
                yield from self._scaled(outer, entry, at, name, factor.value_si, inner, factor.unit)

    def _scaled(
        self,
        outer: Scope,
        entry: Item[InstanceSpec],
        place: Place,
        name: str,
        factor: float,
        inner: Endpoint,
        unit: Unit,
    ) -> Iterator[Term]:
        """Yield the terms that one name and its factor stand for."""
        is_key = len(place) > 2  # noqa: PLR2004 - a key of the mapping with the factors
        allowed = "an input, a neuron or an output"
        located = outer.find(entry, place, name, _SOURCES, "source", allowed, at_key=is_key)
        found = self._sum(outer, entry, place, located, at_key=is_key) if located else None
        if found is None:
            return
        source, terms = found
        dimension = source.unit.dimension.times(unit.dimension)
        if dimension != inner.unit.dimension:
            wanted = inner.unit.dimension.times(source.unit.dimension, -1)
            message = f"found {name} {in_unit(source.unit)}"
            message += f" times a factor in {unit}" if any(unit.dimension) else ""
            allowed = f"a factor in {wanted.si_symbol}" if any(wanted) else "a factor without unit"
            why = f"since the input {inner.name} is {in_unit(inner.unit)}"
            outer.errors.append(entry.problem(place, f"{message}; allowed: {allowed}, {why}"))
            return
        for term in terms:
            yield Term(term.endpoint, term.factor * factor)

    def _sum(
        self, outer: Scope, entry: Item[InstanceSpec], place: Place, located: Located, *, at_key: bool
    ) -> tuple[Endpoint, tuple[Term, ...]] | None:
        """Return the weighted sum that an input, neuron, member or output around an instance stands for."""
        if located.kind == "input":
            return self.input(located)
        if located.kind == "output":
            return self._output(outer, entry, place, located, at_key=at_key)
        end = self._nodes.located(outer, entry, place, located, at_key=at_key)
        return None if end is None else (end, (Term(end, 1.0),))

    def _output(
        self, outer: Scope, entry: Item[InstanceSpec], place: Place, located: Located, *, at_key: bool
    ) -> tuple[Endpoint, tuple[Term, ...]] | None:
        item: Item[OutputSpec] = located.item
        scope, spec = located.scope, item.spec
        if spec.integrate is not None or spec.limits is not None:
            why = "adds up" if spec.integrate is not None else "is limited"
            names = ", ".join(spec.readout)
            message = f"found '{located.name}', an output that {why}; allowed: inputs, neurons and plain sums"
            hint = f"name the neurons that it reads, with weights: {names}"
            outer.errors.append(entry.problem(place, message, hint, at_key=at_key))
            return None
        unit = parse_unit(spec.unit)
        terms = []
        for name, value in spec.readout.items():
            read = scope.locate(name)
            if read is None or read.kind not in {"neuron", "member"}:
                if read is not None:
                    message = f"found '{located.name}', an output that reads the {read.kind} {name}"
                    allowed = "outputs that read single neurons"
                    outer.errors.append(entry.problem(place, f"{message}; allowed: {allowed}", at_key=at_key))
                return None
            end = self._nodes.located(scope, item, ("readout", name), read, at_key=True)
            weight = scope.value(item, ("readout", name), value, unit, f"the output is {in_unit(unit)}")
            if end is None or weight is None:
                return None
            terms.append(Term(end, weight.value_si))
        return Endpoint(located.name, unit), tuple(terms)


def _merged(terms: list[Term]) -> Iterator[Term]:
    """Return one term for each node."""
    factors: dict[str, float] = {}
    endpoints: Mapping[str, Endpoint] = {term.endpoint.name: term.endpoint for term in terms}
    for term in terms:
        factors[term.endpoint.name] = factors.get(term.endpoint.name, 0.0) + term.factor
    return (Term(endpoints[name], factor) for name, factor in factors.items())


def unknown_inputs(scope: Scope) -> None:
    """Complain about entries of an instance that name inputs, outputs or parameters that its files lack."""
    entry, outer = scope.entry, scope.outer
    if entry is None or outer is None:
        return
    known: Any = {
        "parameters": list(scope.parameter_names),
        "inputs": scope.names("input"),
        "outputs": scope.names("output"),
    }
    for section, names in known.items():
        for name in getattr(entry.spec, section) or {}:
            if name not in names and not scope.is_lost(name):
                what = section.removesuffix("s")
                message, hint = scope.unknown(what, name, f"{a_kind(what)} of {entry.spec.file}", names)
                outer.errors.append(entry.problem((section, name), message, hint, at_key=True))
