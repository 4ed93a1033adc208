"""Where everything stands in the drawing of a network, before it is drawn: nodes, lines, words on lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from circuitkit.draw.layers import Bend, Item, Layers, layer_at, make_layers
from circuitkit.draw.network import Link, Network, Node
from circuitkit.draw.placing import place_vertically, separate_bands
from circuitkit.draw.routing import (
    HEAD,
    BackEdges,
    Column,
    Endpoint,
    Route,
    backward_route,
    forward_route,
    ports,
)
from circuitkit.draw.shapes import LINE_HEIGHT, Box, block_size, text_size
from circuitkit.draw.style import NORMAL, SMALL

_NODE_GAP = 18.0
_NODE_HEIGHT = 26.0
_PORT, _OUT_PORT = 10.0, 6.0
_PAD = 7.0
_SHAPES = {"input": "tag", "output": "rectangle", "excitatory": "capsule", "inhibitory": "octagon"}
_STACK = 3.0  # by how much the outlines of a population stand apart, [pt]
_GROUP_PAD, _GROUP_TITLE = 10.0, 13.0  # around the nodes of an instance, and for its name, [pt]
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
        stack: By how much two further outlines stick out behind it, to the right and up, [pt]; 0 for none.
    """

    name: str
    role: str
    shape: str
    lines: tuple[str, ...]
    box: Box
    stack: float = 0.0


@dataclass(frozen=True)
class GroupBox:
    """The frame around the neurons of an instance of a file, with its name at the upper left."""

    name: str
    box: Box


@dataclass(frozen=True)
class Layout:
    """A drawing's geometry; y downwards, [pt].

    Attributes:
        nodes: By name.
        routes: The lines of all links.
        labels: The weights that are shown.
        homeless: Links whose words found no free place.
        width: Of everything, [pt].
        height: Of everything, [pt].
        groups: The frames of instances.
    """

    nodes: Mapping[str, NodeBox]
    routes: tuple[Route, ...]
    labels: tuple[Label, ...]
    homeless: tuple[Link, ...]
    width: float
    height: float
    groups: tuple[GroupBox, ...] = ()

    @property
    def cost(self) -> tuple[int, int]:
        """Weights without a place, and how much of other lines the others hide."""
        return len(self.homeless), sum(label.hides for label in self.labels)


def arrange(network: Network) -> Layout:
    """Arrange a network from left to right; gaps grow until every label has a place of its own."""
    layers = make_layers(network)
    best = _arrange(network, layers, 1.0)
    for attempt in range(1, _ATTEMPTS):
        if best.cost == (0, 0):
            break
        best = min(best, _arrange(network, layers, _WIDER**attempt), key=lambda layout: layout.cost)
    return best


def _arrange(network: Network, layers: Layers, stretch: float) -> Layout:
    arrivals = Counter(link.target for link in layers.links if not link.backward)
    back_edges = BackEdges(layers)
    faces = {
        node.name: _face(node, arrivals[node.name], back_edges.width(node.name)) for node in network.nodes
    }
    reach: dict[Item, tuple[float, float]] = {}
    for layer in layers.order:
        for item in layer:
            reach[item] = (2.0, 2.0) if isinstance(item, Bend) else _reach(faces[item], back_edges)
    pairs = {pair for link in layers.links for pair in _pairs(link, layers)}
    heights = place_vertically(layers.order, sorted(pairs, key=str), reach, _NODE_GAP)
    if layers.bands:
        free = 2 * _GROUP_PAD + _GROUP_TITLE + _NODE_GAP / 2
        heights = separate_bands(layers.order, heights, reach, layers.bands, free)
        heights = {item: height + _GROUP_PAD + _GROUP_TITLE for item, height in heights.items()}
    columns = _columns(layers, faces, heights, stretch)
    nodes = {
        name: replace(face, box=_stand(face.box, columns[layers.layer_of[name]], heights[name]))
        for name, face in faces.items()
    }
    routes = _routes(layers, nodes, heights, columns, back_edges)
    labels, homeless = place_labels(routes, [_whole(node) for node in nodes.values()])
    groups = _groups(network, layers, columns, {item: heights[item] for item in layers.bands}, reach)
    bottom = max((heights[item] + reach[item][1] for item in heights), default=0.0)
    bottom = max([bottom, *(group.box.bottom for group in groups)])
    return Layout(nodes, tuple(routes), tuple(labels), tuple(homeless), columns[-1].right, bottom, groups)


