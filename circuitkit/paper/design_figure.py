"""Draws a design: w against force (the paper's Fig. 7), and force against duration."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from circuitkit.draw.style import (
    CYCLE,
    INK,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
    tidy,
    write_picture,
)
from circuitkit.paper import equations as eq
from circuitkit.paper.design_sheet import SHORT_PUSH_S, Bound, Sheet, show

UNSTABLE = "#dedede"  # the region of Fig. 7
_WIDTH, _HEIGHT = 3.1, 2.5  # of a panel, [in]
_LEFT, _RIGHT, _BETWEEN, _TOP, _BOTTOM, _LEGEND_ROW = 0.62, 0.22, 0.78, 0.32, 0.5, 0.16  # [in]
_WIDTHS = (2.0, 1.1)  # of lines, by direction: they stay apart in grey, [pt]
_POINTS = 200
_ROOM = 1.35  # an axis ends this much beyond the last thing on it
_SHORTEST_S = 0.02  # where the axis of durations begins; it ends with the pushes that the equations are for

Array = NDArray[np.float64]


def draw_design(sheet: Sheet, path: str | Path) -> None:
    """Draw a design.

    Args:
        sheet: The design.
        path: Where the picture goes: .png, .svg or .pdf.

    Raises:
        InputError: Another suffix.
        OutputError: The file cannot be written.
    """
    write_picture(path, lambda: design_figure(sheet))


def design_figure(sheet: Sheet) -> Figure:
    """Draw w against force for this duration on the left, force against duration for this w on the right."""
    rows = 3 + 2 * len(sheet.bounds)
    with house_style():
        width = _LEFT + 2 * _WIDTH + _BETWEEN + _RIGHT
        figure = new_figure(width, _TOP + _HEIGHT + _BOTTOM + rows * _LEGEND_ROW)
        paint_weights(axes_at(figure, _LEFT, _TOP, _WIDTH, _HEIGHT), sheet)
        paint_forces(axes_at(figure, _LEFT + _WIDTH + _BETWEEN, _TOP, _WIDTH, _HEIGHT), sheet)
    return figure


def paint_weights(axes: Axes, sheet: Sheet) -> None:
    """Paint eq. 21 for the push's duration, above which the ankles are quick enough, and the bounds."""
    body = sheet.body
    # The bound nearest to the push is shown; others may lie far beside it.
    bounds = [value for bound in sheet.bounds for value in (bound.lasting_force_n, bound.force_n)]
    top_n = _ROOM * max([sheet.force_n, *(value for value in bounds if value < 3 * sheet.force_n)])
    force = np.linspace(0.0, top_n, _POINTS)
    shift = eq.com_shift_from_velocity(sheet.com_velocity / sheet.force_n, sheet.step_s) * force
    weight = np.degrees(np.arcsin(np.clip(shift / body.com_height_m, 0.0, 1.0)))
    top_deg = float(weight[-1])
    axes.fill_between(
        force, weight, 0.0, color=UNSTABLE, linewidth=0, zorder=0.5, label="unstable by eq. 21; above, stable"
    )
    axes.plot(force, weight, color=INK, linewidth=1.4, label=f"eq. 21, $\\gamma$ = {sheet.gamma:g}")
    for i, bound in enumerate(sheet.bounds):
        for value, dashes, text in (
            (bound.lasting_force_n, "--", "eq. 22"),
            (bound.force_n, ":", f"DCM bound, {show(sheet.duration_s, 's')}"),
        ):
            if value < top_n:
                label = f"{text}{_of(bound)}: {value:.3g} N"
                axes.axvline(value, linestyle=dashes, label=label, color=CYCLE[i], linewidth=_WIDTHS[i % 2])
    found = math.degrees(sheet.weight_rad)
    push = f"this push: {sheet.force_n:.4g} N, {found:.4g}°"
    axes.plot(sheet.force_n, found, "o", color=INK, markersize=4.5, zorder=5, label=push)
    axes.set_xlim(0.0, top_n)
    axes.set_ylim(0.0, top_deg)
    axes.set_xlabel("force of the push [N]")
    axes.set_ylabel(f"w [° in a step of {show(sheet.step_s, 's')}]")
    axes.set_title(f"w for a push of {show(sheet.duration_s, 's')}", loc="left", fontsize=SMALL + 1.0)
    tidy(axes, grid=False)
    plain_legend(axes, "upper left", (0.0, -0.2))


def paint_forces(axes: Axes, sheet: Sheet) -> None:
    """Paint what can be held for how long by eq. 21 with this w, by eq. 22, and by the bound of the DCM."""
    body = sheet.body
    last_s = max(min(SHORT_PUSH_S, 4.0 * sheet.duration_s), _ROOM * sheet.duration_s)
    time = np.linspace(_SHORTEST_S, last_s, _POINTS)
    by_weight = np.array(
        [
            eq.force_for_weight(
                sheet.weight_rad, t, body.mass_kg, body.com_height_m, sheet.step_s, sheet.gamma
            )
            for t in time
        ]
    )
    label = f"eq. 21, w = {math.degrees(sheet.weight_rad):.4g}°"
    axes.plot(time, by_weight, color=INK, linewidth=1.4, label=label)
    for i, bound in enumerate(sheet.bounds):
        distance = bound.reach.distance_m
        if distance <= 0:
            continue
        at_com = [eq.largest_force_for_duration(distance, t, body.mass_kg, body.com_height_m) for t in time]
        held = [eq.force_at_height(force, sheet.push_height_m, body.com_height_m) for force in at_com]
        style: Any = {"color": CYCLE[i], "linewidth": _WIDTHS[i % 2]}
        axes.plot(time, held, linestyle=":", label=f"DCM bound{_of(bound)}", **style)
        axes.axhline(bound.lasting_force_n, linestyle="--", label=f"eq. 22{_of(bound)}", **style)
    axes.plot(sheet.duration_s, sheet.force_n, "o", color=INK, markersize=4.5, zorder=5, label="this push")
    top = _ROOM * max(sheet.force_n, *(bound.force_n for bound in sheet.bounds))
    axes.set_xlim(0.0, last_s)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("duration of the push [s]")
    axes.set_ylabel("largest force [N]")
    axes.set_title("force that is held", loc="left", fontsize=SMALL + 1.0)
    tidy(axes)
    plain_legend(axes, "upper left", (0.0, -0.2), ncols=2, columnspacing=1.2)


def _of(bound: Bound) -> str:
    return f", {bound.reach.direction}" if bound.reach.direction else ""
