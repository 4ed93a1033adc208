"""Columns of a layered drawing: who stands in which, and in which order from top to bottom.

After Sugiyama, Tagawa and Toda 1981: the nodes are laid in layers by the longest path, a link that passes a
layer gets a bend there, and sweeps put everything near the middle of its neighbours, so that few links cross.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import networkx as nx

from circuitkit.circuit.graph import CircuitGraph

_SWEEPS = 24


@dataclass(frozen=True)
class Link:
    """A line of the drawing: a synapse or a readout.

    Attributes:
        source: Name of a node.
        target: Name of a node.
        kind: "sensorial", "excitatory", "inhibitory" or "readout".
        weight: Signed weight, [SI].
        backward: Whether it goes back inside a cycle, to the same layer or to one further left.
    """

    source: str
    target: str
    kind: str
    weight: float
    backward: bool

    @property
    def way(self) -> str:
        """Links of one source that go the same way share their bends."""
        return "readout" if self.kind == "readout" else "backward" if self.backward else "forward"


@dataclass(frozen=True)
class Bend:
    """Where links of a source pass a layer: its synapses forward, its synapses backward, or its readouts."""

    source: str
    layer: int
    way: str


Item: TypeAlias = str | Bend  # a node's name, or a bend


@dataclass(frozen=True)
class Layers:
    """Layers from left to right.

    Attributes:
        order: The items of each layer from top to bottom.
        layer_of: Layer of each node.
        links: All links.
    """

    order: tuple[tuple[Item, ...], ...]
    layer_of: Mapping[str, int]
    links: tuple[Link, ...]

    def stops(self, link: Link) -> list[Item]:
        """The source, the bends and the target of a link, in the direction of the link."""
        return _stops(link, self.layer_of)


def make_layers(graph: CircuitGraph) -> Layers:
    """The layers of a circuit: inputs first, outputs last, neurons by the longest path between them."""
    layer_of = _layer_of(graph)
    links = _links(graph, layer_of)
    segments = {pair for link in links for pair in _segments(_stops(link, layer_of), layer_of)}
    start: list[list[Item]] = [[] for _ in range(max(layer_of.values(), default=0) + 1)]
    for name, layer in layer_of.items():
        start[layer].append(name)
    bends = {item for pair in segments for item in pair if isinstance(item, Bend)}
    position = {name: i for i, name in enumerate(layer_of)}
    for bend in sorted(bends, key=lambda bend: (position[bend.source], bend.layer, bend.way)):
        start[bend.layer].append(bend)
    order = _fewest_crossings(start, segments)
    return Layers(tuple(tuple(layer) for layer in order), layer_of, links)


def _links(graph: CircuitGraph, layer_of: Mapping[str, int]) -> tuple[Link, ...]:
    def backward(source: str, target: str) -> bool:
        return layer_of[source] >= layer_of[target]

    synapses = (
        Link(s.source, s.target, s.kind, s.weight, backward(s.source, s.target)) for s in graph.synapses
    )
    readouts = (
        Link(neuron, output.name, "readout", weight, backward=False)
        for output in graph.outputs
        for neuron, weight in output.readout
    )
    return (*synapses, *readouts)


def _layer_of(graph: CircuitGraph) -> dict[str, int]:
    """The longest path from the inputs; then nodes move right, next to their targets, where more links leave.

    In a cycle, synapses from a neuron to one above it in the file do not count: as in the timing `ordered`,
    they bring the value of the last tick.
    """
    network = nx.DiGraph((synapse.source, synapse.target) for synapse in graph.synapses)
    cycles = nx.strongly_connected_components(network)
    cycle_of = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    position = {name: i for i, name in enumerate(graph.names())}
    forward = nx.DiGraph()
    forward.add_nodes_from(graph.names())
    forward.add_edges_from(
        (source, target)
        for source, target in network.edges
        if cycle_of[source] != cycle_of[target] or position[source] < position[target]
    )
    forward.add_edges_from((neuron, output.name) for output in graph.outputs for neuron, _ in output.readout)
    inputs = {node.name for node in graph.inputs}
    outputs = {output.name for output in graph.outputs}
    layer = {name: 0 if name in inputs else 1 for name in graph.names()}
    ordered = list(nx.topological_sort(forward))
    for name in ordered:
        for target in forward.successors(name):
            layer[target] = max(layer[target], layer[name] + 1)
    last = max(
        [layer[output] for output in outputs] + [layer[neuron.name] + 1 for neuron in graph.neurons],
        default=1,
    )
    layer |= dict.fromkeys(outputs, last)
    for name in reversed(ordered):
        if name in inputs or name in outputs or forward.in_degree(name) >= max(1, forward.out_degree(name)):
            continue
        layer[name] = min((layer[target] - 1 for target in forward.successors(name)), default=layer[name])
    return layer


def _stops(link: Link, layer_of: Mapping[str, int]) -> list[Item]:
    begin, end = layer_of[link.source], layer_of[link.target]
    between = range(begin - 1, end, -1) if link.backward else range(begin + 1, end)
    return [link.source, *(Bend(link.source, layer, link.way) for layer in between), link.target]


def _segments(stops: Sequence[Item], layer_of: Mapping[str, int]) -> Iterable[tuple[Item, Item]]:
    """Pairs of neighbours in neighbouring layers, the left one first."""
    for one, other in pairwise(stops):
        here, there = layer_at(one, layer_of), layer_at(other, layer_of)
        if here != there:
            yield (one, other) if here < there else (other, one)


def layer_at(item: Item, layer_of: Mapping[str, int]) -> int:
    """The layer in which an item stands."""
    return item.layer if isinstance(item, Bend) else layer_of[item]


def _fewest_crossings(start: list[list[Item]], segments: set[tuple[Item, Item]]) -> list[list[Item]]:
    left: dict[Item, list[Item]] = {item: [] for layer in start for item in layer}
    right: dict[Item, list[Item]] = {item: [] for layer in start for item in layer}
    rank = {item: (layer, i) for layer, items in enumerate(start) for i, item in enumerate(items)}
    for one, other in sorted(segments, key=lambda pair: (rank[pair[0]], rank[pair[1]])):
        right[one].append(other)
        left[other].append(one)
    best, fewest = [list(layer) for layer in start], None
    order = [list(layer) for layer in start]
    for sweep in range(_SWEEPS):
        forward = sweep % 2 == 0
        neighbours = left if forward else right
        for layer in order if forward else reversed(order):
            _sort_by_neighbours(layer, neighbours, order)
        _swap_neighbours(order, left, right)
        crossings = sum(_crossings(one, other, right) for one, other in pairwise(order))
        if fewest is None or crossings < fewest:
            best, fewest = [list(layer) for layer in order], crossings
    return best


def _sort_by_neighbours(
    layer: list[Item], neighbours: Mapping[Item, Sequence[Item]], order: Sequence[Sequence[Item]]
) -> None:
    """Sort by the mean position of the neighbours; who has none keeps the place among the others."""
    place = _places(order)
    middle = {
        item: sum(place[each] for each in neighbours[item]) / len(neighbours[item])
        if neighbours[item]
        else place[item]
        for item in layer
    }
    layer.sort(key=lambda item: middle[item])


def _places(order: Iterable[Sequence[Item]]) -> dict[Item, float]:
    """Position in the layer, from 0 at the top to 1 at the bottom."""
    return {item: (i + 0.5) / len(layer) for layer in order for i, item in enumerate(layer)}


def _swap_neighbours(
    order: Sequence[list[Item]], left: Mapping[Item, Sequence[Item]], right: Mapping[Item, Sequence[Item]]
) -> None:
    """Swap two neighbours wherever this takes crossings away, until it no longer does."""
    for layer in order:
        place = {item: i for each in order for i, item in enumerate(each)}
        improved = True
        while improved:
            improved = False
            for i in range(len(layer) - 1):
                one, other = layer[i], layer[i + 1]
                now = sum(_crossed(side[one], side[other], place) for side in (left, right))
                swapped = sum(_crossed(side[other], side[one], place) for side in (left, right))
                if swapped < now:
                    layer[i], layer[i + 1] = other, one
                    improved = True


def _crossed(above: Iterable[Item], below: Iterable[Item], place: Mapping[Item, int]) -> int:
    """Crossings of the links of two neighbours, the first of which stands above."""
    lower = sorted(place[item] for item in below)
    return sum(sum(1 for position in lower if position < place[item]) for item in above)


def _crossings(one: Sequence[Item], other: Sequence[Item], right: Mapping[Item, Sequence[Item]]) -> int:
    """Crossings between two layers: pairs of links whose ends stand in opposite orders."""
    place = {item: i for i, item in enumerate(other)}
    total = 0
    seen: list[int] = []
    for item in one:
        ends = sorted(place[each] for each in right[item])
        total += sum(len(seen) - bisect_right(seen, end) for end in ends)
        for end in ends:
            insort(seen, end)
    return total
