"""How a search went: a table of its candidates, and a picture."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from circuitkit.draw.style import (
    EXCITATORY,
    GREY,
    INK,
    NORMAL,
    PALE,
    SMALL,
    house_style,
    new_figure,
    save_figure,
)
from circuitkit.files import write_text
from circuitkit.study.tuning.search import Found, Told
from circuitkit.study.tuning.spec import Tuning

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH_IN, _TOP_IN, _ROW_IN, _COLUMNS = 6.8, 2.3, 1.15, 3


def write_table(tuning: Tuning, found: Found, path: Path) -> None:
    """Write a CSV with a row for each candidate: its number, objective, figures and values.

    Raises:
        OutputError: It cannot be written.
    """
    terms = [term.name for term in tuning.spec.terms]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["number", "objective", *terms, *tuning.spec.parameters, "error"])
    for told in found.told:
        figures = [f"{figure:.9g}" for figure in told.figures] or [""] * len(terms)
        value = "" if told.value is None else f"{told.value:.9g}"
        values = [told.settings.get(name, "") for name in tuning.spec.parameters]
        writer.writerow([told.number, value, *figures, *values, told.error])
    write_text(path, text.getvalue())


def draw_history(tuning: Tuning, found: Found, best: Told, size: int, path: Path) -> None:
    """Draw the objective of every candidate with the best so far, and below how each value moved.

    Args:
        tuning: What was tuned.
        found: The candidates.
        best: The one that was chosen; marked.
        size: How many candidates were measured together.
        path: The picture.

    Raises:
        OutputError: It cannot be written.
    """
    told = [each for each in found.told if each.value is not None]
    numbers = np.array([each.number for each in told])
    values = np.array([each.value for each in told], dtype=float)
    names = list(tuning.spec.parameters)
    rows = -(-len(names) // _COLUMNS)
    height = _TOP_IN + rows * _ROW_IN + 0.45
    with house_style():
        figure = new_figure(_WIDTH_IN, height)
        grid = figure.add_gridspec(
            rows + 1,
            _COLUMNS,
            height_ratios=[_TOP_IN - 0.5, *[_ROW_IN - 0.35] * rows],
            left=0.095,
            right=0.985,
            bottom=0.48 / height,
            top=1 - 0.32 / height,
            hspace=0.62,
            wspace=0.36,
        )
        top = figure.add_subplot(grid[0, :])
        _draw_objective(top, numbers, values, best, found)
        top.set_title(f"{tuning.file.study}: {len(found.told)} candidates", fontsize=NORMAL, loc="left")
        for place, name in enumerate(names):
            axes = figure.add_subplot(grid[1 + place // _COLUMNS, place % _COLUMNS])
            _draw_values(axes, tuning, name, told, best, size)
            if place + _COLUMNS >= len(names):
                axes.set_xlabel("candidate")
            else:
                axes.tick_params(labelbottom=False)
        save_figure(figure, path)


def _draw_objective(axes: Axes, numbers: np.ndarray, values: np.ndarray, best: Told, found: Found) -> None:
    so_far = np.maximum.accumulate(values) if found.maximise else np.minimum.accumulate(values)
    axes.plot(numbers, values, ".", color=GREY, markersize=3.5, label="candidate")
    axes.step(numbers, so_far, where="post", color=EXCITATORY, linewidth=1.6, label="best so far")
    axes.plot(
        best.number, best.value or 0.0, "o", markersize=6.5, fillstyle="none", color=INK, label="chosen"
    )
    axes.set_ylabel("objective")
    axes.grid(color=PALE, linewidth=0.5)
    low, high = (
        (np.percentile(values, 5), values.max())
        if found.maximise
        else (values.min(), np.percentile(values, 95))
    )
    margin = 0.08 * max(high - low, 1e-9)
    axes.set_ylim(low - margin, high + margin)
    axes.legend(loc="lower right" if found.maximise else "upper right", ncols=3, frameon=True, edgecolor=PALE)


def _draw_values(axes: Axes, tuning: Tuning, name: str, told: Sequence[Told], best: Told, size: int) -> None:
    """How one value moved: every candidate's, and the median of each generation."""
    searched = tuning.spec.parameters[name]
    numbers = np.array([each.number for each in told])
    shown = np.array([searched.plotted(each.settings[name]) for each in told])
    axes.plot(numbers, shown, ".", color=GREY, markersize=2.0)
    groups = [slice(i, i + size) for i in range(0, len(told), size)]
    axes.plot(
        [numbers[each].mean() for each in groups],
        [np.median(shown[each]) for each in groups],
        color=EXCITATORY,
        linewidth=1.4,
    )
    axes.plot(
        best.number, searched.plotted(best.settings[name]), "o", markersize=5, fillstyle="none", color=INK
    )
    unit = "" if searched.choices or searched.unit.symbol == "1" else f" [{searched.unit}]"
    axes.set_title(f"{name}{unit}", fontsize=SMALL, loc="left", pad=3)
    axes.grid(color=PALE, linewidth=0.5)
    if searched.choices:
        axes.set_yticks(range(len(searched.choices)), [str(each) for each in searched.choices])
        axes.set_ylim(-0.5, len(searched.choices) - 0.5)
        return
    if searched.log and searched.ends[0] > 0:
        axes.set_yscale("log")
    axes.set_ylim(*searched.ends)
