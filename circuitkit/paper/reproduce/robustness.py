"""Measures what circuits gain over the open loop in worlds for which they were not tuned."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from matplotlib.axes import Axes

from circuitkit.draw.style import GREY, INK, NORMAL, SMALL, house_style, new_figure, tidy
from circuitkit.paper.reproduce.drawing import STYLES, WIDTH_IN, label_of, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    count,
    one_line,
    plain,
    reaches,
    seeds_in_words,
)
from circuitkit.paper.reproduce.forces import Ratio, circuits_of, forces_by, paired_ratio

STUDY = "robustness"
NOMINAL, BASELINE = "nominal", "open_loop"
_QUICK: Mapping[str, Any] = {"seeds": {"count": 2}, "search": {"step": "4 N"}}
_KEPT = 0.5  # of the nominal gain
_MISSED = 0.05  # of intervals of 95 %
_SOURCE = "beyond the paper"

# The ratios of a contender by condition.
Ratios = Mapping[str, Ratio]


class Robustness(ReportFigure):
    """Sets circuits beside the open loop on other floors, masses, sensors, servos, pushes and slopes."""

    kind: ClassVar[str] = "robustness"
    order: ClassVar[int] = 30
    title: ClassVar[str] = "Robustness of the result"
    studies: ClassVar[tuple[str, ...]] = (STUDY,)
    effort: ClassVar[Effort] = Effort(full_s=520.0, quick_s=80.0)

    def run(self, job: Job) -> Finding:
        """Search the largest survived forces in every condition, with and without circuits; draw ratios."""
        study = job.study(STUDY, _QUICK)
        forces = forces_by(job.sweep(study, apart="contender").limits(), "condition", "contender")
        circuits = circuits_of(study)
        conditions = tuple(dict.fromkeys(condition for condition, _ in forces))
        ratios = {
            name: {each: paired_ratio(forces[each, name], forces[each, BASELINE]) for each in conditions}
            for name in circuits
        }
        seeds = len(study.seeds)
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=tuple(
                claim
                for name, circuit in circuits.items()
                for claim in claims_of(circuit, ratios[name], seeds)
            ),
            pictures=(_draw(job, ratios),),
            tables=tuple(_table(name, ratios[name]) for name in ratios),
            text=one_line(f"""
            Robot, sensors and floor differ from those that the walk is planned for and the circuits are tuned
            in; neither knows. In each condition, for each of {seeds} seeds and both directions, the largest
            force of 0.2 s that the robot survives is searched, with a circuit and in open loop. The ratio is
            that of the means; its interval (95 %) is a bootstrap over the seeds, which both share, so that it
            says what other noise and other moments of the push might have given; over so few seeds it is
            rather too narrow. Of {len(conditions)} intervals of 95 % one expects
            {_MISSED * len(conditions):.1f} to miss the true ratio by chance, so a single condition that is
            just sure, or just not, says little. The search of a seed takes the first boundary that bisection
            finds; whether weaker pushes leave gaps below is not looked for."""),
            seeds=seeds_in_words(study.seeds),
            studies=self.studies,
            data={name: {each: vars(ratio) for each, ratio in own.items()} for name, own in ratios.items()},
        )


def claims_of(circuit: str, ratios: Ratios, seeds: int) -> tuple[Claim, ...]:
    """Judge whether the gain is there in every condition, and how much of it stays."""
    nominal = ratios[NOMINAL]
    others = {name: ratio for name, ratio in ratios.items() if name != NOMINAL}
    lost = [name for name, ratio in others.items() if not ratio.low > 1]
    gain = nominal.value - 1
    kept = sum(ratio.value - 1 >= _KEPT * gain for ratio in others.values()) if gain > 0 else 0
    worst = min(others, key=lambda name: (math.isnan(others[name].value), others[name].value))
    how = f"circuit {circuit} over open loop, mean force survived, 0.2 s, both directions; {seeds} seeds"
    return (
        Claim(
            f"{circuit} gains over the open loop where robot, sensors or floor are not as planned",
            "-",
            f"in {count(len(others) - len(lost), len(others))} conditions",
            f"{how}; gains where the 95 % bootstrap interval of the ratio lies above 1",
            reaches(len(others) - len(lost), len(others), 0),
            why=f"Not sure in: {'; '.join(lost)}." if lost else "",
            source=_SOURCE,
        ),
        Claim(
            f"{circuit} keeps at least half of its gain there",
            "-",
            f"in {count(kept, len(others))} conditions; nominal ratio {_ratio(nominal)}, "
            f"least {_ratio(others[worst])} ({worst})",
            how,
            reaches(kept, len(others), 0),
            source=_SOURCE,
        ),
    )


def _ratio(ratio: Ratio) -> str:
    if math.isnan(ratio.value):
        return "none, for the open loop survives nothing"
    if math.isnan(ratio.low):
        return f"{ratio.value:.2f}"
    return f"{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"


def _table(name: str, ratios: Ratios) -> Table:
    rows = tuple(
        (each, plain(ratio.theirs), plain(ratio.mine), _ratio(ratio)) for each, ratio in ratios.items()
    )
    headings = ("condition", ">open loop [N]", ">circuit [N]", ">ratio (95 % interval)")
    caption = f"{label_of(name)}: mean of the largest survived forces over seeds and directions"
    return Table(caption, headings, rows)


def _draw(job: Job, ratios: Mapping[str, Ratios]) -> Picture:
    conditions = tuple(next(iter(ratios.values())))
    with house_style():
        figure = new_figure(WIDTH_IN, 0.25 * len(conditions) + 1.3)
        figure.set_layout_engine("constrained")
        axes = figure.subplots()
        _rows(axes, conditions)
        for number, (name, own) in enumerate(ratios.items()):
            _points(axes, name, own, 0.18 * (2 * number - len(ratios) + 1))
        _forces(axes, ratios)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        file = save(figure, job.folder, "robustness")
    caption = one_line("""
        Largest force survived with a circuit over that in open loop, in each condition, with its 95 %
        interval by a bootstrap over seeds. On the right the mean forces in newtons: in open loop, then
        with each circuit. Dashed, no gain.""")
    return Picture(file, caption, "A row for each condition with the ratios of circuit over open loop.")


def _rows(axes: Axes, conditions: tuple[str, ...]) -> None:
    tidy(axes)
    rows = range(len(conditions))
    labels = [condition.replace(" -", " \N{MINUS SIGN}") for condition in conditions]
    axes.set(ylim=(len(conditions) - 0.4, -0.6), yticks=list(rows), yticklabels=labels)
    axes.tick_params(axis="y", length=0)
    axes.axvline(1.0, color=INK, linewidth=0.9, linestyle="--", label="no gain")
    axes.axhline(0.5, color=GREY, linewidth=0.6)  # the nominal condition stands apart
    axes.set_xlabel("largest force survived: circuit / open loop")


def _points(axes: Axes, name: str, ratios: Ratios, aside: float) -> None:
    style = STYLES[name].line(linestyle="none", markeredgecolor=INK, markersize=5, zorder=4)
    places = [row + aside for row in range(len(ratios))]
    axes.plot([ratio.value for ratio in ratios.values()], places, **style)
    for place, ratio in zip(places, ratios.values(), strict=True):
        if not math.isnan(ratio.low):
            axes.plot([ratio.low, ratio.high], [place] * 2, color=STYLES[name].colour, linewidth=1.3)


def _forces(axes: Axes, ratios: Mapping[str, Ratios]) -> None:
    """Write the mean forces behind the ratios, on the right."""
    beside: Any = {
        "xycoords": ("axes fraction", "data"),
        "xytext": (4, 0),
        "textcoords": "offset points",
        "va": "center",
        "fontsize": SMALL,
        "color": GREY,
        "annotation_clip": False,
    }
    first = next(iter(ratios.values()))
    axes.annotate("[N]", (1.0, -0.9), **{**beside, "fontsize": NORMAL - 1})
    for row, (condition, ratio) in enumerate(first.items()):
        ours = " / ".join(f"{own[condition].mine:.1f}" for own in ratios.values())
        axes.annotate(f"{ratio.theirs:.1f} → {ours}", (1.0, row), **beside)
