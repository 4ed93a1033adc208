"""Makes figure 10, the ZMP over time with the support polygon and the thresholds of the circuit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from circuitkit.biped.plots import BAND, MM, PUSH_FILL, PUSHED
from circuitkit.biped.sensing import support_edges_m
from circuitkit.draw.style import EXCITATORY, INK, SMALL, house_style, new_figure, tidy
from circuitkit.paper.reproduce.drawing import WIDTH_IN, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    Verdict,
    median_range,
    one_line,
    seeds_in_words,
)
from circuitkit.paper.reproduce.pushed_walk import (
    QUICK_SEEDS,
    SEEDS,
    Excursions,
    PushedWalk,
    beyond,
    measure_excursions,
    record_pushed_walk,
    thresholds_for_cells_m,
    thresholds_for_pressure_m,
    zmp_as_read_m,
)

Array = NDArray[np.float64]

PAPER_S = 0.084
_WINDOW_S = (-1.4, 3.0)  # around the beginning of the push
_CLOSE_S = (-0.1, 0.7)
_CONTROL_STEP_S = 0.01
_BY_CELLS, _BY_PRESSURE = "ZMP by the force cells, as the circuit reads it", "true centre of pressure"


class Fig10(ReportFigure):
    """Draws the ZMP of that run and measures how long it is beyond the thresholds."""

    kind: ClassVar[str] = "fig10"
    order: ClassVar[int] = 10
    title: ClassVar[str] = "Figure 10: the ZMP as a function of time"
    effort: ClassVar[Effort] = Effort(full_s=15.0, quick_s=8.0)

    def run(self, job: Job) -> Finding:
        """Record the pushed walk under the BiNN, measure its times beyond the thresholds, draw the ZMP."""
        seeds = QUICK_SEEDS if job.quick else SEEDS
        walk = record_pushed_walk("circuit", seeds)
        cells, pressure = zmp_as_read_m(walk), walk.view.centre_of_pressure_m[..., 1]
        measured = {
            _BY_CELLS: measure_excursions(walk, cells, thresholds_for_cells_m(walk)),
            _BY_PRESSURE: measure_excursions(walk, pressure, thresholds_for_pressure_m(walk)),
        }
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=(_claim(measured[_BY_CELLS]),),
            pictures=(_draw(job, walk),),
            tables=(_table(measured),),
            text=_TEXT,
            seeds=f"{seeds_in_words(seeds)}; the picture is of seed {seeds[0]}",
            data={
                name: [vars(each) for each in found]
                for name, found in zip(("by_cells", "by_pressure"), measured.values(), strict=True)
            },
        )


_TEXT = one_line("""
The run of Fig. 9 (`nao_push`, circuit `binn_lateral_tuned`). The paper does not say which ZMP its figure
shows; here are both. The circuit reads the ZMP from the force cells, with their noise; as the cells lie
inside the sole's edge, it moves less than the true centre of pressure, and cannot leave the cells' hull.
Its thresholds are the shifts of the q neurons. For the true centre of pressure they are taken as far
inside the sole's edges as they are inside the hull of the cells for the other. Which thresholds count
follows the load on the feet, so that a first crossing also ends when the other foot takes over; the
longest time outside is a stricter figure.
""")


def _claim(found: Sequence[Excursions]) -> Claim:
    first, calm = [each.first for each in found], [each.until_calm for each in found]
    verdict = verdict_on_return(first, calm)
    why = """
        The first return is about as quick, but while the robot still moves from the push, the ZMP crosses
        again: the outer edge of a foot is where the ground pushes back most. Counted until a whole step
        is spent inside, ours takes longer than the one crossing of the paper."""
    return Claim(
        "After crossing the threshold the ZMP is back inside in 0.084 s",
        "0.084 s",
        f"{median_range(first, 's')} to the first return; "
        f"{median_range(calm, 's')} until inside for a whole step",
        "ZMP that the circuit reads, from the first control step beyond a threshold after the push",
        verdict,
        why=one_line(why) if verdict is Verdict.PARTLY else "",
        source="section 5.2",
    )


def verdict_on_return(first: Sequence[float | None], calm: Sequence[float | None]) -> Verdict:
    """Judge by whether the ZMP stayed inside as soon as in the paper, or at least was back so soon."""
    if quick_enough(calm):
        return Verdict.HOLDS
    return Verdict.PARTLY if quick_enough(first) else Verdict.FAILS


def quick_enough(times_s: Sequence[float | None]) -> bool:
    """See whether the median is at most the paper's and a control step; no time counts as never."""
    values = [np.inf if time is None else time for time in times_s]
    return bool(values) and float(np.median(values)) <= PAPER_S + _CONTROL_STEP_S


