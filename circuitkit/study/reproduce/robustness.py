"""Robustness: what the circuit gains over the open loop in worlds for which it was not tuned."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from circuitkit.draw.style import EXCITATORY, GREY, INK, SMALL, house_style, new_figure, tidy
from circuitkit.study import load_study
from circuitkit.study.reproduce.drawing import WIDTH_IN, save
from circuitkit.study.reproduce.each_seed import Ratio, forces_by, paired_ratio, seeds_in_words
from circuitkit.study.reproduce.finding import Claim, Finding, Picture, Table, all_hold, reaches
from circuitkit.study.reproduce.job import Effort, Job
from circuitkit.study.reproduce.numbers import count, plain, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLE = "Robustness of the result"
EFFORT = Effort(full_s=600.0, quick_s=80.0)
STUDY = "robustness"
NOMINAL = "nominal"
_QUICK: Mapping[str, Any] = {"seeds": {"count": 3}, "search": {"step": "4 N"}}
_KEPT = 0.5  # of the nominal gain


def run(job: Job) -> Finding:
    """Search the largest survived forces in every condition, with and without circuit; draw the ratios."""
    study = load_study(STUDY)
    study = study.with_(_QUICK) if job.quick else study
    forces = forces_by(job.sweep(study).limits(), "condition", "contender")
    ratios = {
        condition: paired_ratio(forces[condition, "binn_tuned"], forces[condition, "open_loop"])
        for condition in dict.fromkeys(condition for condition, _ in forces)
    }
    seeds = len(study.seeds)
    return Finding(
        figure=job.figure,
        title=TITLE,
        claims=claims_of(ratios, seeds),
        pictures=(_draw(job, ratios),),
        tables=(_table(ratios),),
        text=words(f"""
        Robot, sensors and floor differ from those that the walk is planned for and the circuit is tuned
        in; walk and circuit do not know. In each condition, for each of {seeds} seeds and both
        directions, the largest force of 0.2 s that the robot survives is searched, with the circuit
        `binn_lateral_tuned` and in open loop. The ratio is that of the means; its interval (95 %) is a
        bootstrap over the seeds, which both share, so that it tells what other noise and other moments of
        the push might have given."""),
        seeds=seeds_in_words(study),
        studies=(STUDY,),
        data={condition: vars(ratio) for condition, ratio in ratios.items()},
    )


def claims_of(ratios: Mapping[str, Ratio], seeds: int) -> tuple[Claim, ...]:
    """Whether the gain is there in every condition, and how much of it stays."""
    nominal = ratios[NOMINAL]
    others = {name: ratio for name, ratio in ratios.items() if name != NOMINAL}
    sure = sum(ratio.low > 1 for ratio in others.values())
    lost = [name for name, ratio in others.items() if not ratio.low > 1]
    gain = nominal.value - 1
    kept = sum(ratio.value - 1 >= _KEPT * gain for ratio in others.values()) if gain > 0 else 0
    worst = min(others, key=lambda name: others[name].value)
    how = f"mean force survived, 0.2 s, both directions, circuit over open loop; {seeds} seeds, bootstrap"
    return (
        Claim(
            "The circuit gains over the open loop where robot, sensors or floor are not as planned",
            "-",
            f"in {count(sure, len(others))} conditions (95 % interval above 1)",
            how,
            reaches(sure, len(others), 0),
            why=f"Not sure in: {', '.join(lost)}." if lost else "",
            source="beyond the paper",
        ),
        Claim(
            "At least half of the nominal gain stays",
            "-",
            f"in {count(kept, len(others))} conditions; nominal ratio {_ratio(nominal)}, "
            f"least {_ratio(others[worst])} ({worst})",
            how,
            all_hold(kept == len(others)) if kept in (0, len(others)) else reaches(kept, len(others), 0),
            source="beyond the paper",
        ),
    )


def _ratio(ratio: Ratio) -> str:
    if math.isnan(ratio.value):
        return "none: the open loop survives nothing"
    if math.isnan(ratio.low):
        return f"{ratio.value:.2f}"
    return f"{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"


def _table(ratios: Mapping[str, Ratio]) -> Table:
    rows = tuple(
        (name, plain(ratio.theirs), plain(ratio.mine), _ratio(ratio)) for name, ratio in ratios.items()
    )
    headings = ("condition", ">open loop [N]", ">circuit [N]", ">ratio (95 % interval)")
    return Table("Mean of the largest survived forces over seeds and directions", headings, rows)


def _draw(job: Job, ratios: Mapping[str, Ratio]) -> Picture:
    with house_style():
        figure = new_figure(WIDTH_IN, 0.235 * len(ratios) + 1.0)
        figure.set_layout_engine("constrained")
        axes = figure.subplots()
        _forest(axes, ratios)
        file = save(figure, job.folder, "robustness")
    caption = words("""
        Largest force survived with the circuit over that in open loop, in each condition, with its 95 %
        interval by a bootstrap over seeds. On the right the two mean forces. Dashed, no gain; dotted, the
        gain in nominal conditions.""")
    return Picture(
        file, caption, "A row for each condition with the ratio of circuit over open loop and its interval."
    )


def _forest(axes: Axes, ratios: Mapping[str, Ratio]) -> None:
    tidy(axes)
    rows = range(len(ratios))
    axes.set(ylim=(len(ratios) - 0.4, -0.6), yticks=list(rows), yticklabels=list(ratios))
    axes.tick_params(axis="y", length=0)
    axes.axvline(1.0, color=INK, linewidth=0.9, linestyle="--")
    axes.axvline(ratios[NOMINAL].value, color=GREY, linewidth=0.9, linestyle=":")
    for row, (name, ratio) in zip(rows, ratios.items(), strict=True):
        marker = "D" if name == NOMINAL else "o"
        if not math.isnan(ratio.low):
            axes.plot(
                [ratio.low, ratio.high], [row, row], "|-", color=EXCITATORY, linewidth=1.4, markersize=5
            )
        axes.plot([ratio.value], [row], marker, color=EXCITATORY, markeredgecolor=INK, markersize=5, zorder=4)
        text = f"{plain(ratio.theirs)} N → {plain(ratio.mine)} N"
        axes.annotate(
            text, (1.0, row), xycoords=("axes fraction", "data"), xytext=(4, 0), textcoords="offset points",
            va="center", fontsize=SMALL, color=GREY, annotation_clip=False,
        )  # fmt: skip
    axes.set_xlabel("largest force survived: circuit / open loop")
