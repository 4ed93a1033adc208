"""Lines between the nodes: level where they pass a column, curved in the gaps between columns.

So no line meets a node that it does not belong to, whatever the circuit: in a column every line has a height
of its own that `place_vertically` keeps free, and in a gap there are no nodes. A link that goes back inside a
cycle leaves at the top or bottom of its source and comes in at the top or bottom of its target, on tracks
that belong to the two nodes.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from circuitkit.draw.layers import Layers
from circuitkit.draw.network import Link
from circuitkit.draw.shapes import Box, Point, inset

FloatArray: TypeAlias = npt.NDArray[np.float64]
_Key = TypeVar("_Key", bound=Hashable)
HEAD = 8.0  # length of an arrow head, [pt]
_TURN = 10.0
_STEP = 2.0
_TINY = 1e-6  # shorter pieces of a line are left out, [pt]


@dataclass(frozen=True)
class Column:
    """The part of the width that a layer takes, [pt]."""

    left: float
    right: float


@dataclass(frozen=True)
class Endpoint:
    """Where a link meets a node.

    Attributes:
        box: The node.
        shape: Its outline, see `inset`.
        offset: Along the side where the link meets it, from its middle, [pt].
        side: 0 for the left or right side, -1 for the upper, 1 for the lower side.
        track: Height of the track if it meets the upper or lower side, [pt].
    """

    box: Box
    shape: str
    offset: float = 0.0
    side: int = 0
    track: float = 0.0

    @property
    def x(self) -> float:
        """Where a link from above or below meets the node, [pt]."""
        return self.box.x + self.offset

    @property
    def rim(self) -> float:
        """Height of the outline where a link from above or below meets it, [pt]."""
        edge = self.box.height / 2 - inset(self.shape, self.box, self.offset, vertical=True)
        return self.box.y + self.side * edge


@dataclass(frozen=True)
class Route:
    """The line of a link.

    Attributes:
        link: What it stands for.
        points: Points of the line up to the tip, y downwards, [pt].
        codes: One letter a point: M move, L line, C cubic curve.
        heading: Direction in which it arrives, a unit vector.
    """

    link: Link
    points: tuple[Point, ...]
    codes: str
    heading: Point

    @property
    def tip(self) -> Point:
        """Where it meets the target, [pt]."""
        return self.points[-1]

    @cached_property
    def polyline(self) -> FloatArray:
        """Points on the line about 2 pt apart, shape (n, 2), [pt]."""
        points = np.array(self.points)
        pieces = [points[:1]]
        i = 1
        while i < len(points):
            count = 3 if self.codes[i] == "C" else 1
            pieces.append(_trace(points[i - 1 : i + count]))
            i += count
        return np.concatenate(pieces)


def _trace(corners: FloatArray) -> FloatArray:
    """Return points on a Bezier curve of any degree, without the first one (de Casteljau)."""
    count = max(1, math.ceil(np.hypot(*np.diff(corners, axis=0).T).sum() / _STEP))
    t = np.arange(1, count + 1)[:, np.newaxis] / count
    rows = [np.broadcast_to(corner, (count, 2)) for corner in corners]
    while len(rows) > 1:
        rows = [(1 - t) * one + t * other for one, other in pairwise(rows)]
    return rows[0]


class _Pen:
    """Collects the points of a line."""

    def __init__(self, x: float, y: float) -> None:
        self.points: list[Point] = [(x, y)]
        self.codes = "M"

    def line(self, x: float, y: float) -> None:
        if math.dist(self.points[-1], (x, y)) > _TINY:
            self.points.append((x, y))
            self.codes += "L"

    def curve(self, *points: Point) -> None:
        self.points += points
        self.codes += "CCC"

    def swing(self, x: float, y: float) -> None:
        """Add a curve to (x, y) that is level at both ends."""
        x0, y0 = self.points[-1]
        if abs(y - y0) < _TINY:
            self.line(x, y)
        else:
            middle = (x0 + x) / 2
            self.curve((middle, y0), (middle, y), (x, y))

    def turn(self, corner: Point, end: Point) -> None:
        """Add a quarter of a circle to `end`, around the inside of `corner`."""
        start = self.points[-1]
        first = (start[0] + 0.55 * (corner[0] - start[0]), start[1] + 0.55 * (corner[1] - start[1]))
        second = (end[0] + 0.55 * (corner[0] - end[0]), end[1] + 0.55 * (corner[1] - end[1]))
        self.curve(first, second, end)

    def route(self, link: Link, heading: Point) -> Route:
        return Route(link, tuple(self.points), self.codes, heading)


def forward_route(
    link: Link,
    source: Endpoint,
    target: Endpoint,
    bends: Sequence[tuple[int, float]],
    columns: Sequence[Column],
    layers: tuple[int, int],
) -> Route:
    """From the right side of the source to the left side of the target.

    Args:
        link: The link.
        source: Where it leaves.
        target: Where it arrives.
        bends: Layer and height of every bend between.
        columns: All columns.
        layers: Those of source and target.
    """
    start = source.box.y + source.offset
    pen = _Pen(source.box.right - inset(source.shape, source.box, source.offset, vertical=False), start)
    pen.line(columns[layers[0]].right, start)
    for layer, height in bends:
        pen.swing(columns[layer].left, height)
        pen.line(columns[layer].right, height)
    height = target.box.y + target.offset
    pen.swing(columns[layers[1]].left - HEAD, height)
    pen.line(target.box.left + inset(target.shape, target.box, target.offset, vertical=False), height)
    return pen.route(link, (1.0, 0.0))


def backward_route(
    link: Link,
    source: Endpoint,
    target: Endpoint,
    bends: Sequence[tuple[int, float]],
    columns: Sequence[Column],
    layers: tuple[int, int],
) -> Route:
    """From the top or bottom of the source, to the left, to that of the target; see `forward_route`."""
    pen = _Pen(source.x, source.rim)
    radius = (source.x - target.x) / 2 if link.source == link.target else _TURN
    pen.line(source.x, source.track - source.side * radius)
    pen.turn((source.x, source.track), (source.x - radius, source.track))
    if link.source == link.target:
        return _come_in(pen, link, target, radius)
    pen.line(columns[layers[0]].left, source.track)
    if layers[0] == layers[1]:
        x = columns[layers[0]].left
        bulge = min(24.0, 8.0 + 0.25 * abs(source.track - target.track))
        pen.curve((x - bulge, source.track), (x - bulge, target.track), (x, target.track))
        return _come_in(pen, link, target, -_TURN)
    for layer, height in bends:
        pen.swing(columns[layer].right, height)
        pen.line(columns[layer].left, height)
    pen.swing(columns[layers[1]].right, target.track)
    return _come_in(pen, link, target, _TURN)


def _come_in(pen: _Pen, link: Link, target: Endpoint, radius: float) -> Route:
    """Along the target's track from the right (from the left if `radius` is negative), then onto the node."""
    x = target.x
    pen.line(x + radius, target.track)
    pen.turn((x, target.track), (x, target.track - target.side * abs(radius)))
    pen.line(x, target.rim)
    return pen.route(link, (0.0, -float(target.side)))