def _table(measured: Mapping[str, Sequence[Excursions]]) -> Table:
    rows = tuple(
        (
            name,
            median_range([each.first for each in found], "s"),
            median_range([each.longest for each in found], "s"),
            median_range([each.total for each in found], "s"),
            median_range([each.until_calm for each in found], "s"),
        )
        for name, found in measured.items()
    )
    headings = ("ZMP", ">first time outside", ">longest", ">all together", ">until inside for a whole step")
    return Table("Times beyond the thresholds after the push: median (range over the seeds)", headings, rows)


def _draw(job: Job, walk: PushedWalk) -> Picture:
    start = walk.push_s(0)[0]
    with house_style():
        figure = new_figure(WIDTH_IN, 5.4)
        figure.set_layout_engine("constrained")
        above, below = figure.subplots(2, 1, height_ratios=[1.15, 1])
        _zmp(above, walk, (start + _WINDOW_S[0], start + _WINDOW_S[1]))
        _zmp(below, walk, (start + _CLOSE_S[0], start + _CLOSE_S[1]))
        _mark_first_return(below, walk)
        above.set_ylabel("y [mm]   (left: positive)")
        below.set(ylabel="y [mm]   (left: positive)", xlabel="time [s]")
        handles, labels = above.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        file = save(figure, job.folder, "fig10")
    caption = one_line("""
        The ZMP that the circuit reads, before and from the push on, the true centre of pressure, the
        support polygon by the load on the feet, and the thresholds of the circuit; below, the time around
        the push. The double arrow is the time from crossing a threshold to the first return.""")
    alt = "The ZMP over time, with the support polygon, the thresholds and the push; below, closer."
    return Picture(file, caption, alt)


def _zmp(axes: Axes, walk: PushedWalk, window: tuple[float, float]) -> None:
    time, support = walk.recording.time_s, walk.view.support[:, 0]
    edges = support_edges_m(walk.view.block) * MM
    seen = np.arange(len(time)) < walk.end_tick(0)
    start, end = walk.push_s(0)
    tidy(axes, grid=False)
    margin = 0.1 * np.ptp(edges)
    axes.set(xlim=window, ylim=(edges.min() - margin, edges.max() + margin))
    push: Any = {"facecolor": PUSH_FILL, "edgecolor": INK, "hatch": "///", "linewidth": 0.5, "alpha": 0.45}
    label = f"push, {walk.scenario.pushes[0].force:g} N"
    axes.axvspan(start, end, zorder=0.6, label=label, **push)
    polygon: Any = {"step": "pre", "color": BAND, "linewidth": 0, "zorder": 0.2, "label": "support polygon"}
    axes.fill_between(time, edges[support, 0], edges[support, 1], where=seen, **polygon)
    lines = thresholds_for_cells_m(walk)[:, 0] * MM
    lines[np.any(np.diff(lines, axis=0, prepend=lines[:1]) != 0, axis=1)] = np.nan
    for side, entry in enumerate(("threshold of the BiNN", None)):
        axes.plot(time, lines[:, side], color=INK, linewidth=0.9, linestyle=(0, (5, 2)), label=entry)
    zmp = zmp_as_read_m(walk)[:, 0] * MM
    pressure = walk.view.centre_of_pressure_m[:, 0, 1] * MM
    before, after = time <= start + walk.step_s, (time >= start) & seen
    for kept, curve, style in (
        (seen, pressure, (EXCITATORY, 0.9, ":", _BY_PRESSURE)),
        (before, zmp, (INK, 0.9, "-", "ZMP by the force cells")),
        (after, zmp, (PUSHED, 1.7, "-", "the same from the push on")),
    ):
        colour, width, dashes, name = style
        shown = np.where(kept, curve, np.nan)
        axes.plot(time, shown, color=colour, linewidth=width, linestyle=dashes, label=name)


def _mark_first_return(axes: Axes, walk: PushedWalk) -> None:
    found = measure_excursions(walk, zmp_as_read_m(walk), thresholds_for_cells_m(walk))[0]
    if found.first is None:
        return
    begin = round(walk.push_s(0)[0] / walk.step_s)
    outside = beyond(zmp_as_read_m(walk), thresholds_for_cells_m(walk))[begin:, 0]
    crossed = (begin + int(np.argmax(outside)) + 1) * walk.step_s
    low, high = axes.get_ylim()
    height = high - 0.04 * (high - low)
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (crossed, height), (crossed + found.first, height), arrowprops=arrow)
    beside: Any = {"xytext": (5, 0), "textcoords": "offset points", "va": "center", "fontsize": SMALL}
    axes.annotate(f"{found.first * 1e3:.0f} ms", (crossed + found.first, height), **beside)
