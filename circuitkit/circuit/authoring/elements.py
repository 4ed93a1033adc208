"""A circuit taken apart: each node, synapse, parameter and model with its values, to compare and explain."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from circuitkit.base.units import Unit, format_quantity, parse_unit
from circuitkit.circuit.authoring.flat import endpoint, nodes_of, parameter_unit, weight_unit
from circuitkit.circuit.graph import (
    CircuitGraph,
    Neuron,
    OutputNode,
    PerMember,
    Population,
    Projection,
    Synapse,
)
from circuitkit.circuit.models import NeuronModel, SynapseModel
from circuitkit.circuit.names import node_of
from circuitkit.circuit.resolving.nodes import shown_unit

Fields: TypeAlias = "dict[str, tuple[Any, Unit | None]]"  # a value, and the unit in which it is shown
_TINY = 1e-3
_MILLISECONDS, _PERCENT = parse_unit("ms"), parse_unit("%")


@dataclass(frozen=True)
class Connections:
    """Who is connected with whom in a projection; shown as the number of synapses."""

    count: int
    digest: bytes

    def __str__(self) -> str:
        return str(self.count)


@dataclass(frozen=True)
class Element:
    """A part of a circuit.

    Attributes:
        kind: "circuit", "parameter", "model", "input", "neuron", "population", "output", "synapse",
            "projection" or "readout".
        title: Its name; `q1 -> p1` for a synapse; empty for the circuit.
        fields: Its values by name, with their unit.
        endpoints: The nodes that it joins; empty for a node.
        naming: Fields that name other nodes.
    """

    kind: str
    title: str
    fields: Fields
    endpoints: tuple[str, ...] = ()
    naming: frozenset[str] = field(default=frozenset(("gate",)))


def elements_of(graph: CircuitGraph, renamed: Mapping[str, str] | None = None) -> Iterator[Element]:
    """Yield every part of a circuit, in file order.

    Args:
        graph: The circuit.
        renamed: Other names for its nodes.
    """
    names = renamed or {}

    def called(name: str) -> str:
        base, bracket, rest = name.partition("[")
        return f"{names.get(base, base)}{bracket}{rest}"

    circuit: Fields = {
        "name": (graph.name, None),
        "description": (graph.description, None),
        "timing": (graph.timing, None),
        "control step": (graph.step_s, _MILLISECONDS),
        "substeps": (graph.substeps, None),
    }
    yield Element("circuit", "", circuit)
    for name, quantity in graph.parameters.items():
        yield Element("parameter", name, {"value": (quantity.value_si, quantity.unit)})
    for model in _models(graph):
        yield Element("model", model.name, _model_fields(model))
    for kind, name, fields in _nodes(graph):
        yield Element(kind, called(name), fields)
    yield from _edges(graph, called)


def value_text(value: Any, unit: Unit | None, digits: int = 6) -> str:  # noqa: ANN401 - a number, array or text
    """Write a value out, such as `-80 mm`, or `64 values, 0 mm to 5 mm`; `none` for an empty text."""
    if isinstance(value, str):
        return value or "none"
    if unit is None:
        return str(value)
    if getattr(value, "shape", ()):
        if not value.size:
            return "no values"
        low, high = (format_quantity(float(edge), unit, digits) for edge in (value.min(), value.max()))
        if value.size == 1:
            return low
        return f"{value.size} values, {low} to {high}"
    return format_quantity(float(value), unit, digits)


class Weights:
    """The weights of a circuit as texts."""

    def __init__(self, graph: CircuitGraph) -> None:
        self._nodes = nodes_of(graph)

    def endpoint_units(self, edge: Synapse | Projection) -> tuple[Unit, Unit]:
        """Return the units of the target's activation and of the source."""
        return endpoint(self._nodes, edge.target).activation, endpoint(self._nodes, edge.source).unit

    def text(self, edge: Synapse | Projection, weights: PerMember) -> str:
        """Return weights in SI units, or in the target's if they are tiny otherwise."""
        target, unit = endpoint(self._nodes, edge.target).activation, weight_unit(edge, self._nodes)
        largest = abs(weights) if isinstance(weights, float | int) else float(abs(weights).max(initial=0.0))
        is_tiny = 0 < largest < _TINY and target.dimension == unit.dimension
        return value_text(weights, target if is_tiny else unit)


def _neurons(graph: CircuitGraph) -> tuple[Neuron | Population, ...]:
    return (*graph.neurons, *graph.populations)


def _models(graph: CircuitGraph) -> Iterable[NeuronModel | SynapseModel]:
    """Return the models that the circuit uses, each once."""
    edges: tuple[Synapse | Projection, ...] = (*graph.synapses, *graph.projections)
    found: dict[tuple[str, str], NeuronModel | SynapseModel] = {}
    for node in _neurons(graph):
        found.setdefault(("neuron", node.model.name), node.model)
    for edge in edges:
        found.setdefault(("synapse", edge.model.name), edge.model)
    return found.values()


