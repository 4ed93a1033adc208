"""One neuron of a circuit by itself: what it is, what comes in, where it goes, and where that is written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from circuitkit.base.errors import UnknownNameError
from circuitkit.circuit.authoring.elements import Weights, neuron_fields, value_text
from circuitkit.circuit.expressions.expression import COMPARISONS, Binary
from circuitkit.circuit.graph import (
    CircuitGraph,
    Neuron,
    Origin,
    PerMember,
    Population,
    Projection,
    Synapse,
    same,
)
from circuitkit.circuit.models import NeuronModel

_STATIC = "static"


@dataclass(frozen=True)
class Connection:
    """A synapse, or the synapses of a projection, as one of its ends sees it.

    Attributes:
        other: The node at the other end; what is gated, if `kind` is "gate".
        kind: "sensorial", "excitatory", "inhibitory", "readout" or "gate".
        count: How many synapses.
        weight: Their weight or weights with the unit; empty for a gate.
        model: Name of the synapse model.
        delay_s: Their delay, [s].
        gate: What gates them; empty for nothing.
        origin: Where they are written.
    """

    other: str
    kind: str
    count: int
    weight: str
    model: str
    delay_s: float
    gate: str
    origin: Origin


@dataclass(frozen=True)
class Explanation:
    """One neuron, one member of a population, or a population.

    Attributes:
        name: As asked for.
        node: The neuron or population.
        index: Which member; None for all of them, or for a neuron.
        incoming: What comes in.
        outgoing: Where it goes: to neurons, to outputs, and what it gates.
    """

    name: str
    node: Neuron | Population
    index: int | None
    incoming: tuple[Connection, ...]
    outgoing: tuple[Connection, ...]

    @property
    def model(self) -> NeuronModel:
        """Its model."""
        return self.node.model

    def equations(self) -> dict[str, str]:
        """Return the equations of the model by what they give, such as `output` or `dv/dt`."""
        model = self.model
        found = {f"d{name}/dt": str(each) for name, each in model.derivatives.items()}
        found |= {f"next {name}": str(each) for name, each in model.updates.items()}
        if model.spike is not None:
            when = model.spike.when
            compared = isinstance(when, Binary) and when.operator in COMPARISONS
            found["spikes when"] = str(when) if compared else f"{when} > 0"
            found |= {f"then {name}": str(each) for name, each in model.spike.reset.items()}
        return {**found, "output": str(model.output)}

    def values(self) -> dict[str, str]:
        """Return parameters, starts of states and noise, with their units."""
        fields = neuron_fields(self.node)
        if same(self.node.noise, 0.0):
            del fields["noise"]
        return {
            name: value_text(_at(value, self.index), unit)
            for name, (value, unit) in fields.items()
            if name not in _NO_VALUES
        }


_NO_VALUES = frozenset(("model", "role", "unit", "description", "size"))


def explain(graph: CircuitGraph, name: str) -> Explanation:
    """Explain a neuron.

    Args:
        graph: The circuit.
        name: Of a neuron, a population, or a member such as `ring[3]`.

    Raises:
        UnknownNameError: There is nothing of this name; the message lists what there is.
    """
    nodes: dict[str, Neuron | Population] = {each.name: each for each in graph.neurons}
    nodes |= {each.name: each for each in graph.populations}
    base, index = name, None
    if name not in nodes and name in graph.neuron_names:
        base, _, number = name.partition("[")
        index = int(number.removesuffix("]"))
    if base not in nodes:
        kind = "neuron"
        raise UnknownNameError(kind, name, nodes)
    found = _Neighbours(graph, base, name, index)
    return Explanation(name, nodes[base], index, tuple(found.incoming()), tuple(found.outgoing()))


class _Neighbours:
    """Looks for the synapses of one node or member."""

    def __init__(self, graph: CircuitGraph, base: str, name: str, index: int | None) -> None:
        self.graph, self.base, self.name, self.index = graph, base, name, index
        self.weights = Weights(graph)

    def incoming(self) -> Iterator[Connection]:
        """Find what leads to it."""
        for synapse in self.graph.synapses:
            if self.is_meant(synapse.target):
                yield self.single(synapse, synapse.source)
        for each in self.graph.projections:
            if each.target == self.base:
                begin, end = 0, len(each.sources)
                if self.index is not None:
                    begin, end = int(each.indptr[self.index]), int(each.indptr[self.index + 1])
                yield self.many(each, each.source, end - begin, _part(each.weights, slice(begin, end)))

    def outgoing(self) -> Iterator[Connection]:
        """Find what it leads to, what it gates, and what reads it."""
        for synapse in self.graph.synapses:
            if self.is_meant(synapse.source):
                yield self.single(synapse, synapse.target)
            if synapse.gate and self.is_meant(synapse.gate):
                yield _gated(f"{synapse.source} -> {synapse.target}", 1, synapse.origin)
        for each in self.graph.projections:
            if each.source == self.base:
                chosen = slice(None) if self.index is None else each.sources == self.index
                count = len(each.sources[chosen])
                yield self.many(each, each.target, count, _part(each.weights, chosen))
            if each.gate and self.is_meant(each.gate):
                yield _gated(f"{each.source} -> {each.target}", len(each.sources), each.origin)
        for output in self.graph.outputs:
            for name, weight in output.readout:
                if self.is_meant(name) or name == self.base:
                    text = value_text(_at(weight, self.index if name == self.base else None), output.unit)
                    yield Connection(output.name, "readout", 1, text, _STATIC, 0.0, "", output.origin)

    def is_meant(self, name: str) -> bool:
        """Check whether a name is that of the node, or of one of its members if all of it is asked for."""
        return name == self.name or (self.index is None and name.startswith(f"{self.base}["))

    def single(self, synapse: Synapse, other: str) -> Connection:
        """Return a synapse."""
        weight = self.weights.text(synapse, synapse.weight)
        model, delay = synapse.model.name, synapse.delay_s
        return Connection(other, synapse.kind, 1, weight, model, delay, synapse.gate, synapse.origin)

    def many(self, each: Projection, other: str, count: int, weights: PerMember) -> Connection:
        """Return the synapses of a projection."""
        text = self.weights.text(each, weights) if count else ""
        return Connection(
            other, each.kind, count, text, each.model.name, each.delay_s, each.gate, each.origin
        )


def _gated(what: str, count: int, origin: Origin) -> Connection:
    return Connection(what, "gate", count, "", _STATIC, 0.0, "", origin)


def _part(values: PerMember, which: Any) -> PerMember:  # noqa: ANN401 - any index of an array
    return values if isinstance(values, float | int) or not values.shape else values[which]


def _at(values: Any, index: int | None) -> Any:  # noqa: ANN401 - a number, an array or a text
    return values if index is None or not getattr(values, "shape", None) else values[index]
