"""A circuit as a graph of networkx, neuron by neuron."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import networkx as nx
import numpy as np

from circuitkit.circuit.names import Names

if TYPE_CHECKING:
    from circuitkit.circuit.graph import CircuitGraph, PerMember, Projection


def to_networkx(graph: CircuitGraph) -> nx.DiGraph:
    """See `CircuitGraph.to_networkx`."""
    view = nx.DiGraph(name=graph.name)
    view.add_nodes_from((node.name, {"kind": "input", "node": node}) for node in graph.inputs)
    view.add_nodes_from((node.name, {"kind": "neuron", "node": node}) for node in graph.neurons)
    for population in graph.populations:
        members = Names((), [(population.name, population.size)])
        view.add_nodes_from((member, {"kind": "neuron", "node": population}) for member in members)
    view.add_nodes_from((node.name, {"kind": "output", "node": node}) for node in graph.outputs)
    sizes = {population.name: population.size for population in graph.populations}
    for source, target, weight, kind in _edges(graph, sizes):
        if view.has_edge(source, target):
            view.edges[source, target]["weight"] += weight
        else:
            view.add_edge(source, target, weight=weight, kind=kind)
    return view


def _edges(graph: CircuitGraph, sizes: dict[str, int]) -> Iterator[tuple[str, str, float, str]]:
    for synapse in graph.synapses:
        yield synapse.source, synapse.target, synapse.weight, synapse.kind
    for projection in graph.projections:
        yield from _edges_of(projection, sizes)
    for output in graph.outputs:
        for name, weights in output.readout:
            for member, weight in zip(_members(name, sizes), _each(weights, sizes.get(name, 1)), strict=True):
                yield member, output.name, weight, "readout"


def _edges_of(projection: Projection, sizes: dict[str, int]) -> Iterator[tuple[str, str, float, str]]:
    sources, targets = _members(projection.source, sizes), _members(projection.target, sizes)
    weights = _each(projection.weights, len(projection.sources))
    rows = np.repeat(np.arange(len(targets)), np.diff(projection.indptr))
    for source, target, weight in zip(projection.sources.tolist(), rows.tolist(), weights, strict=True):
        yield sources[source], targets[target], weight, projection.kind


def _members(name: str, sizes: dict[str, int]) -> Names:
    """The members of a population, or the one node of this name."""
    return Names((), [(name, sizes[name])]) if name in sizes else Names((name,), ())


def _each(values: PerMember, size: int) -> list[float]:
    """One value for each."""
    found: list[float] = np.broadcast_to(values, (size,)).tolist()
    return found
