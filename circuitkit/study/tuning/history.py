"""How a search went: a table of its candidates, and a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.files import write_text
from circuitkit.base.tables import csv_line, csv_number
from circuitkit.draw.style import (
    EXCITATORY,
    GREY,
    INK,
    NORMAL,
    PALE,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    save_figure,
)
from circuitkit.study.tuning.search import History, Trial
from circuitkit.study.tuning.space import Searched
from circuitkit.study.tuning.spec import Tuning

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH_IN, _COLUMNS = 6.8, 3
_LEFT_IN, _RIGHT_IN, _BETWEEN_IN = 0.6, 0.12, 0.5
_HEAD_IN, _TOP_IN, _GAP_IN, _ROW_IN, _TITLE_IN, _FOOT_IN = 0.52, 1.8, 0.5, 0.72, 0.3, 0.5
_MOST_TICKS = 4


def write_table(tuning: Tuning, history: History, path: Path) -> None:
    """Write a CSV with a row for each candidate: its number, objective, figures and values.

    Raises:
        OutputError: It cannot be written.
    """
    terms = [term.name for term in tuning.spec.terms]
    rows: list[list[object]] = [["number", "objective", *terms, *tuning.spec.parameters, "error"]]
    for trial in history.trials:
        figures = [csv_number(figure) for figure in trial.figures] or [""] * len(terms)
        value = "" if trial.value is None else csv_number(trial.value)
        values = [trial.settings.get(name, "") for name in tuning.spec.parameters]
        rows.append([trial.number, value, *figures, *values, trial.error])
    write_text(path, csv_line(*rows))


def draw_history(tuning: Tuning, history: History, best: Trial, size: int, path: Path) -> None:
    """Draw the objective of every candidate with the best so far, and below how each value moved.

    Args:
        tuning: What was tuned.
        history: The candidates.
        best: The one that was chosen; marked.
        size: How many candidates were measured together.
        path: The picture.

    Raises:
        OutputError: It cannot be written.
    """
    trials = [each for each in history.trials if each.value is not None]
    numbers = np.array([each.number for each in trials])
    values = np.array([each.value for each in trials], dtype=float)
    names = list(tuning.spec.parameters)
    rows = -(-len(names) // _COLUMNS)
    height = _HEAD_IN + _TOP_IN + _GAP_IN + rows * (_TITLE_IN + _ROW_IN) + _FOOT_IN
    whole = _WIDTH_IN - _LEFT_IN - _RIGHT_IN
    width = (whole - (_COLUMNS - 1) * _BETWEEN_IN) / _COLUMNS
    with house_style():
        figure = new_figure(_WIDTH_IN, height)
        top = axes_at(figure, _LEFT_IN, _HEAD_IN, whole, _TOP_IN)
        _draw_objective(top, numbers, values, best, history)
        title = f"{tuning.file.study}: {len(history.trials)} candidates"
        figure.text(_LEFT_IN / _WIDTH_IN, 1 - _TITLE_IN / 2 / height, title, fontsize=NORMAL, va="center")
        for place, name in enumerate(names):
            row, column = divmod(place, _COLUMNS)
            down = _HEAD_IN + _TOP_IN + _GAP_IN + row * (_TITLE_IN + _ROW_IN) + _TITLE_IN
            axes = axes_at(figure, _LEFT_IN + column * (width + _BETWEEN_IN), down, width, _ROW_IN)
            _draw_values(axes, tuning, name, trials, best, size)
            if place + _COLUMNS >= len(names):
                axes.set_xlabel("candidate")
            else:
                axes.tick_params(labelbottom=False)
        save_figure(figure, path)


def _draw_objective(
    axes: Axes, numbers: NDArray[np.int_], values: NDArray[np.float64], best: Trial, history: History
) -> None:
    """The objective of every candidate; those far from all others stand at the edge."""
    so_far = np.maximum.accumulate(values) if history.maximise else np.minimum.accumulate(values)
    near = np.percentile(values, 5 if history.maximise else 95)
    low, high = (near, values.max()) if history.maximise else (values.min(), near)
    margin = 0.08 * max(high - low, 1e-9)
    low, high = low - margin, high + margin
    beyond = (values < low) | (values > high)
    axes.plot(numbers[~beyond], values[~beyond], ".", color=GREY, markersize=3.5, label="candidate")
    if beyond.any():
        edge, marker, word = (low, "v", "below") if history.maximise else (high, "^", "above")
        axes.plot(
            numbers[beyond],
            np.full(beyond.sum(), edge),
            marker,
            color=GREY,
            markersize=3.5,
            label=f"candidate {word} the picture",
            clip_on=False,
        )
    axes.step(numbers, so_far, where="post", color=EXCITATORY, linewidth=1.6, label="best so far")
    value = best.value or 0.0
    axes.plot(best.number, value, "o", markersize=6.5, fillstyle="none", color=INK, label="chosen")
    axes.set_ylabel("objective")
    axes.set_xlabel("candidate")
    axes.grid(color=PALE, linewidth=0.5)
    axes.set_ylim(low, high)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4, frameon=False, borderaxespad=0.2)


def _draw_values(
    axes: Axes, tuning: Tuning, name: str, trials: Sequence[Trial], best: Trial, size: int
) -> None:
    """How one value moved: every candidate's, and the median of each generation."""
    searched = tuning.spec.parameters[name]
    numbers = np.array([each.number for each in trials])
    shown = np.array([searched.plotted(each.settings[name]) for each in trials])
    chosen = searched.plotted(best.settings[name])
    axes.plot(numbers, shown, ".", color=GREY, markersize=2.0)
    axes.plot(best.number, chosen, "o", markersize=5, fillstyle="none", color=INK, zorder=3)
    axes.set_title(f"{name}{_unit(searched)}", fontsize=SMALL, loc="left", pad=3)
    axes.grid(color=PALE, linewidth=0.5)
    if searched.choices:
        axes.set_yticks(range(len(searched.choices)), [""] * len(searched.choices))
        for height, choice in enumerate(searched.choices):
            across = axes.get_yaxis_transform()
            axes.text(0.02, height + 0.12, str(choice), fontsize=SMALL, va="bottom", transform=across)
        axes.set_ylim(-0.4, len(searched.choices) - 0.2)
        return
    groups = [
        slice(i, i + size) for i in range(min(1, len(trials) - 1), len(trials), size)
    ]  # behind the start
    middles = [numbers[each].mean() for each in groups]
    axes.plot(middles, [np.median(shown[each]) for each in groups], color=EXCITATORY, linewidth=1.4)
    low, high = searched.ends
    if searched.log and low > 0:
        axes.set_yscale("log")
        ticks = _round_numbers(low, high)
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_yticks([], minor=True)
    margin = 0.0 if searched.log else 0.03 * (high - low)
    axes.set_ylim(low - margin, high + margin)


def _unit(searched: Searched) -> str:
    return "" if searched.choices or searched.unit.symbol == "1" else f" [{searched.unit}]"


def _round_numbers(low: float, high: float) -> list[float]:
    """A few round numbers of a logarithmic range."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        found = [step * 10.0**power for power in powers for step in steps]
        inside = [number for number in found if low <= number * (1 + 1e-9) and number <= high * (1 + 1e-9)]
        if len(inside) <= _MOST_TICKS:
            break
    return inside if len(inside) > 1 else [low, high]
