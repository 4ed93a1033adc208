"""The files' own terms to a `CircuitGraph`, with every reference, unit and sign checked on the way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from circuitkit.circuit.checks import doubts
from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode, Synapse, SynapseKind
from circuitkit.circuit.models import NEURON_MODEL_NAMES, ModelParameter, NeuronModel, neuron_model
from circuitkit.circuit.parts import Part, part_of
from circuitkit.circuit.scope import Item, Scope
from circuitkit.circuit.spec import CircuitSpec, FileSpec, NeuronSpec, OutputSpec, SynapseSpec
from circuitkit.errors import InputError, Problem, UnknownNameError, listing, suggest
from circuitkit.source import STRAY_TEXT, Place
from circuitkit.units import DIMENSIONLESS, Dimension, Quantity, Unit, parse_unit


def resolve(spec: CircuitSpec, parameters: Mapping[str, float | str] | None = None) -> CircuitGraph:
    """Apply includes and parameters, and check every reference, unit and sign.

    Args:
        spec: The circuit as its file says it, or a changed copy; what it includes has been read already.
        parameters: Values that take the place of the file's, such as `{"w": "0.5 deg"}`.

    Raises:
        UnknownNameError: The circuit has no parameter of this name.
        InputError: Something does not fit together; carries every error, not only the first.
    """
    parts = (*spec.parts[:-1], part_of(spec))
    overrides = dict(parameters or {})
    declared = [name for part in parts for name in part.spec.parameters]
    for name in overrides:
        if name not in declared:
            kind = "parameter"
            raise UnknownNameError(kind, name, declared)
    graph, errors, _ = analyse(parts, overrides)
    if graph is None:
        raise InputError(*errors)
    return graph


def analyse(
    parts: Sequence[Part], overrides: Mapping[str, float | str] | None = None
) -> tuple[CircuitGraph | None, list[Problem], list[Problem]]:
    """The graph of a circuit's files, with all errors and all warnings; no graph if there is an error."""
    scope = Scope(parts, overrides or {})
    step = _header(scope)
    values = {name: scope.parameter(name) for name in scope.parameters}
    inputs = tuple(_inputs(scope))
    neurons = {neuron.name: neuron for neuron in _neurons(scope)}
    synapses = tuple(_synapses(scope, {node.name: node for node in inputs}, neurons))
    outputs = tuple(_outputs(scope, neurons))
    main = parts[-1].spec
    if scope.errors or main.circuit is None or main.timing is None or step is None:
        return None, scope.errors, scope.warnings
    graph = CircuitGraph(
        name=main.circuit,
        description=main.description,
        timing=main.timing,
        step_s=step.value_si,
        inputs=inputs,
        neurons=tuple(neurons.values()),
        synapses=synapses,
        outputs=outputs,
        parameters={name: value for name, value in values.items() if value is not None},
    )
    return graph, [], [*scope.warnings, *doubts(graph, scope)]


def _header(scope: Scope) -> Quantity | None:
    """The control step; complains about included files that are made for another step or timing."""
    main: Item[FileSpec] = Item("", scope.parts[-1].spec, scope.parts[-1], ())
    step = None
    if main.spec.control_step is not None:
        step = scope.value(main, ("control_step",), main.spec.control_step, parse_unit("s"))
        if step is not None and step.value_si <= 0:
            message = f"found {step}; allowed: more than 0 s"
            scope.errors.append(main.problem(("control_step",), message))
    for part in scope.parts[:-1]:
        included: Item[FileSpec] = Item("", part.spec, part, ())
        if part.spec.timing not in {None, main.spec.timing}:
            message = f"found {part.spec.timing}, but the file that includes this one has {main.spec.timing}"
            scope.errors.append(included.problem(("timing",), f"{message}; allowed: the same"))
        if part.spec.control_step is not None:
            own = scope.value(included, ("control_step",), part.spec.control_step, parse_unit("s"))
            if own is not None and step is not None and own.value_si != step.value_si:
                message = f"found {own}, but the file that includes this one has {step}; allowed: the same"
                scope.errors.append(included.problem(("control_step",), message))
    for section, items in (("neurons", scope.neurons), ("outputs", scope.outputs)):
        if not items and not scope.incomplete and not scope.lost:
            message = f"the circuit has no {section}; allowed: at least one"
            scope.errors.append(main.problem((section,), message))
    return step


def _inputs(scope: Scope) -> Iterator[InputNode]:
    for name, item in scope.inputs.items():
        unit = parse_unit(item.spec.unit)
        if (limits := scope.pair(item, "range", item.spec.range, unit)) is not None:
            low, high = limits
            yield InputNode(name, unit, low.value_si, high.value_si, item.spec.description, item.origin)


