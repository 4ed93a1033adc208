"""Columns of a layered drawing: who stands in which, and in which order from top to bottom.

After Sugiyama, Tagawa and Toda 1981: the nodes are laid in layers by the longest path, a link that passes a
layer gets a bend there, and sweeps put everything near the middle of its neighbours, so that few links cross.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeAlias

import networkx as nx

from circuitkit.draw.network import Link, Network

_SWEEPS = 24


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
        bands: Where instances are kept apart: the band of every item in the layers that they reach; see
            `make_bands`.
    """

    order: tuple[tuple[Item, ...], ...]
    layer_of: Mapping[str, int]
    links: tuple[Link, ...]
    bands: Mapping[Item, int] = field(default_factory=dict)

    def stops(self, link: Link) -> list[Item]:
        """Return the source, the bends and the target of a link, in the direction of the link."""
        return _stops(link, self.layer_of)


def make_layers(network: Network) -> Layers:
    """Make the layers of a circuit: inputs first, outputs last, neurons by the longest path between them."""
    layer_of = _layer_of(network)
    links = tuple(_directed(link, layer_of) for link in network.links)
    segments = {pair for link in links for pair in _segments(_stops(link, layer_of), layer_of)}
    start: list[list[Item]] = [[] for _ in range(max(layer_of.values(), default=0) + 1)]
    for name, layer in layer_of.items():
        start[layer].append(name)
    bends = {item for pair in segments for item in pair if isinstance(item, Bend)}
    position = {name: i for i, name in enumerate(layer_of)}
    for bend in sorted(bends, key=lambda bend: (position[bend.source], bend.layer, bend.way)):
        start[bend.layer].append(bend)
    bands = make_bands(network, layer_of, links, bends)
    order = _fewest_crossings(start, segments, bands)
    return Layers(tuple(tuple(layer) for layer in order), layer_of, links, bands)


def directed_links(network: Network) -> tuple[Link, ...]:
    """Return the links, with which of them go back, where nobody needs the order in the layers."""
    layer_of = _layer_of(network)
    return tuple(_directed(link, layer_of) for link in network.links)


def _directed(link: Link, layer_of: Mapping[str, int]) -> Link:
    backward = link.kind != "readout" and layer_of[link.source] >= layer_of[link.target]
    return replace(link, backward=backward)


def _layer_of(network: Network) -> dict[str, int]:
    """Take the longest path from the inputs; move nodes right to their targets if more links leave.

    In a cycle, synapses from a neuron to one above it in the file do not count: as in the timing `ordered`,
    they bring the value of the last tick.
    """
    names = [node.name for node in network.nodes]
    whole = nx.DiGraph((link.source, link.target) for link in network.links if link.kind != "readout")
    cycles = nx.strongly_connected_components(whole)
    cycle_of = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    position = {name: i for i, name in enumerate(names)}
    forward = nx.DiGraph()
    forward.add_nodes_from(names)
    forward.add_edges_from(
        (source, target)
        for source, target in whole.edges
        if cycle_of[source] != cycle_of[target] or position[source] < position[target]
    )
    readouts = [(link.source, link.target) for link in network.links if link.kind == "readout"]
    forward.add_edges_from(readouts)
    inputs = {node.name for node in network.nodes if node.role == "input"}
    outputs = {node.name for node in network.nodes if node.role == "output"}
    layer = {name: 0 if name in inputs else 1 for name in names}
    ordered = list(nx.topological_sort(forward))
    for name in ordered:
        for target in forward.successors(name):
            layer[target] = max(layer[target], layer[name] + 1)
    neurons = [name for name in names if name not in inputs and name not in outputs]
    last = max([layer[name] for name in outputs] + [layer[name] + 1 for name in neurons], default=1)
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
    """Yield pairs of neighbours in neighbouring layers, the left one first."""
    for one, other in pairwise(stops):
        here, there = layer_at(one, layer_of), layer_at(other, layer_of)
        if here != there:
            yield (one, other) if here < there else (other, one)


def layer_at(item: Item, layer_of: Mapping[str, int]) -> int:
    """Return the layer in which an item stands."""
    return item.layer if isinstance(item, Bend) else layer_of[item]


