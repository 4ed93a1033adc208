"""The nodes of a circuit: entries of `inputs`, `neurons`, `populations` and `outputs`, with their units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from circuitkit.base.errors import listing, suggest
from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Dimension, Unit, parse_unit
from circuitkit.circuit.expressions.values import AMOUNT_FUNCTIONS, Amount
from circuitkit.circuit.graph import (
    InputNode,
    Neuron,
    OutputNode,
    PerMember,
    Population,
    Role,
)
from circuitkit.circuit.memory import Budget
from circuitkit.circuit.models import ModelParameter, ModelState, NeuronModel, SynapseModel
from circuitkit.circuit.names import node_of
from circuitkit.circuit.resolving.declarations import Item
from circuitkit.circuit.resolving.declared_models import (
    DeclaredModels,
    Reader,
    check_order,
    reader,
    written_parameters,
)
from circuitkit.circuit.resolving.header import counted
from circuitkit.circuit.resolving.scope import Located, Scope
from circuitkit.circuit.spec import OutputSpec, PopulationSpec

# Members are counted with 32 bits.
_LARGEST = 2**31 - 1


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One end of a synapse or projection.

    Attributes:
        name: Its name in the whole circuit.
        unit: The unit of what it sends out: that of an input; outputs of neurons have none.
        role: Of a neuron; None for an input.
        model: Of a neuron; None for an input.
        activation: Unit of a neuron's activation; None for an input.
        size: Number of members.
        is_population: Whether it is a whole population.
    """

    name: str
    unit: Unit
    role: Role | None = None
    model: NeuronModel | None = None
    activation: Unit = DIMENSIONLESS
    size: int = 1
    is_population: bool = False


@dataclass
class Nodes:
    """The nodes of a circuit that could be resolved, by their names in the whole circuit."""

    inputs: dict[str, InputNode] = field(default_factory=dict)
    neurons: dict[str, Neuron] = field(default_factory=dict)
    populations: dict[str, Population] = field(default_factory=dict)
    _endpoints: dict[str, Endpoint] = field(default_factory=dict)

    def endpoint(self, name: str) -> Endpoint | None:
        """Return an input, neuron or population by its name in the whole circuit; None if it is unsound."""
        if name not in self._endpoints:
            if name in self.neurons:
                neuron = self.neurons[name]
                end = Endpoint(name, DIMENSIONLESS, neuron.role, neuron.model, neuron.activation_unit)
            elif name in self.inputs:
                end = Endpoint(name, self.inputs[name].unit)
            elif name in self.populations:
                each = self.populations[name]
                unit = each.activation_unit
                end = Endpoint(
                    name, DIMENSIONLESS, each.role, each.model, unit, each.size, is_population=True
                )
            else:
                return None
            self._endpoints[name] = end
        return self._endpoints[name]

    def located(
        self, scope: Scope, item: Item[Any], place: Place, located: Located, *, at_key: bool = False
    ) -> Endpoint | None:
        """Find what a name stands for; None if it is unsound, or after complaining about a missing member."""
        if located.kind != "member":
            return self.endpoint(located.name)
        population = self.populations.get(node_of(located.name))
        if population is None:
            return None
        if located.member >= population.size:
            allowed = f"{population.name}[0] to {population.name}[{population.size - 1}]"
            found = f"found '{located.name}', but the population has {population.size} members"
            scope.errors.append(item.problem(place, f"{found}; allowed: {allowed}", at_key=at_key))
            return None
        unit = population.activation_unit
        return Endpoint(located.name, DIMENSIONLESS, population.role, population.model, unit)


def inputs(scope: Scope) -> Iterator[InputNode]:
    """Yield the inputs of the circuit that a scope declares: all but those that something around it feeds."""
    fed = scope.entry.spec.inputs if scope.entry else {}
    for name, item in scope.inputs.items():
        unit = parse_unit(item.spec.unit)
        limits = scope.pair(item, "range", item.spec.range, unit)
        if limits is not None and name not in fed:
            low, high = (limit.value_si for limit in limits)
            yield InputNode(scope.prefix + name, unit, low, high, item.spec.description, item.origin)


def neurons(scope: Scope, models: DeclaredModels) -> Iterator[Neuron]:
    """Yield the neurons that a scope declares, as far as they are sound."""
    for name, item in scope.neurons.items():
        model = models.neuron(item)
        if model is None:
            continue
        values = _values(scope, item, model, reader(scope, item))
        if values is not None:
            yield Neuron(name=scope.prefix + name, **values)


def _values(scope: Scope, item: Item[Any], model: NeuronModel, read: Reader) -> dict[str, Any] | None:
    """Find what neurons and populations have alike, by the names of their fields; None after complaining."""
    found = _parameters(scope, item, model, read)
    if found is None:
        return None
    unit, parameters = found
    return {
        "model": model,
        "role": item.spec.role,
        "parameters": parameters,
        "activation_unit": unit,
        "description": item.spec.description,
        "initial": _start(scope, item, model, unit, parameters, read),
        "noise": _noise(scope, item, unit, read),
        "origin": item.origin,
    }


def _parameters(
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
                wanted, reason = shown_unit(parameter, dimension, unit), _because(parameter, unit)
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


def _because(entry: ModelParameter | ModelState, activation: Unit) -> str:
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


def _start(
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
        if value is not None and scope.fits(item, place, value, wanted, _because(state, unit)):
            initial[name] = value.value
    return initial


def _noise(scope: Scope, item: Item[Any], unit: Unit, read: Reader) -> Any:  # noqa: ANN401 - number or array
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
        values = _values(scope, item, model, _member_reader(scope, item, size))
        if values is not None:
            yield Population(name=scope.prefix + name, size=size, **values)


def _size(scope: Scope, item: Item[PopulationSpec], model: NeuronModel | None, budget: Budget) -> int | None:
    """Find how many members, if that is a number of neurons that fits into memory; None after complaining."""
    size = scope.value(item, ("size",), item.spec.size, DIMENSIONLESS, "it is a number of neurons")
    if size is None:
        return None
    if (count := counted(size.value_si, 1)) is None:
        bounds = f"from 1 to {_LARGEST}" if size.value_si > _LARGEST else "from 1 on"
        scope.errors.append(item.problem(("size",), f"found {size}; allowed: a whole number {bounds}"))
        return None
    if count > _LARGEST:
        complaint = f"found {size}; allowed: up to {_LARGEST}"
    else:
        parameters, states = (len(model.parameters), len(model.states)) if model else (0, 0)
        complaint = budget.neurons(count, parameters, states)
    if complaint:
        scope.errors.append(item.problem(("size",), complaint))
        return None
    return count


def _member_reader(scope: Scope, item: Item[Any], size: int) -> Reader:
    from circuitkit.circuit.resolving.member_values import member_values  # brings numpy: 0.1 s

    def read(place: Place, value: object) -> Amount | None:
        return member_values(scope, item, place, value, size)

    return read


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
            values = _member_reader(scope, item, end.size)(place, value)
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
