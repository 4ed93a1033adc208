"""The marks of a drawing on matplotlib axes: nodes, lines with their heads, text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from circuitkit.draw.layout import GroupBox, NodeBox
from circuitkit.draw.network import Link
from circuitkit.draw.routing import Route
from circuitkit.draw.shapes import LINE_HEIGHT, Outline, Point, capsule, octagon, rectangle, tag
from circuitkit.draw.style import (
    EXCITATORY,
    GREY,
    INHIBITORY,
    INK,
    KIND_COLOUR,
    NORMAL,
    PAPER,
    ROLE_FILL,
    SMALL,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

_OUTLINES = {"capsule": capsule, "octagon": octagon, "rectangle": rectangle, "tag": tag}
_ROLE_RIM = {"input": GREY, "excitatory": EXCITATORY, "inhibitory": INHIBITORY, "output": INK}
_WIDTH = 1.3
_RIM = 1.6  # white beside a line that crosses another one
_HEAD_LENGTH, _HEAD_HALF, _BAR_HALF, _OPEN_HALF = 7.5, 3.2, 4.2, 3.4


def node_id(name: str) -> str:
    """Return identifier of a node in an SVG."""
    return f"node-{name}"


def line_ids(link: Link) -> tuple[str, str, str]:
    """Return identifiers of the parts of a line in an SVG: the stroke, its white rim, its head."""
    name = f"{link.source}-{link.target}" + (f"-{link.number}" if link.number else "")
    return f"line-{name}", f"rim-{name}", f"head-{name}"


def add_node(axes: Axes, node: NodeBox, shift: Point) -> None:
    """Add a node with its text."""
    from matplotlib.patches import PathPatch  # 0.2 s, which running a circuit need not wait for

    x, y = node.box.x + shift[0], node.box.y + shift[1]
    outline = _OUTLINES[node.shape](node.box.width, node.box.height)
    for layer in (2, 1, 0) if node.stack else (0,):
        patch = PathPatch(
            _path(outline, (x + layer * node.stack, y - layer * node.stack)),
            facecolor=ROLE_FILL[node.role],
            edgecolor=_ROLE_RIM[node.role],
            linewidth=1.2 if layer == 0 else 0.8,
            zorder=4.0 - 0.01 * layer,
        )
        if layer == 0:
            patch.set_gid(node_id(node.name))
        axes.add_patch(patch)
    sizes = [NORMAL, *([SMALL] * (len(node.lines) - 1))]
    colours = [INK, *([GREY] * (len(node.lines) - 1))]
    total = sum(sizes) + 0.35 * SMALL * (len(sizes) - 1)
    if node.shape == "tag":
        x -= 3.0
    line_y = y - total / 2
    for text, size, colour in zip(node.lines, sizes, colours, strict=True):
        add_text(axes, (x, line_y + size / 2), text, size, colour, zorder=4.5)
        line_y += size + 0.35 * SMALL


def add_group(axes: Axes, group: GroupBox, shift: Point) -> None:
    """Add the frame of an instance, behind everything, with its name."""
    from matplotlib.patches import PathPatch  # 0.2 s, which running a circuit need not wait for

    box = group.box
    outline = rectangle(box.width, box.height)
    frame = PathPatch(
        _path(outline, (box.x + shift[0], box.y + shift[1])),
        facecolor="#f8f8f8",
        edgecolor=GREY,
        linewidth=0.7,
        linestyle=(0, (4, 2)),
        zorder=1.0,
    )
    axes.add_patch(frame)
    at = (box.left + shift[0] + 6.0, box.top + shift[1] + 8.0)
    add_text(axes, at, group.name, NORMAL, GREY, horizontalalignment="left", zorder=4.6)


def add_text(axes: Axes, at: Point, text: str, size: float, colour: str, **more: Any) -> None:  # noqa: ANN401 - whatever `Axes.text` takes
    """Add lines of text around a point, or to the right of it; nothing in them is a formula."""
    vertical = "center" if "\n" in text else "center_baseline"
    align: dict[str, Any] = {"horizontalalignment": "center", "verticalalignment": vertical}
    align["linespacing"] = LINE_HEIGHT
    axes.text(*at, text, fontsize=size, color=colour, parse_math=False, **(align | more))


def add_line(axes: Axes, route: Route, shift: Point, zorder: float) -> None:
    """Add a line on a white rim, with the head of its kind."""
    from matplotlib.patches import PathPatch  # 0.2 s, which running a circuit need not wait for

    colour = KIND_COLOUR[route.link.kind]
    line = Outline(_shortened(route), route.codes)
    path = _path(line, shift)
    rim = PathPatch(
        path, fill=False, edgecolor=PAPER, linewidth=_WIDTH + 2 * _RIM, capstyle="butt", zorder=zorder
    )
    stroke = PathPatch(
        path,
        fill=False,
        edgecolor=colour,
        linewidth=_WIDTH,
        capstyle="butt",
        joinstyle="round",
        linestyle=(0, (3, 1.5)) if route.link.kind == "gate" else "-",
        zorder=zorder + 0.005,
    )
    outline, style = _head(route)
    head = PathPatch(_path(outline, shift), zorder=4.2, **style)
    parts = (stroke, rim, head)
    for part, name in zip(parts, line_ids(route.link), strict=True):
        part.set_gid(name)
        axes.add_patch(part)


def _head(route: Route) -> tuple[Outline, dict[str, Any]]:
    """Excitatory and readout: a filled arrow; inhibitory: a bar; sensorial: open; gate: a diamond."""
    colour = KIND_COLOUR[route.link.kind]
    (x, y), (ux, uy) = route.tip, route.heading

    def at(along: float, across: float) -> Point:
        return x + along * ux - across * uy, y + along * uy + across * ux

    if route.link.kind == "inhibitory":
        bar = Outline((at(-1.9, -_BAR_HALF), at(-1.9, _BAR_HALF)), "ML")
        return bar, {"fill": False, "edgecolor": colour, "linewidth": 2.4, "capstyle": "butt"}
    if route.link.kind == "sensorial":
        ends = (at(-5.2, -_OPEN_HALF), at(-0.8, 0.0), at(-5.2, _OPEN_HALF))
        style = {
            "fill": False,
            "edgecolor": colour,
            "linewidth": _WIDTH,
            "capstyle": "round",
            "joinstyle": "miter",
        }
        return Outline(ends, "MLL"), style
    if route.link.kind == "gate":
        diamond = (at(-0.6, 0.0), at(-4.5, -_HEAD_HALF), at(-8.4, 0.0), at(-4.5, _HEAD_HALF), at(-0.6, 0.0))
        return Outline(diamond, "MLLLL"), {"facecolor": PAPER, "edgecolor": colour, "linewidth": 1.1}
    tip = at(-0.6, 0.0)
    base = (at(-_HEAD_LENGTH, -_HEAD_HALF), at(-_HEAD_LENGTH, _HEAD_HALF))
    return Outline((tip, *base, tip), "MLLL"), {"facecolor": colour, "edgecolor": "none"}


def _shortened(route: Route) -> tuple[Point, ...]:
    """Return the points of a line that ends inside its head, which hides the end."""
    inside = {"inhibitory": 2.0, "sensorial": 1.5}.get(route.link.kind, _HEAD_LENGTH - 1.0)
    (x, y), (ux, uy) = route.tip, route.heading
    return (*route.points[:-1], (x - inside * ux, y - inside * uy))


def _path(outline: Outline, shift: Point) -> Path:
    from matplotlib.path import Path  # 0.2 s, which running a circuit need not wait for

    letters = {"M": Path.MOVETO, "L": Path.LINETO, "C": Path.CURVE4}
    points = [(x + shift[0], y + shift[1]) for x, y in outline.points]
    return Path(points, [letters[code] for code in outline.codes])