def make_bands(
    network: Network, layer_of: Mapping[str, int], links: Iterable[Link], bends: Iterable[Bend]
) -> dict[Item, int]:
    """Make the band in which an item stands, one for each instance from top to bottom, so that none mix.

    Only items in layers that some instance reaches have a band; what belongs to no instance and leads to
    none has the one below all others.
    """
    group_of = {node.name: node.group for node in network.nodes}
    inside = [node for node in network.nodes if node.group and node.role not in {"input", "output"}]
    if not inside:
        return {}
    rank = {name: i for i, name in enumerate(dict.fromkeys(node.group for node in inside))}
    covered: set[int] = set()
    for group in rank:
        own = [layer_of[node.name] for node in inside if node.group == group]
        covered |= set(range(min(own), max(own) + 1))
    bands: dict[Item, int] = {}
    for node in network.nodes:
        if layer_of[node.name] in covered:
            bands[node.name] = rank.get(node.group, len(rank))
    leads_to: dict[tuple[str, str], str] = {}
    for link in links:
        leads_to.setdefault((link.source, link.way), group_of[link.target])
    for bend in bends:
        if bend.layer in covered:
            group = group_of[bend.source] or leads_to[bend.source, bend.way]
            bands[bend] = rank.get(group, len(rank))
    return bands


def _fewest_crossings(
    start: list[list[Item]], segments: set[tuple[Item, Item]], bands: Mapping[Item, int]
) -> list[list[Item]]:
    left: dict[Item, list[Item]] = {item: [] for layer in start for item in layer}
    right: dict[Item, list[Item]] = {item: [] for layer in start for item in layer}
    rank = {item: (layer, i) for layer, items in enumerate(start) for i, item in enumerate(items)}
    for one, other in sorted(segments, key=lambda pair: (rank[pair[0]], rank[pair[1]])):
        right[one].append(other)
        left[other].append(one)
    order = [sorted(layer, key=lambda item: bands.get(item, 0)) for layer in start]
    best, fewest = [list(layer) for layer in order], None
    for sweep in range(_SWEEPS):
        forward = sweep % 2 == 0
        neighbours = left if forward else right
        for layer in order if forward else reversed(order):
            _sort_by_neighbours(layer, neighbours, order, bands)
        _swap_neighbours(order, left, right, bands)
        crossings = sum(_crossings(one, other, right) for one, other in pairwise(order))
        if fewest is None or crossings < fewest:
            best, fewest = [list(layer) for layer in order], crossings
    return best


def _sort_by_neighbours(
    layer: list[Item],
    neighbours: Mapping[Item, Sequence[Item]],
    order: Sequence[Sequence[Item]],
    bands: Mapping[Item, int],
) -> None:
    """Sort by band, then by the mean position of the neighbours; who has none keeps the place it has."""
    place = _places(order)
    middle = {
        item: sum(place[each] for each in neighbours[item]) / len(neighbours[item])
        if neighbours[item]
        else place[item]
        for item in layer
    }
    layer.sort(key=lambda item: (bands.get(item, 0), middle[item]))


def _places(order: Iterable[Sequence[Item]]) -> dict[Item, float]:
    """Return position in the layer, from 0 at the top to 1 at the bottom."""
    return {item: (i + 0.5) / len(layer) for layer in order for i, item in enumerate(layer)}


def _swap_neighbours(
    order: Sequence[list[Item]],
    left: Mapping[Item, Sequence[Item]],
    right: Mapping[Item, Sequence[Item]],
    bands: Mapping[Item, int],
) -> None:
    """Swap two neighbours wherever this takes crossings away, until it no longer does."""
    for layer in order:
        place = {item: i for each in order for i, item in enumerate(each)}
        improved = True
        while improved:
            improved = False
            for i in range(len(layer) - 1):
                one, other = layer[i], layer[i + 1]
                if bands.get(one, 0) != bands.get(other, 0):
                    continue
                now = sum(_crossed(side[one], side[other], place) for side in (left, right))
                swapped = sum(_crossed(side[other], side[one], place) for side in (left, right))
                if swapped < now:
                    layer[i], layer[i + 1] = other, one
                    improved = True


def _crossed(above: Iterable[Item], below: Iterable[Item], place: Mapping[Item, int]) -> int:
    """Return crossings of the links of two neighbours, the first of which stands above."""
    lower = sorted(place[item] for item in below)
    return sum(sum(1 for position in lower if position < place[item]) for item in above)


def _crossings(one: Sequence[Item], other: Sequence[Item], right: Mapping[Item, Sequence[Item]]) -> int:
    """Return crossings between two layers: pairs of links whose ends stand in opposite orders."""
    place = {item: i for i, item in enumerate(other)}
    total = 0
    seen: list[int] = []
    for item in one:
        ends = sorted(place[each] for each in right[item])
        total += sum(len(seen) - bisect_right(seen, end) for end in ends)
        for end in ends:
            insort(seen, end)
    return total
