"""The picture of a circuit, as `draw_circuit` makes it, lit by its neurons' activity, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.draw.graph import circuit_figure
from circuitkit.draw.layers import directed_links
from circuitkit.draw.marks import line_ids, node_id
from circuitkit.draw.network import Network, make_network
from circuitkit.draw.style import KIND_COLOUR, NORMAL, POINTS_PER_INCH, house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FAINT = 0.28  # opacity of a line that carries nothing
_MOST_PARTS = 160  # each is drawn once by itself; of larger circuits only the neurons light up
_DARK = 110.0  # on a darker ground words are white
_SEEN = 0.02  # a lesser activity is not seen

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class _Part:
    """A part of the drawing that can be lit.

    Attributes:
        source: The node whose activity lights it.
        rows: Where it lies in the picture.
        columns: The same.
        cover: How far it covers each pixel; shape (h, w, 1).
        colour: When it is fully lit; shape (3,).
    """

    source: str
    rows: slice
    columns: slice
    cover: NDArray[np.float32]
    colour: NDArray[np.float32]


def lit_network(graph: CircuitGraph, width: int, height: int, least_letters: float) -> LitNetwork | None:
    """A circuit's picture in at most so many pixels.

    Args:
        graph: The circuit.
        width: Of the picture at most, [pixels].
        height: Of the picture at most, [pixels].
        least_letters: Height of the letters at least, [pixels].

    Returns:
        The picture; None where its letters would be smaller.
    """
    network = make_network(graph)
    with house_style():
        figure = circuit_figure(network, with_legend=False)
        inches = figure.get_size_inches()
        figure.set_dpi(min(width / inches[0], height / inches[1]))
        if NORMAL / POINTS_PER_INCH * figure.get_dpi() < least_letters:
            return None
        return LitNetwork(network, figure)


class LitNetwork:
    """A circuit's picture whose neurons and lines are the stronger the more active a neuron is.

    Attributes:
        boxes: Left, upper, right and lower edge of each input and output in the picture, [pixels].
        width: Of the picture, [pixels].
    """

    def __init__(self, network: Network, figure: Figure) -> None:
        """Draw the circuit once, and each of its parts alone; inside `house_style`."""
        self._parts, self._still, words = _layers(figure, network)
        self._written = np.flatnonzero(words)  # pixels; the others need not be looked at for words
        self._words = words.reshape(-1, 1)[self._written]
        ends = [node for node in network.nodes if node.role in {"input", "output"}]
        artists = {artist.get_gid(): artist for artist in figure.axes[0].patches}
        height, self.width = self._still.shape[:2]
        self.boxes = {}
        for node in ends:
            box = artists[node_id(node.name)].get_window_extent()
            self.boxes[node.name] = (box.x0, height - box.y1, box.x1, height - box.y0)

    def picture(self, shares: Mapping[str, float]) -> Image:
        """The picture under some activity by node, from 0 to 1. Shape (height, width, 3)."""
        image = self._still.copy()
        for part in self._parts:
            share = shares.get(part.source, 0.0)
            if share > _SEEN:
                view = image[part.rows, part.columns]
                view += part.cover * share * (part.colour - view)
        pixels = image.reshape(-1, 3)
        ground = pixels[self._written]
        dark = ground.sum(axis=1, keepdims=True) < 3 * _DARK
        ink = np.where(dark, np.float32(255.0), np.float32(20.0))
        pixels[self._written] = ground + self._words * (ink - ground)
        return image.astype(np.uint8)


def node_columns(graph: CircuitGraph, names: Sequence[str]) -> dict[str, list[int]]:
    """Where the neurons, and the members of populations, stand among recorded names; by node."""
    known = {name: i for i, name in enumerate(names)}
    nodes = {each.name: [each.name] for each in graph.neurons}
    nodes |= {each.name: [f"{each.name}[{i}]" for i in range(each.size)] for each in graph.populations}
    found = {node: [known[name] for name in each if name in known] for node, each in nodes.items()}
    return {node: columns for node, columns in found.items() if columns}


def _layers(figure: Figure, network: Network) -> tuple[list[_Part], NDArray[np.float32], NDArray[np.float32]]:
    """What can be lit, the picture at rest, and how far words cover each pixel."""
    axes = figure.axes[0]
    patches, texts = list(axes.patches), list(axes.texts)
    lines, neurons = _lit_by(network, patches)
    chosen = [*lines, *neurons] if len(lines) + len(neurons) <= _MOST_PARTS else neurons
    _show(texts, shown=False)
    parts = [part for each in chosen if (part := _part(figure, patches, *each)) is not None]
    _show(patches)
    for _, _, drawn in lines:
        for patch in drawn:
            patch.set_alpha(_FAINT)
    still = _drawn(figure)
    _show(patches, shown=False)
    _show(texts)
    words = 1.0 - _drawn(figure).min(axis=2) / 255.0
    return parts, still, words.astype(np.float32)


_Lit: TypeAlias = (
    "list[tuple[str, str, list[Any]]]"  # the node that lights patches, their colour, the patches
)


def _lit_by(network: Network, patches: list[Any]) -> tuple[_Lit, _Lit]:
    """The lines and the neurons of the drawing."""
    by_id: dict[str, list[Any]] = {}
    for patch in patches:
        by_id.setdefault(patch.get_gid() or "", []).append(patch)
    neurons = [
        (node.name, KIND_COLOUR[node.role], by_id.get(node_id(node.name), []))
        for node in network.nodes
        if node.role in KIND_COLOUR
    ]
    lines = [
        (
            link.source,
            KIND_COLOUR[link.kind],
            [each for name in line_ids(link) for each in by_id.get(name, [])],
        )
        for link in directed_links(network)
    ]
    return lines, neurons


def _show(artists: list[Any], *, shown: bool = True) -> None:
    for artist in artists:
        artist.set_visible(shown)


def _part(figure: Figure, patches: list[Any], source: str, colour: str, drawn: list[Any]) -> _Part | None:
    """One part drawn alone in black on white: how far it covers each pixel."""
    if not drawn:
        return None
    _show(patches, shown=False)
    kept = []
    for patch in drawn:
        kept.append((patch, patch.get_edgecolor(), patch.get_facecolor()))
        patch.set_visible(True)
        patch.set_edgecolor("black")
        if patch.get_fill():
            patch.set_facecolor("black")
    cover = 1.0 - _drawn(figure).min(axis=2, keepdims=True) / 255.0
    for patch, edge, face in kept:
        patch.set_edgecolor(edge)
        patch.set_facecolor(face)
    rows, columns = (np.flatnonzero(cover[..., 0].any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    where = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], dtype=np.float32)
    return _Part(source, *where, cover[where].astype(np.float32), rgb)


def _drawn(figure: Figure) -> NDArray[np.float32]:
    canvas: Any = figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(np.float32)