def _neurons(scope: Scope) -> Iterator[Neuron]:
    for name, item in scope.neurons.items():
        if item.spec.model not in NEURON_MODEL_NAMES:
            message = f"unknown model '{item.spec.model}'; allowed: {listing(NEURON_MODEL_NAMES)}"
            hint = suggest(item.spec.model, NEURON_MODEL_NAMES)
            scope.errors.append(item.problem(("model",), message, hint))
            continue
        model = neuron_model(item.spec.model)
        written = _written_parameters(scope, item, model)
        unit = _activation_unit(model, written)
        for parameter in model.parameters:
            if parameter.name in written:
                _check_unit(scope, item, parameter, written[parameter.name], unit)
        _check_order(scope, item, model, written)
        values = {each.name: each.default or 0.0 for each in model.parameters}
        values |= {name: quantity.value_si for name, quantity in written.items()}
        description = item.spec.description
        yield Neuron(name, model, item.spec.role, values, unit, description, origin=item.origin)


def _written_parameters(scope: Scope, item: Item[NeuronSpec], model: NeuronModel) -> dict[str, Quantity]:
    """The parameters that the file gives; complains about missing and unknown ones."""
    own_keys = [name for name in NeuronSpec.model_fields if name != "description"]
    allowed = sorted((*own_keys, "description", *model.parameter_names))
    for key in item.spec.values:
        if key not in model.parameter_names:
            message = f"unknown key '{key}' for the model {model.name}; allowed: {listing(allowed)}"
            hint = STRAY_TEXT if item.spec.values[key] is None else suggest(key, allowed)
            scope.errors.append(item.problem((key,), message, hint, at_key=True))
    for parameter in model.parameters:
        if parameter.default is None and parameter.name not in item.spec.values:
            required = (*own_keys, *(each.name for each in model.parameters if each.default is None))
            message = f"missing key '{parameter.name}'; required by {model.name}: {listing(required)}"
            scope.errors.append(item.problem((), message, at_key=True))
    quantities = {
        name: scope.value(item, (name,), item.spec.values[name])
        for name in model.parameter_names
        if name in item.spec.values
    }
    return {name: quantity for name, quantity in quantities.items() if quantity is not None}


def _activation_unit(model: NeuronModel, written: Mapping[str, Quantity]) -> Unit:
    """The unit of the activation: of a parameter that has it, else the reciprocal of one that has that."""
    for power in (1, -1):
        for parameter in model.parameters:
            if parameter.unit_rule.activation == power and parameter.name in written:
                unit = written[parameter.name].unit
                return unit if power == 1 else Dimension().times(unit.dimension, -1).si_unit
    return DIMENSIONLESS


def _check_unit(
    scope: Scope, item: Item[NeuronSpec], parameter: ModelParameter, quantity: Quantity, unit: Unit
) -> None:
    """Complain about a parameter that does not fit the unit of the neuron's activation."""
    dimension = parameter.unit_rule.dimension(unit.dimension)
    wanted = unit if dimension == unit.dimension else dimension.si_unit
    scope.fits(item, (parameter.name,), quantity, wanted, f"the activation is {_in(unit)}")


def _check_order(
    scope: Scope, item: Item[NeuronSpec], model: NeuronModel, written: Mapping[str, Quantity]
) -> None:
    """Complain about parameters that must increase and do not."""
    ordered = [(name, written[name]) for name in model.increasing if name in written]
    for (smaller, low), (larger, high) in pairwise(ordered):
        if low.dimension == high.dimension and low.value_si >= high.value_si:
            message = f"found {smaller} {low} and {larger} {high}; allowed: {smaller} below {larger}"
            scope.errors.append(item.problem((smaller,), message))


def _synapses(
    scope: Scope, inputs: Mapping[str, InputNode], neurons: Mapping[str, Neuron]
) -> Iterator[Synapse]:
    first: dict[tuple[str, str], Item[SynapseSpec]] = {}
    for item in scope.synapses():
        source = item.spec.source
        if source not in scope.inputs and source not in scope.neurons and not scope.is_lost(source):
            names = (*scope.inputs, *scope.neurons)
            message, hint = scope.unknown("source", source, "an input or a neuron", names)
            scope.errors.append(item.problem(("from",), message, hint))
        targets = []
        for place, target in _targets(item):
            if target not in scope.neurons:
                if not scope.is_lost(target):
                    message, hint = scope.unknown("target", target, "a neuron", tuple(scope.neurons))
                    scope.errors.append(item.problem(place, message, hint))
            elif (source, target) in first:
                where = first[source, target].seen_from(item.part)
                message = f"duplicate synapse {source} -> {target}, first {where}; allowed: each one once"
                scope.errors.append(item.problem(place, message))
            else:
                first[source, target] = item
                targets.append(target)
        node = inputs.get(source) if source in scope.inputs else neurons.get(source)
        yield from _weighted(scope, item, node, [neurons[name] for name in targets if name in neurons])


