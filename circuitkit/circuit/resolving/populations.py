"""Entries of `populations` to `Population`: the size, and values for every member."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.expressions.amounts import Amount
from circuitkit.circuit.graph import Population
from circuitkit.circuit.models import NeuronModel
from circuitkit.circuit.resolving.declared_models import DeclaredModels, Reader
from circuitkit.circuit.resolving.items import Item
from circuitkit.circuit.resolving.memory import Budget
from circuitkit.circuit.resolving.neurons import neuron_values
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.spec import PopulationSpec

# Members are counted with 32 bits.
LARGEST = 2**31 - 1


def populations(scope: Scope, models: DeclaredModels, budget: Budget) -> Iterator[Population]:
    """Yield the populations that a scope declares, as far as they are sound."""
    for name, item in scope.populations.items():
        model = models.neuron(item)
        size = _size(scope, item, model, budget)
        if model is None or size is None:
            continue
        values = neuron_values(scope, item, model, _reader(scope, item, size))
        if values is not None:
            yield Population(name=scope.prefix + name, size=size, **values)


def _size(scope: Scope, item: Item[PopulationSpec], model: NeuronModel | None, budget: Budget) -> int | None:
    """Find how many members, if that is a number of neurons that fits into memory; None after complaining."""
    size = scope.value(item, ("size",), item.spec.size, DIMENSIONLESS, "it is a number of neurons")
    if size is None:
        return None
    count = int(size.value_si)
    if count != size.value_si or count < 1:
        scope.errors.append(item.problem(("size",), f"found {size}; allowed: a whole number from 1 on"))
        return None
    complaint = budget.neurons(
        count, len(model.parameters) if model else 0, len(model.states) if model else 0
    )
    if not complaint and count > LARGEST:
        complaint = f"found {count}; allowed: up to {LARGEST}"
    if complaint:
        scope.errors.append(item.problem(("size",), complaint))
        return None
    return count


def _reader(scope: Scope, item: Item[Any], size: int) -> Reader:
    from circuitkit.circuit.resolving.member_values import member_values  # brings numpy: 0.1 s

    def read(place: Place, value: object) -> Amount | None:
        return member_values(scope, item, place, value, size)

    return read