def _groups(
    network: Network,
    layers: Layers,
    columns: list[Column],
    heights: Mapping[Item, float],
    reach: Mapping[Item, tuple[float, float]],
) -> tuple[GroupBox, ...]:
    """Return the frame of every instance: its columns across, its band in height."""
    found = []
    for group in dict.fromkeys(node.group for node in network.nodes if node.group):
        names = [node.name for node in network.nodes if node.group == group]
        band = layers.bands[names[0]]
        own = [item for item in heights if layers.bands[item] == band]
        left = min(columns[layers.layer_of[name]].left for name in names) - _GROUP_PAD
        right = max(columns[layers.layer_of[name]].right for name in names) + _GROUP_PAD
        top = min(heights[item] - reach[item][0] for item in own) - _GROUP_PAD - _GROUP_TITLE
        bottom = max(heights[item] + reach[item][1] for item in own) + _GROUP_PAD
        found.append(GroupBox(group, Box((left + right) / 2, (top + bottom) / 2, right - left, bottom - top)))
    return tuple(found)


def _face(node: Node, arrivals: int, least_width: float) -> NodeBox:
    """Return a node with its size, at the origin."""
    lines, shape = node.lines, _SHAPES[node.role]
    widths = [text_size(lines[0], NORMAL)[0], *(text_size(line, SMALL)[0] for line in lines[1:])]
    tall = NORMAL * LINE_HEIGHT + SMALL * LINE_HEIGHT * (len(lines) - 1) + 2 * _PAD
    height = max(_NODE_HEIGHT, tall if len(lines) > 1 else 0.0, _PORT * arrivals + 8.0)
    extra = {"tag": 10.0, "capsule": 4.0}.get(shape, 2.0)
    wide = max(widths) + 2 * _PAD + (extra if len(lines) > 1 else 0.0)
    width = max(_NODE_HEIGHT, least_width, wide)
    return NodeBox(
        node.name, node.role, shape, lines, Box(0.0, 0.0, width, height), _STACK if node.size > 1 else 0.0
    )


def _whole(node: NodeBox) -> Box:
    """Return the extent of a node with the outlines behind it."""
    more = 2 * node.stack
    return Box(node.box.x + more / 2, node.box.y - more / 2, node.box.width + more, node.box.height + more)


def _rear(node: NodeBox) -> Box:
    """Give the hindmost outline of a node, which lines from above meet and lines to the right leave from."""
    return replace(node.box, x=node.box.x + 2 * node.stack, y=node.box.y - 2 * node.stack)


def _reach(face: NodeBox, back_edges: BackEdges) -> tuple[float, float]:
    half, beyond, stack = face.box.height / 2, back_edges.reach(face.name), 2 * face.stack
    if back_edges.side[face.name] < 0:
        return half + stack + beyond, half
    return half + stack, half + beyond


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
    stretch: float,
) -> list[Column]:
    """Make columns as wide as their widest node, gaps as wide as lines and labels ask for."""
    count = len(layers.order)
    rise, words = [0.0] * count, [0.0] * count
    for link in layers.links:
        for one, other in _pairs(link, layers):
            gap = min(layer_at(one, layers.layer_of), layer_at(other, layers.layer_of))
            rise[gap] = max(rise[gap], abs(heights[one] - heights[other]))
        if link.label:
            gap = min(layers.layer_of[link.target], layers.layer_of[link.source] + 1) - 1
            words[max(gap, 0)] = max(words[max(gap, 0)], block_size(link.label, SMALL)[0])
    columns: list[Column] = []
    x = 0.0
    for layer, items in enumerate(layers.order):
        width = max((_width(faces[item]) for item in items if isinstance(item, str)), default=0.0)
        columns.append(Column(x, x + width))
        free = min(max(_GAP_LEAST, _GAP_SLOPE * rise[layer]), _GAP_MOST) + 1.3 * words[layer]
        x += width + free * stretch
    return columns


def _width(face: NodeBox) -> float:
    return face.box.width + 4 * face.stack


def _stand(box: Box, column: Column, height: float) -> Box:
    return Box((column.left + column.right) / 2, height, box.width, box.height)


def _routes(
    layers: Layers,
    nodes: Mapping[str, NodeBox],
    heights: Mapping[Item, float],
    columns: list[Column],
    back_edges: BackEdges,
) -> list[Route]:
    arrive, leave = _offsets(layers, nodes, heights)
    routes = []
    for link in layers.links:
        source, target = nodes[link.source], nodes[link.target]
        ends = (layers.layer_of[link.source], layers.layer_of[link.target])
        bends = [(item.layer, heights[item]) for item in layers.stops(link) if isinstance(item, Bend)]
        if not link.backward:
            departure = Endpoint(_rear(source), source.shape, leave[link])
            arrival = Endpoint(target.box, target.shape, arrive[link])
            routes.append(forward_route(link, departure, arrival, bends, columns, ends))
            continue
        meets = [
            (_rear(node) if back_edges.side[node.name] < 0 else node.box, node.shape)
            for node in (source, target)
        ]
        out, back = back_edges.endpoints(link, meets[0], meets[1])
        routes.append(backward_route(link, out, back, bends, columns, ends))
    return routes


