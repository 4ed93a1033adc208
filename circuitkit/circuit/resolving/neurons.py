"""Entries of `neurons` and `populations`: the model's parameters, start and noise, with their units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from circuitkit.base.errors import listing, suggest
from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Dimension, Unit
from circuitkit.circuit.expressions.values import AMOUNT_FUNCTIONS, Amount
from circuitkit.circuit.graph import Neuron, Population
from circuitkit.circuit.models import ModelParameter, ModelState, NeuronModel, SynapseModel
from circuitkit.circuit.resolving.declared_models import (
    DeclaredModels,
    Reader,
    check_order,
    written_parameters,
)
from circuitkit.circuit.resolving.items import Item
from circuitkit.circuit.resolving.memory import Budget
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.spec import PopulationSpec

# Members are counted with 32 bits.
LARGEST = 2**31 - 1


def neurons(scope: Scope, models: DeclaredModels) -> Iterator[Neuron]:
    """Yield the neurons that a scope declares, as far as they are sound."""
    for name, item in scope.neurons.items():
        model = models.neuron(item)
        if model is None:
            continue
        values = neuron_values(scope, item, model, _reader(scope, item))
        if values is not None:
            yield Neuron(name=scope.prefix + name, **values)


def neuron_values(scope: Scope, item: Item[Any], model: NeuronModel, read: Reader) -> dict[str, Any] | None:
    """Find what neurons and populations have alike, by the names of their fields; None after complaining."""
    found = neuron_parameters(scope, item, model, read)
    if found is None:
        return None
    unit, parameters = found
    return {
        "model": model,
        "role": item.spec.role,
        "parameters": parameters,
        "activation_unit": unit,
        "description": item.spec.description,
        "initial": neuron_start(scope, item, model, unit, parameters, read),
        "noise": neuron_noise(scope, item, unit, read),
        "origin": item.origin,
    }


def _reader(scope: Scope, item: Item[Any]) -> Reader:
    def read(place: Place, value: object) -> Amount | None:
        quantity = scope.value(item, place, value)
        return None if quantity is None else Amount(quantity.value_si, quantity.unit)

    return read


def neuron_parameters(
    scope: Scope, item: Item[Any], model: NeuronModel, read: Reader
) -> tuple[Unit, dict[str, Any]] | None:
    """Return the unit of the activation, and a value for every parameter of the model, [SI].

    None after complaining, or if a parameter is lost: the unit is then not known, and nobody should complain
    about synapses that do not fit it.
    """
    before = len(scope.errors)
    written = written_parameters(scope, item, model, read)
    unit = _activation_unit(model, written)
    for parameter in model.parameters:
        if parameter.name in written:
            dimension = parameter.unit_rule.dimension(unit.dimension)
            if written[parameter.name].unit.dimension != dimension:
                wanted, reason = shown_unit(parameter, dimension, unit), because(parameter, unit)
                scope.fits(item, (parameter.name,), written[parameter.name], wanted, reason)
    check_order(scope, item, model, written)
    is_lost = any(name in item.spec.values and name not in written for name in model.parameter_names)
    if is_lost or len(scope.errors) > before:
        return None
    return unit, {**model.defaults, **{name: measure.value for name, measure in written.items()}}


def _activation_unit(model: NeuronModel, written: Mapping[str, Amount]) -> Unit:
    """Return the unit of the activation: the model's, a parameter's, or one that a parameter implies."""
    if model.activation is not None:
        return model.activation
    for power in (1, -1):
        for parameter in model.parameters:
            rule = parameter.unit_rule
            if rule.activation == power and not any(rule.fixed) and parameter.name in written:
                unit = written[parameter.name].unit
                return unit if power == 1 else Dimension().times(unit.dimension, -1).si_unit
    for parameter in model.parameters:
        power, fixed = parameter.unit_rule.activation, parameter.unit_rule.fixed
        if power in {1, -1} and any(fixed) and parameter.name in written:
            rest = written[parameter.name].dimension.times(fixed, -1)
            return Dimension().times(rest, power).si_unit
    return DIMENSIONLESS


def shown_unit(entry: ModelParameter | ModelState, dimension: Dimension, activation: Unit) -> Unit:
    """Find the unit to show a parameter or state in: its own, else the activation's, else that of SI."""
    if entry.unit is not None and entry.unit.dimension == dimension:
        return entry.unit
    return activation if dimension == activation.dimension else dimension.si_unit


def because(entry: ModelParameter | ModelState, activation: Unit) -> str:
    """Find why a parameter or state has its dimension."""
    if entry.unit_rule.activation:
        return f"the activation is {in_unit(activation)}"
    return f"{entry.name} is {in_unit(entry.unit) if entry.unit else entry.unit_rule.fixed}"


def in_unit(unit: Unit) -> str:
    """`in mm`, or `dimensionless`."""
    return f"in {unit}" if any(unit.dimension) else "dimensionless"


def start(model: NeuronModel | SynapseModel, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the start of every state of a model by its own declaration, [SI].

    Args:
        model: The model.
        values: What the declaration may name: the parameters, for a synapse also its weight, [SI].
    """
    if not model.states:
        return {}
    return {state.name: state.initial.evaluate(values, AMOUNT_FUNCTIONS) for state in model.states}


def neuron_start(
    scope: Scope, item: Item[Any], model: NeuronModel, unit: Unit, parameters: Mapping[str, Any], read: Reader
) -> dict[str, Any]:
    """Work out the start of every state: as the entry says, else as the model does, [SI]."""
    if not model.states and not item.spec.initial:
        return {}
    states = {state.name: state for state in model.states}
    for name in item.spec.initial:
        if name not in states:
            message = f"unknown state '{name}' of the model {model.name}; allowed: {listing(states)}"
            scope.errors.append(item.problem(("initial", name), message, suggest(name, states), at_key=True))
    initial = start(model, parameters)
    for name, state in states.items():
        place = ("initial", name)
        if name not in item.spec.initial and not scope.is_given(item, place):
            continue
        value = read(place, item.spec.initial.get(name))
        wanted = shown_unit(state, state.unit_rule.dimension(unit.dimension), unit)
        if value is not None and scope.fits(item, place, value, wanted, because(state, unit)):
            initial[name] = value.value
    return initial


def neuron_noise(scope: Scope, item: Item[Any], unit: Unit, read: Reader) -> Any:  # noqa: ANN401 - number or array
    """Return the standard deviation of the noise of a neuron or population, [SI]."""
    place = ("noise",)
    if item.spec.noise is None and not scope.is_given(item, place):
        return 0.0
    noise = read(place, item.spec.noise)
    if noise is None or not scope.fits(item, place, noise, unit, f"the activation is {in_unit(unit)}"):
        return 0.0
    lowest = noise.value if isinstance(noise.value, int | float) else noise.value.min()
    if lowest < 0:
        scope.errors.append(item.problem(place, f"found {noise}; allowed: 0 or more"))
    return noise.value


def populations(scope: Scope, models: DeclaredModels, budget: Budget) -> Iterator[Population]:
    """Yield the populations that a scope declares, as far as they are sound."""
    for name, item in scope.populations.items():
        model = models.neuron(item)
        size = _size(scope, item, model, budget)
        if model is None or size is None:
            continue
        values = neuron_values(scope, item, model, _member_reader(scope, item, size))
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


def _member_reader(scope: Scope, item: Item[Any], size: int) -> Reader:
    from circuitkit.circuit.resolving.member_values import member_values  # brings numpy: 0.1 s

    def read(place: Place, value: object) -> Amount | None:
        return member_values(scope, item, place, value, size)

    return read
