"""Entries of `outputs` to `OutputNode`: what is read, the leak, the limits."""

from __future__ import annotations

from collections.abc import Iterator

from circuitkit.base.units import DIMENSIONLESS, Unit, parse_unit
from circuitkit.circuit.graph import OutputNode, PerMember
from circuitkit.circuit.resolving.items import Item
from circuitkit.circuit.resolving.neurons import in_unit
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.resolving.signals import Nodes
from circuitkit.circuit.spec import OutputSpec

_READ = ("neuron", "member", "population")


def outputs(root: Scope, nodes: Nodes) -> Iterator[OutputNode]:
    """Yield the outputs of a circuit, those of instances first; complain also about those not kept."""
    kept = {id(located.item): name for name, located in root.published.items()}
    for scope in root.everything():
        for name, item in scope.outputs.items():
            node = _output(scope, item, kept.get(id(item), scope.prefix + name), nodes)
            if id(item) in kept:
                yield node


def _output(scope: Scope, item: Item[OutputSpec], name: str, nodes: Nodes) -> OutputNode:
    unit = parse_unit(item.spec.unit)
    readout = tuple(_readout(scope, item, unit, nodes))
    leak = _leak(scope, item)
    low, high = float("-inf"), float("inf")
    if item.spec.limits is not None and (limits := scope.pair(item, "limits", item.spec.limits, unit)):
        low, high = (quantity.value_si for quantity in limits)
    return OutputNode(name, unit, readout, low, high, leak, item.spec.description, item.origin)


def _readout(
    scope: Scope, item: Item[OutputSpec], unit: Unit, nodes: Nodes
) -> Iterator[tuple[str, PerMember]]:
    for name, value in item.spec.readout.items():
        place = ("readout", name)
        scope.find(item, place, name, _READ, "neuron", "a neuron", at_key=True)
        located = scope.locate(name)  # the weight of something that cannot be read is checked as well
        reason = f"the output is {in_unit(unit)}"
        end = nodes.located(scope, item, place, located, at_key=True) if located else None
        if end is not None and end.is_population:
            from circuitkit.circuit.resolving.member_values import member_values  # brings numpy: 0.1 s

            values = member_values(scope, item, place, value, end.size)
            if values is not None and scope.fits(item, place, values, unit, reason):
                yield end.name, values.value
            continue
        if end is None and (located is None or located.kind == "population"):
            continue  # whether it is a list of weights is not known
        weight = scope.value(item, place, value, unit, reason)
        if weight is not None:
            if weight.value_si == 0:
                message = f"found a weight of 0; {name} has no effect on the output"
                scope.warnings.append(item.problem(place, message))
            if end is not None:
                yield end.name, weight.value_si


def _leak(scope: Scope, item: Item[OutputSpec]) -> float | None:
    place = ("integrate", "leak")
    if item.spec.integrate is None:
        return None
    leak = scope.value(item, place, item.spec.integrate.leak, DIMENSIONLESS, "it is a part of the output")
    if leak is not None and not 0 <= leak.value_si <= 1:
        scope.errors.append(item.problem(place, f"found {leak}; allowed: from 0 to 1, or 0 % to 100 %"))
    return None if leak is None else leak.value_si