def _offsets(
    layers: Layers, nodes: Mapping[str, NodeBox], heights: Mapping[Item, float]
) -> tuple[dict[Link, float], dict[Link, float]]:
    """Find where forward links arrive on the left and leave on the right; those to one bend leave as one."""
    arrive: dict[Link, float] = {}
    leave: dict[Link, float] = {}
    forward = [link for link in layers.links if not link.backward]
    for name in layers.layer_of:
        arrive |= ports(
            {link: heights[layers.stops(link)[-2]] for link in forward if link.target == name}, _PORT
        )
        first = {link: layers.stops(link)[1] for link in forward if link.source == name}
        port = 0.0 if nodes[name].shape == "tag" else _OUT_PORT  # a tag's lines leave from its tip
        places = ports({item: heights[item] for item in first.values()}, port)
        leave |= {link: places[item] for link, item in first.items()}
    return arrive, leave


_MARGIN = 1.5
_CANDIDATES = 48


@dataclass(frozen=True)
class Label:
    """The words on a line.

    Attributes:
        link: The link.
        text: The words, on one line of text or two.
        box: Extent of the text.
        hides: How many points of other lines lie under it.
    """

    link: Link
    text: str
    box: Box
    hides: int


def place_labels(routes: Sequence[Route], nodes: Sequence[Box]) -> tuple[list[Label], list[Link]]:
    """Put every label on its line where it covers no node, no label, and as few other lines as possible.

    Args:
        routes: All lines.
        nodes: Extents of all nodes.

    Returns:
        The labels, and the links whose label found no free place.
    """
    cloud = _Cloud(routes)
    placed: list[Label] = []
    homeless: list[Link] = []
    for i, route in sorted(enumerate(routes), key=lambda each: len(each[1].polyline)):
        if not route.link.label:
            continue
        taken = [*nodes, *(label.box for label in placed)]
        label = _best_place(route.link.label, route, cloud.without(i), taken)
        if label is None:
            homeless.append(route.link)
        else:
            placed.append(label)
    return placed, homeless


def _best_place(text: str, route: Route, others: Callable[[Box], int], taken: Sequence[Box]) -> Label | None:
    """Find the place that hides least of other lines, then the nearest to three fifths of the way."""
    width, height = (size + 2 * _MARGIN for size in block_size(text, SMALL))
    line = route.polyline
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    found: Label | None = None
    least = (0, 0.0)
    for at in np.linspace(HEAD, max(HEAD, way[-1] - HEAD - 4.0), _CANDIDATES).tolist():
        x, y = (float(np.interp(at, way, line[:, axis])) for axis in (0, 1))
        if route.link.source == route.link.target:  # a loop is too small to carry its label: beyond it
            x = (route.tip[0] + float(line[0, 0])) / 2
            top = line[:, 1].min() if route.heading[1] > 0 else line[:, 1].max()
            y = float(top) - route.heading[1] * (height / 2 + 0.5)
        box = Box(x, y, width, height)
        if any(box.overlaps(other, _MARGIN) for other in taken):
            continue
        cost = (others(box), abs(at / float(way[-1]) - (0.5 if route.heading[0] == 0.0 else 0.6)))
        if found is None or cost < least:
            found, least = Label(route.link, text, box, cost[0]), cost
    return found


class _Cloud:
    """Points on all lines, sorted by x, so that those in a box are found without looking at the others."""

    def __init__(self, routes: Sequence[Route]) -> None:
        points = np.concatenate([np.empty((0, 2)), *(route.polyline for route in routes)])
        owners = np.repeat(np.arange(len(routes)), [len(route.polyline) for route in routes])
        order = np.argsort(points[:, 0], kind="stable")
        self._x, self._y, self._owner = points[order, 0], points[order, 1], owners[order]

    def without(self, owner: int) -> Callable[[Box], int]:
        """Return a function that counts the points of other lines in a box or within 1 pt of it."""

        def count(box: Box) -> int:
            begin, end = np.searchsorted(self._x, (box.left - 1.0, box.right + 1.0))
            near = np.abs(self._y[begin:end] - box.y) < box.height / 2 + 1.0
            return int(np.count_nonzero(near & (self._owner[begin:end] != owner)))

        return count