def ports(heights: Mapping[_Key, float], spacing: float) -> dict[_Key, float]:
    """Return offsets along one side of a node, in the order of where the lines go to or come from, [pt]."""
    ordered = sorted(heights, key=lambda key: heights[key])
    return {key: spacing * (i - (len(ordered) - 1) / 2) for i, key in enumerate(ordered)}


_FIRST, _NEXT = 20.0, 9.0  # distance of tracks from their node and from each other, [pt]
_PORT = 10.0  # distance of ports, [pt]
_LOOP_PORTS = 2


class BackEdges:
    """Tracks above or below the nodes for the links that go back, and the ports where they meet a node.

    Ports run from right to left and tracks from the node outwards, in the same order: first the loop of a
    neuron to itself, then what comes in, then what goes out. So what comes from the right never crosses its
    neighbours.

    Attributes:
        side: -1 if the tracks of a node lie above it, 1 if below: outwards from the middle of its layer.
    """

    def __init__(self, layers: Layers) -> None:
        self.side: dict[str, int] = {}
        for layer in layers.order:
            names = [item for item in layer if isinstance(item, str)]
            self.side |= {name: -1 if 2 * i < len(names) else 1 for i, name in enumerate(names)}
        back = [link for link in layers.links if link.backward]
        self._arriving: dict[Link, tuple[int, int]] = {}  # track and port
        self._leaving: dict[str, tuple[int, int]] = {}
        self._tracks: Counter[str] = Counter()
        self._ports: Counter[str] = Counter()
        self._add_arriving(link for link in back if link.source == link.target)
        self._add_arriving(link for link in back if link.source != link.target)
        for link in back:
            if link.source != link.target and link.source not in self._leaving:
                self._leaving[link.source] = self._take(link.source, 1)

    def _add_arriving(self, links: Iterable[Link]) -> None:
        for link in links:
            loop = link.source == link.target
            self._arriving[link] = self._take(link.target, _LOOP_PORTS if loop else 1)
            if loop and link.label:  # room for its label
                self._tracks[link.target] += 1 + 2 * link.label.count("\n")

    def _take(self, name: str, ports: int) -> tuple[int, int]:
        """Return the next track and the last of the next ports of a node."""
        track = self._tracks[name]
        self._tracks[name] += 1
        self._ports[name] += ports
        return track, self._ports[name] - 1

    def width(self, name: str) -> float:
        """Find how wide a node must be for its ports, [pt]."""
        return _PORT * self._ports[name] + 8.0

    def reach(self, name: str) -> float:
        """Find how far beyond the node its tracks reach, [pt]."""
        return _FIRST + _NEXT * (self._tracks[name] - 1) + 2.0 if self._tracks[name] else 0.0

    def endpoints(
        self, link: Link, source: tuple[Box, str], target: tuple[Box, str]
    ) -> tuple[Endpoint, Endpoint]:
        """Find where a link that goes back leaves and arrives; nodes are given by their box and shape."""
        track, port = self._arriving[link]
        out = (track, port - 1) if link.source == link.target else self._leaving[link.source]
        return self._endpoint(link.source, source, out), self._endpoint(link.target, target, (track, port))

    def _endpoint(self, name: str, node: tuple[Box, str], place: tuple[int, int]) -> Endpoint:
        (box, shape), (track, port) = node, place
        offset = _PORT * ((self._ports[name] - 1) / 2 - port)
        height = box.y + self.side[name] * (box.height / 2 + _FIRST + _NEXT * track)
        return Endpoint(box, shape, offset, self.side[name], height)