def _targets(item: Item[SynapseSpec]) -> Iterator[tuple[Place, str]]:
    """The targets of a synapse with their places: one name, or the names of a list."""
    is_list = (*item.place, "to", 0) in item.part.document.marks
    for number, target in enumerate(item.spec.to):
        yield ("to", number) if is_list else ("to",), target


def _weighted(
    scope: Scope, item: Item[SynapseSpec], source: InputNode | Neuron | None, targets: Sequence[Neuron]
) -> Iterator[Synapse]:
    """The synapses of one entry; complains about the unit and the sign of its weight once."""
    weight = scope.value(item, ("weight",), item.spec.weight)
    if weight is None or source is None:
        return
    source_unit = source.unit if isinstance(source, InputNode) else DIMENSIONLESS
    for target in targets:
        unit = target.activation_unit
        reason = f"the activation of {target.name} is {_in(unit)} and {source.name} is {_in(source_unit)}"
        if not scope.fits(item, ("weight",), weight, _quotient(unit, source_unit), reason):
            return
    kind: SynapseKind = "sensorial" if isinstance(source, InputNode) else source.role
    if weight.value_si == 0:
        message = "found a weight of 0; the synapse has no effect"
        scope.warnings.append(item.problem(("weight",), message))
    elif (kind, weight.value_si > 0) in {("excitatory", False), ("inhibitory", True)}:
        sign, other = ("positive", "inhibitory") if kind == "excitatory" else ("negative", "excitatory")
        allowed = f"a {sign} weight, or the role {other} for {source.name}"
        message = f"found {weight}, but {source.name} is {kind}; allowed: {allowed}"
        scope.errors.append(item.problem(("weight",), message))
    for target in targets:
        yield Synapse(source.name, target.name, weight.value_si, kind, origin=item.origin)


def _in(unit: Unit) -> str:
    return f"in {unit}" if any(unit.dimension) else "dimensionless"


def _quotient(above: Unit, below: Unit) -> Unit:
    """The unit of a weight: as written if the source is dimensionless, else in SI."""
    if below.dimension == Dimension():
        return above
    return above.dimension.times(below.dimension, -1).si_unit


def _outputs(scope: Scope, neurons: Mapping[str, Neuron]) -> Iterator[OutputNode]:
    for name, item in scope.outputs.items():
        unit = parse_unit(item.spec.unit)
        readout = tuple(_readout(scope, item, unit, neurons))
        leak = _leak(scope, item)
        low, high = float("-inf"), float("inf")
        if item.spec.limits is not None and (limits := scope.pair(item, "limits", item.spec.limits, unit)):
            low, high = (quantity.value_si for quantity in limits)
        yield OutputNode(name, unit, readout, low, high, leak, item.spec.description, item.origin)


def _readout(
    scope: Scope, item: Item[OutputSpec], unit: Unit, neurons: Mapping[str, Neuron]
) -> Iterator[tuple[str, float]]:
    for neuron, value in item.spec.readout.items():
        if neuron not in neurons and neuron not in scope.neurons and not scope.is_lost(neuron):
            message, hint = scope.unknown("neuron", neuron, "a neuron", tuple(scope.neurons))
            scope.errors.append(item.problem(("readout", neuron), message, hint, at_key=True))
        weight = scope.value(item, ("readout", neuron), value, unit, f"the output is {_in(unit)}")
        if weight is not None:
            if weight.value_si == 0:
                message = f"found a weight of 0; {neuron} has no effect on the output"
                scope.warnings.append(item.problem(("readout", neuron), message))
            yield neuron, weight.value_si


def _leak(scope: Scope, item: Item[OutputSpec]) -> float | None:
    if item.spec.integrate is None:
        return None
    place = ("integrate", "leak")
    leak = scope.value(item, place, item.spec.integrate.leak, DIMENSIONLESS, "it is a part of the output")
    if leak is not None and not 0 <= leak.value_si <= 1:
        scope.errors.append(item.problem(place, f"found {leak}; allowed: from 0 to 1, or 0 % to 100 %"))
    return None if leak is None else leak.value_si
