"""Outlines of the nodes: the shape tells the role. Lengths in points, y downwards, origin in the middle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

from circuitkit.draw.style import FONT

Point: TypeAlias = tuple[float, float]
_KAPPA = 0.5522847498  # a quarter of a circle as a cubic curve
_CUT = 7.0
_TIP = 8.0
LINE_HEIGHT = 1.25  # distance of lines of text in units of their size


@dataclass(frozen=True)
class Box:
    """A rectangle: the extent of a node or of a label.

    Attributes:
        x: Middle, [pt].
        y: Middle, downwards, [pt].
        width: [pt].
        height: [pt].
    """

    x: float
    y: float
    width: float
    height: float

    @property
    def left(self) -> float:
        """Left side, [pt]."""
        return self.x - self.width / 2

    @property
    def right(self) -> float:
        """Right side, [pt]."""
        return self.x + self.width / 2

    @property
    def top(self) -> float:
        """Upper side, [pt]."""
        return self.y - self.height / 2

    @property
    def bottom(self) -> float:
        """Lower side, [pt]."""
        return self.y + self.height / 2

    def overlaps(self, other: Box, margin: float = 0.0) -> bool:
        """Check whether the two come closer than `margin`."""
        near_x = abs(self.x - other.x) < (self.width + other.width) / 2 + margin
        return near_x and abs(self.y - other.y) < (self.height + other.height) / 2 + margin


@dataclass(frozen=True)
class Outline:
    """A closed line; `codes` are those of matplotlib's `Path` as letters: M move, L line, C cubic curve."""

    points: tuple[Point, ...]
    codes: str


def capsule(width: float, height: float) -> Outline:
    """Return a circle drawn out to the size: an excitatory neuron."""
    a, b, r = width / 2, height / 2, min(width, height) / 2
    k = r * _KAPPA
    corners = (
        (a - r, -b, a - r + k, -b, a, -b + r - k, a, -b + r),
        (a, b - r, a, b - r + k, a - r + k, b, a - r, b),
        (-a + r, b, -a + r - k, b, -a, b - r + k, -a, b - r),
        (-a, -b + r, -a, -b + r - k, -a + r - k, -b, -a + r, -b),
    )
    points = [(c[i], c[i + 1]) for c in corners for i in range(0, 8, 2)]
    return Outline((*points, points[0]), "M" + "CCC" + "LCCC" * 3 + "L")


def octagon(width: float, height: float) -> Outline:
    """Return a rectangle with cut corners: an inhibitory neuron."""
    a, b, c = width / 2, height / 2, _cut(height)
    points = (
        (a - c, -b),
        (a, -b + c),
        (a, b - c),
        (a - c, b),
        (-a + c, b),
        (-a, b - c),
        (-a, -b + c),
        (-a + c, -b),
    )
    return Outline((*points, points[0]), "M" + "L" * 8)


def _cut(height: float) -> float:
    return min(_CUT, 0.3 * height)


def tag(width: float, height: float) -> Outline:
    """Return a rectangle with a tip to the right: an input."""
    a, b = width / 2, height / 2
    points = ((-a, -b), (a - _TIP, -b), (a, 0.0), (a - _TIP, b), (-a, b))
    return Outline((*points, points[0]), "M" + "L" * 5)


def rectangle(width: float, height: float) -> Outline:
    """Return a rectangle: an output."""
    a, b = width / 2, height / 2
    points = ((-a, -b), (a, -b), (a, b), (-a, b))
    return Outline((*points, points[0]), "M" + "L" * 4)


def inset(shape: str, box: Box, offset: float, *, vertical: bool) -> float:
    """Find how far inside its box an outline begins, at a distance `offset` from the middle of a side.

    Args:
        shape: "capsule", "octagon", "tag" or "rectangle".
        box: The node.
        offset: Along the left side, or along the upper or lower side if `vertical`, [pt].
        vertical: Whether a line meets the upper or lower side.
    """
    half = (box.width if vertical else box.height) / 2
    if shape == "capsule":
        r = min(box.width, box.height) / 2
        over = max(0.0, abs(offset) - (half - r))
        return r - math.sqrt(max(0.0, r * r - over * over))
    if shape == "octagon":
        return max(0.0, abs(offset) - (half - _cut(box.height)))
    return 0.0


@lru_cache(maxsize=4096)
def text_size(text: str, size: float) -> tuple[float, float]:
    """Give width and height of a line of text, [pt]; the height is that of the font, whatever the letters."""
    from matplotlib.font_manager import FontProperties  # 0.2 s, which running a circuit need not wait for
    from matplotlib.textpath import TextPath  # 0.2 s, which running a circuit need not wait for

    if not text.strip():
        return 0.0, size
    box = TextPath((0, 0), text, size=size, prop=FontProperties(family=FONT)).get_extents()
    return float(box.width), size


def block_size(text: str, size: float) -> tuple[float, float]:
    """Return width and height of some lines of text, [pt]."""
    lines = text.split("\n")
    return max(text_size(line, size)[0] for line in lines), size * (1 + LINE_HEIGHT * (len(lines) - 1))
