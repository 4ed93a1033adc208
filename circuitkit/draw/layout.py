"""Where everything stands in the drawing of a network, before anything is drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode
from circuitkit.draw.labels import Label, label_texts, place_labels
from circuitkit.draw.lanes import Lanes
from circuitkit.draw.layers import Bend, Item, Layers, Link, layer_at, make_layers
from circuitkit.draw.placing import place_vertically
from circuitkit.draw.routing import (
    Column,
    End,
    Route,
    backward_route,
    forward_route,
    ports,
)
from circuitkit.draw.shapes import Box, text_size
from circuitkit.draw.style import NORMAL, SMALL, number

_NODE_GAP = 18.0
_NODE_HEIGHT = 26.0
_PORT, _OUT_PORT = 10.0, 6.0
_PAD = 7.0
_LINE = 1.25  # distance of lines of text in units of their size
_GAP_LEAST, _GAP_MOST, _GAP_SLOPE = 48.0, 170.0, 0.75
_ATTEMPTS = 5
_WIDER = 1.35


@dataclass(frozen=True)
class NodeBox:
    """A node in the drawing.

    Attributes:
        name: Its name.
        role: "input", "excitatory", "inhibitory" or "output".
        shape: Its outline.
        lines: Its text, the name first.
        box: Its extent.
    """

    name: str
    role: str
    shape: str
    lines: tuple[str, ...]
    box: Box


@dataclass(frozen=True)
class Layout:
    """A drawing's geometry; y downwards, [pt].

    Attributes:
        nodes: By name.
        routes: The lines of all links.
        labels: The weights that are shown.
        homeless: Links whose weight found no free place.
        width: Of everything, [pt].
        height: Of everything, [pt].
    """

    nodes: Mapping[str, NodeBox]
    routes: tuple[Route, ...]
    labels: tuple[Label, ...]
    homeless: tuple[Link, ...]
    width: float
    height: float

    @property
    def cost(self) -> tuple[int, int]:
        """Weights without a place, and how much of other lines the others hide."""
        return len(self.homeless), sum(label.hides for label in self.labels)


def layout_circuit(graph: CircuitGraph) -> Layout:
    """Arrange a circuit from left to right; gaps grow until every label has a place of its own."""
    layers = make_layers(graph)
    texts = label_texts(graph, layers.links)
    best = _arrange(graph, layers, texts, 1.0)
    for attempt in range(1, _ATTEMPTS):
        if best.cost == (0, 0):
            break
        best = min(best, _arrange(graph, layers, texts, _WIDER**attempt), key=lambda layout: layout.cost)
    return best


def _arrange(graph: CircuitGraph, layers: Layers, texts: Mapping[Link, str], stretch: float) -> Layout:
    arrivals = Counter(link.target for link in layers.links if not link.backward)
    lanes = Lanes(layers)
    every: tuple[InputNode | Neuron | OutputNode, ...] = (*graph.inputs, *graph.neurons, *graph.outputs)
    faces = {node.name: _face(node, arrivals[node.name], lanes.width(node.name)) for node in every}
    reach: dict[Item, tuple[float, float]] = {}
    for layer in layers.order:
        for item in layer:
            reach[item] = (2.0, 2.0) if isinstance(item, Bend) else _reach(faces[item], lanes)
    pairs = {pair for link in layers.links for pair in _pairs(link, layers)}
    heights = place_vertically(layers.order, sorted(pairs, key=str), reach, _NODE_GAP)
    columns = _columns(layers, faces, heights, texts, stretch)
    nodes = {
        name: _stand(face, columns[layers.layer_of[name]], heights[name]) for name, face in faces.items()
    }
    routes = _routes(layers, nodes, heights, columns, lanes)
    labels, homeless = place_labels(texts, routes, [node.box for node in nodes.values()])
    bottom = max((heights[item] + reach[item][1] for item in heights), default=0.0)
    return Layout(nodes, tuple(routes), tuple(labels), tuple(homeless), columns[-1].right, bottom)


def _face(node: InputNode | Neuron | OutputNode, arrivals: int, least_width: float) -> NodeBox:
    """A node with its size, at the origin."""
    lines: tuple[str, ...]
    match node:
        case InputNode():
            role, shape, lines = "input", "tag", (node.name, f"[{node.unit}]")
        case OutputNode():
            role, shape, lines = "output", "rectangle", (node.name, f"[{node.unit}]")
            if node.leak is not None:
                lines = (*lines, f"sum, leak {number(100 * node.leak)} %" if node.leak else "sum")
        case Neuron():
            role, lines = node.role, (node.name,)
            shape = "capsule" if node.role == "excitatory" else "octagon"
    widths = [text_size(lines[0], NORMAL)[0], *(text_size(line, SMALL)[0] for line in lines[1:])]
    tall = NORMAL * _LINE + SMALL * _LINE * (len(lines) - 1) + 2 * _PAD
    height = max(_NODE_HEIGHT, tall if len(lines) > 1 else 0.0, _PORT * arrivals + 8.0)
    extra = {"tag": 10.0, "capsule": 4.0}.get(shape, 2.0)
    wide = max(widths) + 2 * _PAD + (extra if len(lines) > 1 else 0.0)
    width = max(_NODE_HEIGHT, least_width, wide)
    return NodeBox(node.name, role, shape, lines, Box(0.0, 0.0, width, height))


def _reach(face: NodeBox, lanes: Lanes) -> tuple[float, float]:
    half, beyond = face.box.height / 2, lanes.reach(face.name)
    return (half + beyond, half) if lanes.side[face.name] < 0 else (half, half + beyond)


def _pairs(link: Link, layers: Layers) -> list[tuple[Item, Item]]:
    stops = layers.stops(link)
    return [
        (one, other)
        for one, other in pairwise(stops)
        if layer_at(one, layers.layer_of) != layer_at(other, layers.layer_of)
    ]


def _columns(
    layers: Layers,
    faces: Mapping[str, NodeBox],
    heights: Mapping[Item, float],
    texts: Mapping[Link, str],
    stretch: float,
) -> list[Column]:
    """Columns as wide as their widest node; gaps as wide as their steepest line and their labels ask for."""
    count = len(layers.order)
    rise, words = [0.0] * count, [0.0] * count
    for link in layers.links:
        for one, other in _pairs(link, layers):
            gap = min(layer_at(one, layers.layer_of), layer_at(other, layers.layer_of))
            rise[gap] = max(rise[gap], abs(heights[one] - heights[other]))
        if link in texts:
            gap = min(layers.layer_of[link.target], layers.layer_of[link.source] + 1) - 1
            words[max(gap, 0)] = max(words[max(gap, 0)], text_size(texts[link], SMALL)[0])
    columns: list[Column] = []
    x = 0.0
    for layer, items in enumerate(layers.order):
        width = max((faces[item].box.width for item in items if isinstance(item, str)), default=0.0)
        columns.append(Column(x, x + width))
        free = min(max(_GAP_LEAST, _GAP_SLOPE * rise[layer]), _GAP_MOST) + 1.2 * words[layer]
        x += width + free * stretch
    return columns


def _stand(face: NodeBox, column: Column, height: float) -> NodeBox:
    box = Box((column.left + column.right) / 2, height, face.box.width, face.box.height)
    return NodeBox(face.name, face.role, face.shape, face.lines, box)


def _routes(
    layers: Layers,
    nodes: Mapping[str, NodeBox],
    heights: Mapping[Item, float],
    columns: list[Column],
    lanes: Lanes,
) -> list[Route]:
    arrive, leave = _offsets(layers, nodes, heights)
    routes = []
    for link in layers.links:
        source, target = nodes[link.source], nodes[link.target]
        ends = (layers.layer_of[link.source], layers.layer_of[link.target])
        bends = [(item.layer, heights[item]) for item in layers.stops(link) if isinstance(item, Bend)]
        if not link.backward:
            departure = End(source.box, source.shape, leave[link])
            arrival = End(target.box, target.shape, arrive[link])
            routes.append(forward_route(link, departure, arrival, bends, columns, ends))
            continue
        out, back = lanes.ends(link, (source.box, source.shape), (target.box, target.shape))
        routes.append(backward_route(link, out, back, bends, columns, ends))
    return routes


def _offsets(
    layers: Layers, nodes: Mapping[str, NodeBox], heights: Mapping[Item, float]
) -> tuple[dict[Link, float], dict[Link, float]]:
    """Where forward links arrive on the left and leave on the right; those to one bend leave as one."""
    arrive: dict[Link, float] = {}
    leave: dict[Link, float] = {}
    forward = [link for link in layers.links if not link.backward]
    for name in layers.layer_of:
        arrive |= ports(
            {link: heights[layers.stops(link)[-2]] for link in forward if link.target == name}, _PORT
        )
        first = {link: layers.stops(link)[1] for link in forward if link.source == name}
        spread = 0.0 if nodes[name].shape == "tag" else _OUT_PORT  # a tag's lines leave from its tip
        places = ports({item: heights[item] for item in first.values()}, spread)
        leave |= {link: places[item] for link, item in first.items()}
    return arrive, leave
