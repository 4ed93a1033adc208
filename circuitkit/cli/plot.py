"""A curve in characters, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

_WIDTH, _HEIGHT = 60, 12  # characters
_ROUNDING = 1e-9  # of the width; an end nearer to 0 is 0


def text_plot(x: Sequence[float], y: Sequence[float], x_title: str, y_title: str) -> Iterator[str]:
    """The lines of a plot.

    Args:
        x: Ascending.
        y: As many.
        x_title: Stands below.
        y_title: Stands above.
    """
    low, high = min(y), max(y)
    tall = (high - low) or 1.0
    wide = (x[-1] - x[0]) or 1.0
    canvas = [[" "] * _WIDTH for _ in range(_HEIGHT)]
    for column in range(_WIDTH):
        begin, end = (x[0] + wide * (column + side) / _WIDTH for side in (0, 1))
        values = [value for at, value in zip(x, y, strict=True) if begin <= at <= end]
        for value in values or _between(x, y, (begin + end) / 2):
            row = round((high - value) / tall * (_HEIGHT - 1))
            canvas[row][column] = "*"
    yield f"  {y_title}"
    for row, line in enumerate(canvas):
        label = f"{high - tall * row / (_HEIGHT - 1):9.3g}" if row in {0, _HEIGHT - 1} else " " * 9
        yield f"{label} |{''.join(line)}".rstrip()
    yield f"{' ' * 9} +{'-' * _WIDTH}"
    left, right = (f"{end if abs(end) > _ROUNDING * wide else 0.0:.3g}" for end in (x[0], x[-1]))
    yield f"{' ' * 11}{left}{right:>{_WIDTH - len(left)}}"
    yield f"{' ' * 11}{x_title:^{_WIDTH}}".rstrip()


def _between(x: Sequence[float], y: Sequence[float], at: float) -> list[float]:
    """The value at a place between two others, by a straight line."""
    for i in range(1, len(x)):
        if x[i - 1] <= at <= x[i]:
            share = (at - x[i - 1]) / ((x[i] - x[i - 1]) or 1.0)
            return [y[i - 1] + share * (y[i] - y[i - 1])]
    return []
