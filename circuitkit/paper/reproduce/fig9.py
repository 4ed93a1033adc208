"""Makes figure 9: the centre of mass leaves its limit cycle when it is pushed, and returns to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from circuitkit.biped.plots import CYCLE_GREY, MM, PUSH_FILL, PUSHED
from circuitkit.draw.style import INK, NORMAL, house_style, new_figure, tidy
from circuitkit.paper.reproduce.drawing import WIDTH_IN, label_of, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    count,
    median_range,
    one_line,
    reaches,
    seeds_in_words,
)
from circuitkit.paper.reproduce.pushed_walk import (
    QUICK_SEEDS,
    SEEDS,
    PushedWalk,
    record_pushed_walk,
    time_to_limit_cycle_s,
)
from circuitkit.study import Share, load_study

Array = NDArray[np.float64]

STUDY = "fig9"
_BEFORE_S = 2.2  # two double steps of the limit cycle are drawn
_FELL_IN_PAPER = ("open_loop", "mpc")


class Fig9(ReportFigure):
    """Pushes with 20 N for 0.2 s: who stands, and how the centre of mass returns to its limit cycle."""

    kind: ClassVar[str] = "fig9"
    order: ClassVar[int] = 9
    title: ClassVar[str] = "Figure 9: trajectory of the centre of mass"
    studies: ClassVar[tuple[str, ...]] = (STUDY,)
    effort: ClassVar[Effort] = Effort(full_s=35.0, quick_s=15.0)

    def run(self, job: Job) -> Finding:
        """Push the walk with 20 N for 0.2 s under several controllers; draw it under the BiNN and without."""
        seeds = QUICK_SEEDS if job.quick else SEEDS
        study = load_study(STUDY).with_({"seeds": {"first": seeds.start, "count": len(seeds)}})
        shares = {
            str(share.labels["contender"]): share for share in job.sweep(study, apart="contender").shares()
        }
        walk = record_pushed_walk("circuit", seeds)
        returned = time_to_limit_cycle_s(walk)
        picture = _draw(job, walk, record_pushed_walk("open_loop", seeds[:1]))
        text = one_line(f"""
            The scenario `nao_push` is the paper's first simulation study: a push of 20 N for 0.2 s, sideways,
            in the movement *lift* of single support. Under the BiNN {median_range(returned, "s")} pass from
            the push until the centre of mass stays within 5 mm of its limit cycle, in the plane of position
            and velocity/ω; the cycle is the mean of the double steps before the push.""")
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=_claims(shares, returned),
            pictures=(picture,),
            tables=(_table(shares),),
            text=text,
            seeds=f"{seeds_in_words(seeds)}; the picture is of seed {seeds[0]}",
            studies=self.studies,
            data={
                "stood": {name: share.survived for name, share in shares.items()},
                "runs": {name: share.runs for name, share in shares.items()},
                "time_to_limit_cycle_s": returned,
            },
        )


def _claims(shares: Mapping[str, Share], returned: Sequence[float | None]) -> tuple[Claim, ...]:
    push = "20 N for 0.2 s in single support (nao_push), stands until the end"
    fell = {name: shares[name].runs - shares[name].survived for name in _FELL_IN_PAPER}
    source = "section 5.2"
    back = sum(value is not None for value in returned)
    return (
        Claim(
            "20 N for 0.2 s fells the open loop",
            "falls",
            f"falls in {count(fell['open_loop'], shares['open_loop'].runs)} runs",
            push,
            reaches(fell["open_loop"], shares["open_loop"].runs, 0),
            source=source,
        ),
        Claim(
            "20 N for 0.2 s fells the MPC of NAO's walk",
            "falls",
            f"falls in {count(fell['mpc'], shares['mpc'].runs)} runs",
            f"{push}; controller mpc: Wieber's, fed back joint angles",
            reaches(fell["mpc"], shares["mpc"].runs, 0),
            source=source,
        ),
        Claim(
            "The BiNN compensates that push and the robot walks on",
            "stands",
            f"stands in {count(shares['binn_tuned'].survived, shares['binn_tuned'].runs)} runs",
            f"{push}; circuit binn_lateral_tuned",
            reaches(shares["binn_tuned"].survived, shares["binn_tuned"].runs, 0),
            source=source,
        ),
        Claim(
            "The parameters determined by eq. 21 (w = 1.63°) are adequate",
            "stands",
            f"stands in {count(shares['binn'].survived, shares['binn'].runs)} runs",
            f"{push}; circuit binn_lateral, all numbers as the paper reads",
            reaches(shares["binn"].survived, shares["binn"].runs, 0),
            why=one_line("""
            Eq. 21 takes the ankle's angle for a shift of the CoM. Here the foot's edge limits the torque
            and decides the sign of the correction, and an angle that adds up in each step needs a smaller
            w. The tuned circuit has the same neurons and synapses with other numbers."""),
            source="sections 4.2 and 5.2",
        ),
        Claim(
            "The CoM returns to its limit cycle",
            "returns",
            f"returns in {count(back, len(returned))} runs, after {median_range(returned, 's')}",
            "CoM (y, velocity/ω) stays within 5 mm of its mean cycle before; circuit binn_lateral_tuned",
            reaches(back, len(returned), 0),
            source="Fig. 9",
        ),
    )


def _table(shares: Mapping[str, Share]) -> Table:
    rows = tuple(
        (
            label_of(name),
            count(share.survived, share.runs),
            f"{share.interval[0] * 100:.0f} to {share.interval[1] * 100:.0f} %",
        )
        for name, share in shares.items()
    )
    caption = (
        "Runs of nao_push in which the robot stands at the end, with the 95 % Wilson interval of the share"
    )
    return Table(caption, ("controller", ">stands", ">interval"), rows)


def _draw(job: Job, held: PushedWalk, fallen: PushedWalk) -> Picture:
    with house_style():
        figure = new_figure(WIDTH_IN, 3.9)
        figure.set_layout_engine("constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        _phase(left, held, f"{label_of('binn_tuned')}")
        _phase(right, fallen, label_of("open_loop"))
        limits = _limits(held)
        for axes in (left, right):
            axes.set(xlim=limits[0], ylim=limits[1], xlabel="position of the CoM, y [mm]")
        left.set_ylabel("velocity of the CoM, y [mm/s]")
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
        file = save(figure, job.folder, "fig9")
    ending = "leaves it" if fallen.survived[0] else "falls"
    caption = one_line(f"""
        Position and velocity of the centre of mass to the side, from the middle between the feet, left is
        positive: before the push (grey) and from it on (dark). Left, held by the BiNN; right, the same
        push in open loop, cut off at the frame where it {ending}.""")
    alt = "Two phase portraits of the CoM before the push and from it on: under the BiNN, and in open loop."
    return Picture(file, caption, alt)


def _phase(axes: Axes, walk: PushedWalk, title: str) -> None:
    start, end = walk.push_s(0)
    time = walk.recording.time_s
    y, v = walk.view.com_m[:, 0, 1] * MM, walk.view.com_velocity[:, 0, 1] * MM
    before = (time > start - _BEFORE_S) & (time <= start)
    after = (time >= start) & (np.arange(len(time)) < walk.end_tick(0))
    axes.set_title(title, fontsize=NORMAL)
    tidy(axes)
    axes.plot(y[before], v[before], color=CYCLE_GREY, linewidth=2.6, label="before the push")
    axes.plot(y[after], v[after], color=PUSHED, linewidth=1.0, label="from the push on")
    marks: Any = {
        "color": PUSH_FILL,
        "markeredgecolor": INK,
        "markersize": 6.5,
        "linestyle": "none",
        "zorder": 4,
    }
    for moment, marker, label in ((start, "o", "push begins"), (end, "s", "push ends")):
        axes.plot(np.interp(moment, time, y), np.interp(moment, time, v), marker, label=label, **marks)
    _arrows(axes, y[after], v[after])


def _arrows(axes: Axes, y: Array, v: Array) -> None:
    """Mark the direction of time along the first second after the push."""
    head = {"arrowstyle": "-|>", "color": PUSHED, "mutation_scale": 11, "shrinkA": 0, "shrinkB": 0}
    for tick in (12, 38, 64):
        if tick + 1 < len(y):
            axes.annotate(
                "",
                (y[tick + 1], v[tick + 1]),
                (y[tick], v[tick]),
                zorder=3,
                arrowprops=head,
                annotation_clip=True,
            )


def _limits(walk: PushedWalk) -> tuple[tuple[float, float], tuple[float, float]]:
    """Fit limits around all that the held walk did after it had settled, with a margin."""
    start = walk.push_s(0)[0]
    seen = walk.recording.time_s > start - _BEFORE_S
    found = []
    for values in (walk.view.com_m, walk.view.com_velocity):
        low, high = (float(end(values[seen, 0, 1])) * MM for end in (np.min, np.max))
        found.append((low - 0.12 * (high - low), high + 0.12 * (high - low)))
    return found[0], found[1]
