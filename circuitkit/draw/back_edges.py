"""Tracks above or below a node for the links that go back, and the ports where they meet it.

Ports run from right to left and tracks from the node outwards, in the same order: first the loop of a neuron
to itself, then what comes in, then what goes out. So what comes from the right never crosses its neighbours.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from circuitkit.draw.layers import Layers
from circuitkit.draw.network import Link
from circuitkit.draw.routing import Endpoint
from circuitkit.draw.shapes import Box

_FIRST, _NEXT = 20.0, 9.0  # distance of tracks from their node and from each other, [pt]
_PORT = 10.0  # distance of ports, [pt]
_LOOP_PORTS = 2


class BackEdges:
    """The tracks of all nodes.

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
