"""How far apart the items of a layered drawing stand: level links first, never closer than sizes allow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from circuitkit.draw.layers import Bend, Item

_ROUNDS = 80
_STRAIGHT, _BEND, _PLAIN = (
    16.0,
    3.0,
    1.0,
)  # how much a link between two bends, one bend or two nodes wants to be level


def place_vertically(
    order: Sequence[Sequence[Item]],
    segments: Iterable[tuple[Item, Item]],
    reach: Mapping[Item, tuple[float, float]],
    gap: float,
) -> dict[Item, float]:
    """Place heights that make links as level as possible: the least sum of squared height differences.

    Layer after layer moves to the weighted mean of its neighbours, kept apart by isotonic regression, until
    it rests.

    Args:
        order: The items of each layer from top to bottom.
        segments: Pairs of items in neighbouring layers that a link joins.
        reach: How far each item reaches above and below its height, [pt].
        gap: Free space between two nodes, [pt]; half of it beside a bend.

    Returns:
        Height of each item, downwards, [pt].
    """
    pulls: dict[Item, list[tuple[Item, float]]] = {item: [] for layer in order for item in layer}
    for one, other in segments:
        bends = isinstance(one, Bend) + isinstance(other, Bend)
        weight = (_PLAIN, _BEND, _STRAIGHT)[bends]
        pulls[one].append((other, weight))
        pulls[other].append((one, weight))
    spacing = [_spacing(layer, reach, gap) for layer in order]
    height: dict[Item, float] = {}
    for layer, offsets in zip(order, spacing, strict=True):
        middle = offsets[-1] / 2 if offsets else 0.0
        height |= {item: offset - middle for item, offset in zip(layer, offsets, strict=True)}
    for turn in range(_ROUNDS):
        layers = list(zip(order, spacing, strict=True))
        for layer, offsets in layers if turn % 2 == 0 else reversed(layers):
            _settle(layer, offsets, pulls, height)
    top = min((height[item] - reach[item][0] for item in height), default=0.0)
    return {item: value - top for item, value in height.items()}


def separate_bands(
    order: Sequence[Sequence[Item]],
    heights: Mapping[Item, float],
    reach: Mapping[Item, tuple[float, float]],
    bands: Mapping[Item, int],
    gap: float,
) -> dict[Item, float]:
    """Give heights at which the bands stand below each other, however far they reach into each other before.

    Args:
        order: The items of each layer from top to bottom.
        heights: Their heights, [pt].
        reach: How far each item reaches above and below its height, [pt].
        bands: The band of each item in the layers that have bands.
        gap: Free space between two bands, [pt].
    """
    moved = dict(heights)
    down, bottom = 0.0, float("-inf")
    for band in sorted(set(bands.values())):
        members = [item for item in heights if bands.get(item) == band]
        top = min(heights[item] - reach[item][0] for item in members)
        down = max(down, bottom + gap - top)
        moved |= {item: heights[item] + down for item in members}
        bottom = max(moved[item] + reach[item][1] for item in members)
    before = _span(heights, bands)
    after = _span(moved, bands)
    stretch = (after[1] - after[0]) / (before[1] - before[0]) if before[1] > before[0] else 1.0
    for layer in order:  # those without bands go along with what they stand beside
        free = [item for item in layer if item not in bands]
        for item, level in zip(
            free, _drawn_out(free, heights, reach, gap, before, after[0], stretch), strict=True
        ):
            moved[item] = level
    top = min(moved[item] - reach[item][0] for item in moved)
    return {item: value - top for item, value in moved.items()}


def _span(heights: Mapping[Item, float], bands: Mapping[Item, int]) -> tuple[float, float]:
    levels = [heights[item] for item in bands]
    return min(levels), max(levels)


def _drawn_out(
    layer: Sequence[Item],
    heights: Mapping[Item, float],
    reach: Mapping[Item, tuple[float, float]],
    gap: float,
    before: tuple[float, float],
    start: float,
    stretch: float,
) -> list[float]:
    """Return heights of a layer that is drawn out with the others, none closer than it may."""
    offsets = _spacing(layer, reach, gap)
    wanted = [start + (heights[item] - before[0]) * stretch for item in layer]
    levels = ascending([w - o for w, o in zip(wanted, offsets, strict=True)], [1.0] * len(layer))
    return [level + offset for level, offset in zip(levels, offsets, strict=True)]


def _spacing(layer: Sequence[Item], reach: Mapping[Item, tuple[float, float]], gap: float) -> list[float]:
    """Return heights of the items when they stand as close as they may, the first at 0."""
    offsets = [0.0] * len(layer)
    for i in range(1, len(layer)):
        above, below = layer[i - 1], layer[i]
        free = gap / 2 if isinstance(above, Bend) or isinstance(below, Bend) else gap
        offsets[i] = offsets[i - 1] + reach[above][1] + free + reach[below][0]
    return offsets


def _settle(
    layer: Sequence[Item],
    offsets: Sequence[float],
    pulls: Mapping[Item, Sequence[tuple[Item, float]]],
    height: dict[Item, float],
) -> None:
    wanted, weights = [], []
    for item, offset in zip(layer, offsets, strict=True):
        weight = sum(each for _, each in pulls[item])
        mean = sum(height[other] * each for other, each in pulls[item]) / weight if weight else height[item]
        wanted.append(mean - offset)
        weights.append(weight or 1e-3)
    for item, offset, level in zip(layer, offsets, ascending(wanted, weights), strict=True):
        height[item] = level + offset


def ascending(values: Sequence[float], weights: Sequence[float]) -> list[float]:
    """Find the ascending sequence of least weighted squared differences (pool adjacent violators)."""
    pools: list[tuple[float, float, int]] = []  # mean, weight, count
    for value, weight in zip(values, weights, strict=True):
        pool = (value, weight, 1)
        while pools and pools[-1][0] > pool[0]:
            mean, heavy, count = pools.pop()
            total = heavy + pool[1]
            pool = ((mean * heavy + pool[0] * pool[1]) / total, total, count + pool[2])
        pools.append(pool)
    return [mean for mean, _, count in pools for _ in range(count)]
