"""What a picture of a circuit shows: nodes for inputs, neurons, populations and outputs, and lines between.

A population is one node and a projection one line, however large they are. What the other modules of this
package arrange and paint is made here, with all its words: values in the units in which one writes them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from circuitkit.base.units import DIMENSIONLESS, Unit
from circuitkit.circuit.graph import (
    CircuitGraph,
    InputNode,
    Neuron,
    OutputNode,
    PerMember,
    Population,
    Projection,
    Synapse,
)
from circuitkit.circuit.models import ModelParameter, UnitRule
from circuitkit.draw.style import number

_SINGLE = 1
_SHOWN_PARAMETERS = 40


@dataclass(frozen=True)
class Node:
    """A node of the drawing.

    Attributes:
        name: Its name in the circuit.
        role: "input", "excitatory", "inhibitory" or "output".
        lines: Its text, the name first, without that of its group.
        details: Everything about it, for the pointer.
        size: Number of neurons.
        group: Name of the instance of a file that it belongs to; empty for none.
    """

    name: str
    role: str
    lines: tuple[str, ...]
    details: str
    size: int = _SINGLE
    group: str = ""


@dataclass(frozen=True)
class Link:
    """A line of the drawing: synapses, a readout, or what a neuron gates.

    Attributes:
        source: Name of a node.
        target: Name of a node.
        kind: "sensorial", "excitatory", "inhibitory", "readout" or "gate".
        label: What stands on the line, up to two lines of text; empty if it follows from the line.
        details: Everything about it, for the pointer.
        number: Counts the links from this source to this target, from 0.
        backward: Whether it goes back inside a cycle, to the same layer or to one further left.
    """

    source: str
    target: str
    kind: str
    label: str = ""
    details: str = ""
    number: int = 0
    backward: bool = False

    @property
    def way(self) -> str:
        """Links of one source that go the same way share their bends."""
        if self.kind in {"readout", "gate"}:
            return self.kind
        return "backward" if self.backward else "forward"


@dataclass(frozen=True)
class Network:
    """What a picture shows.

    Attributes:
        name: Of the circuit.
        description: Of the circuit.
        nodes: Inputs, neurons, populations, outputs, each in file order.
        links: Synapses, projections, gates, readouts.
    """

    name: str
    description: str
    nodes: tuple[Node, ...]
    links: tuple[Link, ...]


def make_network(graph: CircuitGraph) -> Network:
    """Find what a picture of a circuit shows."""
    endpoints = _Endpoints(graph)
    nodes = [_input(each) for each in graph.inputs]
    neurons: tuple[Neuron | Population, ...] = (*graph.neurons, *graph.populations)
    nodes += [_neuron(each) for each in neurons]
    nodes += [_output(each) for each in graph.outputs]
    links = [*_synapses(graph, endpoints), *_projections(graph, endpoints), *_readouts(graph)]
    seen: Counter[tuple[str, str]] = Counter()
    numbered = []
    for link in links:
        numbered.append(replace(link, number=seen[link.source, link.target]))
        seen[link.source, link.target] += 1
    return Network(graph.name, graph.description, tuple(nodes), tuple(numbered))


def node_of(name: str) -> str:
    """Return the population of a member such as `ring[3]`, or the name itself."""
    return name.partition("[")[0]


def _split(name: str) -> tuple[str, str]:
    """Return the outermost instance that a name belongs to, and the rest of the name."""
    group, dot, rest = name.partition(".")
    return (group, rest) if dot else ("", name)


def _input(node: InputNode) -> Node:
    span = f"from {node.unit.from_si(node.low):g} to {node.unit.from_si(node.high):g}"
    details = _joined(f"{node.name}: input [{node.unit}], {span}", node.description)
    return Node(node.name, "input", (node.name, f"[{node.unit}]"), details)


def _output(node: OutputNode) -> Node:
    lines: tuple[str, ...] = (node.name, f"[{node.unit}]")
    grows = ""
    if node.leak is not None:
        lines = (*lines, f"sum, leak {number(100 * node.leak)} %" if node.leak else "sum")
        grows = f"; summed up, leak {number(100 * node.leak)} % a step"
    details = _joined(f"{node.name}: output [{node.unit}]{grows}", node.description)
    return Node(node.name, "output", lines, details)


def _neuron(node: Neuron | Population) -> Node:
    group, short = _split(node.name)
    size = node.size if isinstance(node, Population) else _SINGLE
    count = f"{size:,} neurons".replace(",", "\N{NARROW NO-BREAK SPACE}")
    head = f"{node.name}: {node.role}, {node.model.name}"
    equations = [f"d{name}/dt = {each}" for name, each in node.model.derivatives.items()]
    equations += [f"{name} <- {each}" for name, each in node.model.updates.items()]
    details = _joined(
        f"{head}, {count}" if isinstance(node, Population) else head,
        node.description,
        ", ".join(parameter_texts(node)[:_SHOWN_PARAMETERS]),
        *equations,
        f"output = {node.model.output}",
    )
    lines = (short, count) if isinstance(node, Population) else (short,)
    return Node(node.name, node.role, lines, details, size, group)


def _synapses(graph: CircuitGraph, endpoints: _Endpoints) -> Iterator[Link]:
    """Yield a line for every synapse; those between members of the same nodes share one if they are alike."""
    alike: dict[tuple[str, ...], list[Synapse]] = {}
    for each in graph.synapses:
        key = (node_of(each.source), node_of(each.target), each.kind, each.model.name, f"{each.delay_s}")
        alike.setdefault((*key, each.gate), []).append(each)
    for group in alike.values():
        first = group[0]
        words = []
        if len(group) > 1:
            words = [f"{len(group)} synapses"]
        elif "[" in first.source + first.target:
            words = [" to ".join(f"[{n.partition('[')[2]}" for n in (first.source, first.target) if "[" in n)]
        weights = np.array([each.weight for each in group])
        yield from _lines(first, weights, words, endpoints)


def _projections(graph: CircuitGraph, endpoints: _Endpoints) -> Iterator[Link]:
    for each in graph.projections:
        rule = rule_text(each, endpoints.size(each.source), endpoints.size(each.target))
        yield from _lines(each, each.weights, [rule], endpoints)


def _lines(
    edge: Synapse | Projection, weights: PerMember, words: Sequence[str], endpoints: _Endpoints
) -> Iterator[Link]:
    """Yield the line of synapses that are alike but for their weights, and that of their gate."""
    source, target = node_of(edge.source), node_of(edge.target)
    model = edge.model
    weight = endpoints.weight(edge, weights)
    more = [] if model.name == "static" else [model.name.replace("_", " ")]
    if edge.delay_s:
        more.append(f"{number(edge.delay_s * 1e3)} ms")
    values = [*([] if _is_plain(weights, edge.kind) else [weight]), *more]
    label = "\n".join(", ".join(parts) for parts in (words, values) if parts)
    head = f"{source} to {target}: {edge.kind}, {', '.join([*words, f'weight {weight}', *more])}"
    parameters = (
        f"{each.name} {quantity_text(edge.parameters[each.name], each.unit)}"
        for each in model.parameters
        if each.unit is not None
    )
    yield Link(source, target, edge.kind, label, _joined(head, ", ".join(parameters)))
    if edge.gate:
        details = f"{edge.gate} gates {source} to {target}"
        yield Link(node_of(edge.gate), target, "gate", f"\N{MULTIPLICATION SIGN} {source}", details)


class _Endpoints:
    """The nodes that synapses and projections join, by name."""

    def __init__(self, graph: CircuitGraph) -> None:
        self._inputs = {each.name: each for each in graph.inputs}
        self._neurons: dict[str, Neuron | Population] = {each.name: each for each in graph.neurons}
        self._neurons |= {each.name: each for each in graph.populations}

    def size(self, name: str) -> int:
        """Find how many neurons a node has."""
        node = self._neurons.get(name)
        return node.size if isinstance(node, Population) else _SINGLE

    def weight(self, edge: Synapse | Projection, weights: PerMember) -> str:
        """Return weights as text, in the unit in which the file has the first of them."""
        source = self._inputs.get(node_of(edge.source))
        above = self._neurons[node_of(edge.target)].activation_unit
        below = DIMENSIONLESS if source is None else source.unit
        dimension = edge.model.weight.dimension(above.dimension, below.dimension)
        if edge.weight_unit is not None and edge.weight_unit.dimension == dimension:
            return quantity_text(weights, edge.weight_unit)
        if dimension == above.dimension.times(below.dimension, -1):
            return weight_text(weights, above, below)
        return quantity_text(weights, dimension.si_unit)


def _is_plain(weights: PerMember, kind: str) -> bool:
    """Check whether a line needs no weight: 1, or -1 if it inhibits, in SI units."""
    return bool(np.all(weights == 1.0) or (kind == "inhibitory" and np.all(weights == -1.0)))


def _readouts(graph: CircuitGraph) -> Iterator[Link]:
    """Yield a line for everything that an output reads; members of one population share theirs."""
    for output in graph.outputs:
        read: dict[str, list[PerMember]] = {}
        for name, weight in output.readout:
            read.setdefault(node_of(name), []).append(weight)
        for name, weights in read.items():
            every = weights[0] if len(weights) == 1 else np.concatenate([np.atleast_1d(w) for w in weights])
            text = quantity_text(every, output.unit)
            label = "" if _is_plain(every, "readout") else text
            yield Link(
                name, output.name, "readout", label, f"{name} to {output.name}: readout, weight {text}"
            )


def _joined(*parts: str) -> str:
    return "\n".join(part for part in parts if part)


_DASH = "\N{EN DASH}"


def parameter_text(parameter: ModelParameter, value_si: PerMember, activation: Unit) -> str:
    """Return a parameter's name and value, such as `shift 79.9 mm` or `slope 0.1 /mm`.

    Args:
        parameter: The parameter.
        value_si: Its value or values, [SI].
        activation: Unit of the activation of the neuron that has it.
    """
    unit = parameter.unit or _unit(parameter.unit_rule, activation)
    return f"{parameter.name} {quantity_text(value_si, unit)}"


def parameter_texts(node: Neuron | Population) -> list[str]:
    """Return all parameters of a neuron or population."""
    values, unit = node.parameters, node.activation_unit
    return [parameter_text(each, values[each.name], unit) for each in node.model.parameters]


def quantity_text(value_si: PerMember, unit: Unit) -> str:
    """Return SI values in a unit, as one prints them: `-80 mm`, `0.1 /mm`, `7`, `0 to 3 mm`."""
    symbol = unit.symbol.removeprefix("1") if unit.symbol.startswith("1/") else unit.symbol
    shown = _span_text(value_si, unit)
    return shown if symbol == "1" else f"{shown} {symbol}"


def _span_text(value_si: PerMember, unit: Unit) -> str:
    if isinstance(value_si, float | int):
        return number(value_si / unit.scale)
    if not value_si.size:
        return _DASH
    low, high = (number(float(edge) / unit.scale) for edge in (value_si.min(), value_si.max()))
    return low if low == high else f"{low} to {high}"


def weight_text(weight_si: PerMember, target: Unit, source: Unit) -> str:
    """Return a weight in the unit of its target over the unit of its source, such as `-2 mm/N`."""
    if source.dimension == target.dimension:
        return quantity_text(weight_si, DIMENSIONLESS)
    return quantity_text(weight_si, target.over(source))


def rule_text(projection: Projection, n_source: int, n_target: int) -> str:
    """Say who is connected with whom: `all to all`, `one to one`, `10 from each`, `5000 synapses`."""
    count = len(projection.sources)
    degrees = np.diff(projection.indptr)
    if count == n_source * n_target:
        if n_source == 1 or n_target == 1:
            return "to all" if n_source == 1 else "from all"
        return "all to all"
    targets = np.repeat(np.arange(n_target), degrees)
    if count == n_source == n_target and np.array_equal(projection.sources, targets):
        return "one to one"
    others = n_source == n_target and (degrees == n_source - 1).all()
    if others and projection.source == projection.target and not (projection.sources == targets).any():
        return "all to all others"
    if degrees.size and (degrees == degrees[0]).all():
        return f"{degrees[0]} to each"
    return f"{100 * count / (n_source * n_target):.2g} % of all pairs"


def _unit(rule: UnitRule, activation: Unit) -> Unit:
    """Return the unit of a rule: made of the activation's unit where that is possible, else in SI."""
    dimension = rule.dimension(activation.dimension)
    if dimension == activation.dimension:
        return activation
    reciprocal = DIMENSIONLESS.over(activation)
    return reciprocal if reciprocal.dimension == dimension else dimension.si_unit