def _model_fields(model: NeuronModel | SynapseModel) -> Fields:
    """Return the equations of a model."""
    texts: dict[str, object] = {
        "parameters": ", ".join(f"{each.name} [{each.unit_rule}]" for each in model.parameters),
        "method": model.method,
    }
    if isinstance(model, NeuronModel):
        texts["output"] = model.output
        if model.spike is not None:
            texts["spike"] = model.spike.when
            texts |= {f"reset of {name}": each for name, each in model.spike.reset.items()}
    else:
        texts |= {"current": model.current, "sign": model.sign, "per": model.per, "weight": model.weight}
        texts |= {f"jump of {name}": each for name, each in model.jumps.items()}
    texts |= {f"initial {each.name}": each.initial for each in model.states}
    texts |= {f"derivative of {name}": each for name, each in model.derivatives.items()}
    texts |= {f"update of {name}": each for name, each in model.updates.items()}
    return {name: (str(text), None) for name, text in texts.items()}


def _nodes(graph: CircuitGraph) -> Iterator[tuple[str, str, Fields]]:
    """Yield kind, name and values of every node."""
    for node in graph.inputs:
        fields: Fields = {"unit": (node.unit.symbol, None), "from": (node.low, node.unit)}
        yield "input", node.name, fields | {"to": (node.high, node.unit), **_described(node.description)}
    for neuron in graph.neurons:
        yield "neuron", neuron.name, neuron_fields(neuron)
    for population in graph.populations:
        fields = {"size": (population.size, None)}
        yield "population", population.name, fields | neuron_fields(population)
    for output in graph.outputs:
        yield "output", output.name, _output_fields(output)


def _described(description: str) -> Fields:
    return {"description": (description, None)}


def neuron_fields(node: Neuron | Population) -> Fields:
    """Return the values of a neuron or population."""
    unit = node.activation_unit
    fields: Fields = {"model": (node.model.name, None), "role": (node.role, None)}
    fields["unit"] = (unit.symbol, None)  # of the activation
    for parameter in node.model.parameters:
        fields[parameter.name] = (node.parameters[parameter.name], parameter_unit(node, parameter))
    for state in node.model.states:
        if state.name in node.initial:
            fields[f"initial {state.name}"] = (node.initial[state.name], parameter_unit(node, state))
    fields["noise"] = (node.noise, unit)
    return fields | _described(node.description)


def _output_fields(output: OutputNode) -> Fields:
    fields: Fields = {"unit": (output.unit.symbol, None)}
    fields["leak"] = ("", None) if output.leak is None else (output.leak, _PERCENT)
    fields |= {"lower limit": (output.low, output.unit), "upper limit": (output.high, output.unit)}
    return fields | _described(output.description)


def _edges(graph: CircuitGraph, called: Callable[[str], str]) -> Iterator[Element]:
    weights = Weights(graph)
    seen: Counter[tuple[str, str, str]] = Counter()
    edges: tuple[Synapse | Projection, ...] = (*graph.synapses, *graph.projections)
    for edge in edges:
        kind = "synapse" if isinstance(edge, Synapse) else "projection"
        endpoints = called(edge.source), called(edge.target)
        fields = _edge_fields(edge, *weights.endpoint_units(edge))
        if edge.gate:
            fields["gate"] = (called(edge.gate), None)
        seen[kind, *endpoints] += 1
        number = seen[kind, *endpoints]
        title = " -> ".join(endpoints) + (f" ({number})" if number > 1 else "")
        yield Element(kind, title, fields, tuple(map(node_of, endpoints)))
    for output in graph.outputs:
        for name, weight in output.readout:
            endpoints = called(name), called(output.name)
            fields = {"weight": (weight, output.unit)}
            yield Element("readout", " -> ".join(endpoints), fields, tuple(map(node_of, endpoints)))


def _edge_fields(edge: Synapse | Projection, target: Unit, source: Unit) -> Fields:
    """Give the values of a synapse or projection; those at rest (no delay, the static model) are left out."""
    model = edge.model
    dimension = model.weight.dimension(target.dimension, source.dimension)
    fields: Fields = {}
    if isinstance(edge, Projection):
        fields["synapses"] = (_connections(edge), None)
    weight = edge.weight if isinstance(edge, Synapse) else edge.weights
    fields["weight"] = (weight, target if dimension == target.dimension else dimension.si_unit)
    if model.name != "static":
        fields["model"] = (model.name, None)
    for parameter in model.parameters:
        rule = parameter.unit_rule.dimension(target.dimension, source.dimension, dimension)
        fields[parameter.name] = (edge.parameters[parameter.name], shown_unit(parameter, rule, target))
    for state in model.states:
        if state.name in edge.initial:
            rule = state.unit_rule.dimension(target.dimension, source.dimension, dimension)
            fields[f"initial {state.name}"] = (edge.initial[state.name], shown_unit(state, rule, target))
    if edge.delay_s:
        fields["delay"] = (edge.delay_s, _MILLISECONDS)
    return fields


def _connections(edge: Projection) -> Connections:
    digest = hashlib.sha256(edge.indptr.tobytes() + edge.sources.tobytes())
    return Connections(len(edge.sources), digest.digest())
