"""Words on the lines: where they hide nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from circuitkit.draw.network import Link
from circuitkit.draw.routing import HEAD, Route
from circuitkit.draw.shapes import Box, block_size
from circuitkit.draw.style import SMALL

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
