"""Makes the figure of pushes from all around, by the direction of the force (section 6's outlook)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from circuitkit.draw.style import (
    EXCITATORY,
    GREY,
    INHIBITORY,
    INK,
    NORMAL,
    PALE,
    SMALL,
    house_style,
    new_figure,
    tidy,
)
from circuitkit.paper.push_bounds import BoundsAround, dcm_bounds_around
from circuitkit.paper.reproduce.drawing import STYLES, WIDTH_IN, LineStyle, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    Verdict,
    all_hold,
    count,
    one_line,
    plain,
    reaches,
    seeds_in_words,
    signed_percent,
)
from circuitkit.paper.reproduce.forces import DIRECTION, DURATION, Forces, bounds, by_contender
from circuitkit.paper.runs import plan_of
from circuitkit.study import Study

Array = NDArray[np.float64]

STUDY, SAGITTAL, LATERAL = "polar", "sagittal", "planar_lateral"
OPEN, PLANAR, OMNI = "open_loop", "binn_planar_tuned", "binn_omnidirectional_tuned"
OUTLINE_RAD = np.radians(np.arange(360))
TARGET = 0.95  # of the lateral network's force, that the planar one shall keep
_BEYOND = "beyond the paper (section 6)"
_QUICK: Mapping[str, Any] = {"seeds": {"count": 3}, "search": {"step": "2 N", "check_below": 0}}
_QUICK_AROUND: Mapping[str, Any] = {DIRECTION: [f"{angle} deg" for angle in range(0, 360, 30)]}
_QUICK_LINES: Mapping[str, Any] = {DURATION: ["0.2 s"]}
_STYLES: Mapping[str, LineStyle] = {
    "point_mass": STYLES["point_mass"],
    "bound": STYLES["bound"],
    OPEN: STYLES[OPEN],
    PLANAR: LineStyle("planar circuit (2 networks)", EXCITATORY, "-", "s"),
    OMNI: LineStyle("omnidirectional circuit (3 networks)", INHIBITORY, (0, (3, 1.5)), "D", filled=False),
}
_NAMES = {
    "binn": "binn_sagittal, as the paper reads",
    "binn_yielding": "the same, towards the edge",
    "binn_tuned": "binn_sagittal_tuned",
    OPEN: "open loop",
}


@dataclass(frozen=True)
class Around:
    """Forces by direction, [N].

    Attributes:
        angles_rad: Directions; 0 is forward, a quarter turn is to the left; shape (n,).
        survived: The largest force that was survived, by contender; each of shape (n,).
        bounds: What the ankles of a robot with an upright torso can hold at most.
        outline: The same in each of `OUTLINE_RAD`, since between two directions it is no straight line.
        duration_s: How long the push lasts.
    """

    angles_rad: Array
    survived: Mapping[str, Array]
    bounds: BoundsAround
    outline: BoundsAround
    duration_s: float

    def ratio(self, contender: str) -> float:
        """Take the mean of the force over that in open loop, where the open loop survives any."""
        there = self.survived[OPEN] > 0
        return float((self.survived[contender][there] / self.survived[OPEN][there]).mean())

    def of_bound(self, contender: str) -> float:
        """Take the mean of the part of the bound that is reached, for a torso that stays upright."""
        return float((self.survived[contender] / self.bounds.upright_n).mean())

    def not_worse(self, contender: str) -> int:
        """Count the directions in which it survives as much as the open loop, or more."""
        return int((self.survived[contender] >= self.survived[OPEN]).sum())


class Polar(ReportFigure):
    """Searches the force survived from 24 directions; forward and to the side over durations."""

    kind: ClassVar[str] = "polar"
    order: ClassVar[int] = 20
    title: ClassVar[str] = "Pushes from all directions"
    studies: ClassVar[tuple[str, ...]] = (STUDY, SAGITTAL, LATERAL)
    effort: ClassVar[Effort] = Effort(full_s=700.0, quick_s=90.0)

    def run(self, job: Job) -> Finding:
        """Search the boundary in each direction, and along x and y that of the networks for one direction."""
        study = _study(job, STUDY, _QUICK_AROUND)
        around = measure(job, study)
        ahead = _along(
            job,
            SAGITTAL,
            {**_QUICK_LINES, "reference.gait": ["gait_march"]},
            {"reference.gait": ["gait_march"]},
        )
        sides = _along(job, LATERAL, _QUICK_LINES)
        runs = len(study.seeds)
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=_claims(around, ahead, sides, runs),
            pictures=(_draw(job, around, runs),),
            tables=(
                _table(around),
                _line_table(ahead, "Largest force survived in all runs, to the front and to the back [N]"),
                _line_table(sides, "Largest force survived in all runs, to the side [N]"),
            ),
            text=_text(around, study),
            seeds=seeds_in_words(study.seeds),
            studies=self.studies,
            data={
                "direction_deg": np.degrees(around.angles_rad).round(9),
                "largest_survived_n": around.survived,
                "bound_torso_upright_n": around.bounds.upright_n,
                "bound_point_mass_n": around.bounds.point_mass_n,
                "duration_s": around.duration_s,
            },
        )


def _study(
    job: Job, name: str, quick_axes: Mapping[str, Any], axes: Mapping[str, Any] | None = None
) -> Study:
    study = job.study(name, {**_QUICK, "axes": quick_axes})
    return study.with_({"axes": axes}) if axes and not job.quick else study


def measure(job: Job, study: Study) -> Around:
    """Search the largest survived force of all contenders in all directions, with the bound."""
    forces: dict[str, dict[float, float]] = {}
    for limit in job.sweep(study, apart="contender").limits():
        angle = float(str(limit.labels[DIRECTION]))
        forces.setdefault(str(limit.labels["contender"]), {})[angle] = limit.largest
    angles = np.array(sorted(next(iter(forces.values()))))
    survived = {name: np.array([found[angle] for angle in angles]) for name, found in forces.items()}
    plan = plan_of(study)
    duration = plan.scenario.pushes[0].duration
    outline = dcm_bounds_around(plan, OUTLINE_RAD, duration)
    return Around(angles, survived, dcm_bounds_around(plan, angles, duration), outline, duration)


def _along(
    job: Job, name: str, quick_axes: Mapping[str, Any], axes: Mapping[str, Any] | None = None
) -> Forces:
    """Search the same along one axis, over durations."""
    study = _study(job, name, quick_axes, axes)
    survived = by_contender(job.sweep(study, apart="contender").limits())
    plan = plan_of(study, study.cells[0].settings)
    return Forces(survived, *bounds(plan, next(iter(survived.values()))))


def _claims(around: Around, ahead: Forces, sides: Forces, runs: int) -> tuple[Claim, ...]:
    how = f"largest force survived in all of {runs} runs, mean of the ratios over"
    kept = sides.ratio(PLANAR, "binn_lateral")
    directions = len(around.angles_rad)
    gained = ahead.ratio("binn_tuned", OPEN)
    worse = [k for k in ahead.kinds if ahead.survived["binn_tuned"][k] < ahead.survived[OPEN][k]]
    ahead_verdict = Verdict.PARTLY if worse else Verdict.HOLDS
    return (
        _gain("Two networks hold pushes from all directions of the plane", PLANAR, around, how),
        _gain("Three networks hold omnidirectional pushes", OMNI, around, how),
        Claim(
            "No direction is worse with the planar circuit than in open loop",
            "-",
            count(around.not_worse(PLANAR), directions),
            f"directions in which binn_planar_tuned survives as much or more; {runs} runs each",
            reaches(around.not_worse(PLANAR), directions),
            source=_BEYOND,
        ),
        Claim(
            "The network for x gains over the open loop for pushes from behind and from the front",
            "-",
            f"{signed_percent(gained)}; less in {count(len(worse), len(ahead.kinds))} kinds of push",
            f"binn_sagittal_tuned; {how} durations and both directions",
            ahead_verdict if gained > 1 else Verdict.FAILS,
            source="sections 4.2 and 6",
        ),
        Claim(
            "The planar circuit loses less than 5 % of what the lateral one holds to the side",
            "-",
            signed_percent(kept),
            f"binn_planar_tuned over the lateral circuit in it alone; {how} durations and both directions",
            reaches(kept, TARGET),
            source=_BEYOND,
        ),
    )


def _gain(claim: str, contender: str, around: Around, how: str) -> Claim:
    """Judge a gain on average; all directions are claimed, so one worse than the open loop is too many."""
    ratio, directions = around.ratio(contender), len(around.angles_rad)
    worse = directions - around.not_worse(contender)
    ours = f"{signed_percent(ratio)} over open loop; {around.of_bound(contender) * 100:.0f} % of the bound"
    ours += f"; less than the open loop in {count(worse, directions)} directions" if worse else ""
    text = f"{contender}; {how} {directions} directions, {around.duration_s:g} s; fails if one is worse"
    verdict = all_hold(ratio > 1 and not worse)
    return Claim(claim, "planned", ours, text, verdict, source=_BEYOND)


def _text(around: Around, study: Study) -> str:
    seeds = len(study.seeds)
    step = study.search.step if study.search is not None else ""
    return one_line(f"""
        A push at the torso for {around.duration_s:g} s begins in *lift* while the left foot carries, marching
        on the spot, from {len(around.angles_rad)} directions: 0° is forward, 90° to the left, which is away
        from the foot in the air. A force counts as survived if the robot stands 5 s after the push in all
        {seeds} runs, on a grid of {step}, and also with the forces next below. The bound is that of the
        DCM in the plane: along each direction the way from the DCM at the start of the push to the edge of
        the support, the hull of both soles, since inward the foot in the air catches the body. Dotted, for a
        torso that stays upright and is pushed where it is; pale, for a push at the height of the centre of
        mass. Where a foot tips the torso turns with it, which holds a little more. The planar circuit has one
        network for each axis, the omnidirectional one three at 120°; both
        read how far the capture point is from its plan. A network that reads the ZMP in x gains nothing:
        stiff ankles bring the ZMP to the toes by themselves, and there it says no more.""")


def _table(around: Around) -> Table:
    columns = [*around.survived.values(), around.bounds.upright_n, around.bounds.point_mass_n]
    rows = tuple(
        (f"{np.degrees(angle):.0f}°", *(plain(float(column[i])) for column in columns))
        for i, angle in enumerate(around.angles_rad)
    )
    names = [*around.survived, "bound", "point_mass"]
    headings = ("direction", *(f">{_STYLES[name].label}" for name in names))
    return Table(
        f"Largest force survived in all runs for {around.duration_s:g} s, by direction [N]", headings, rows
    )


def _line_table(forces: Forces, caption: str) -> Table:
    rows = [
        (_NAMES.get(name, name), *(plain(own[kind]) for kind in forces.kinds))
        for name, own in forces.survived.items()
    ]
    rows.append((_STYLES["bound"].label, *(plain(forces.bound[kind]) for kind in forces.kinds)))
    headings = ("", *(f">{kind.direction} {kind.duration_s:g} s" for kind in forces.kinds))
    return Table(caption, headings, tuple(rows))


def _draw(job: Job, around: Around, runs: int) -> Picture:
    with house_style():
        file = save(figure_of(around), job.folder, "polar")
    caption = one_line(f"""
        Left, the largest force that the walk survives in all of {runs} runs, by the direction of the push,
        {around.duration_s:g} s long, seen from above while the left foot carries; dotted, the bound for any
        control with the ankles that keeps the torso upright, pushed there and, pale, at the height of the
        centre of mass.
        Right, the same as a part of the bound for a push at the torso.""")
    alt = "A polar plot of the forces of both circuits, of the open loop and of the bound; and their ratios."
    return Picture(file, caption, alt)


def figure_of(around: Around) -> Figure:
    """Draw the forces around the robot, and the same as parts of the bound."""
    figure = new_figure(WIDTH_IN, 4.35)
    polar: Any = figure.add_axes((0.045, 0.2, 0.42, 0.695), projection="polar")
    share = figure.add_axes((0.6, 0.25, 0.385, 0.6))
    _polar(polar, around)
    _shares(share, around)
    handles, labels = polar.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=3, frameon=False)
    return figure


def _polar(axes: Any, around: Around) -> None:  # noqa: ANN401 - matplotlib does not type polar axes
    """Draw forces around the robot, forward up and left at the left."""
    axes.set_theta_zero_location("N")
    axes.set_axisbelow(True)
    curves = _curves(around)
    for name, (angles, values) in curves.items():
        closed = np.append(angles, angles[0]), np.append(values, values[0])
        axes.plot(*closed, **_STYLES[name].line(markersize=3.2, linewidth=1.2))
    largest = max(float(values.max()) for _, values in curves.values())
    rings = np.arange(10, largest, 10)
    axes.set_rlim(0, largest * 1.03)
    # Where the bound is near, the numbers of the rings beyond stand clear of all curves.
    nearest = int(around.bounds.point_mass_n.argmin())
    beside = float(np.degrees(around.angles_rad[nearest])) - 15.0
    free = rings > float(around.bounds.point_mass_n[nearest]) * 1.6
    numbers = [f"{ring:.0f} N" if clear else "" for ring, clear in zip(rings, free, strict=True)]
    axes.set_rgrids(rings, labels=numbers, angle=beside, color=GREY, fontsize=SMALL - 0.5)
    axes.set_thetagrids(range(0, 360, 30), labels=[_direction(angle) for angle in range(0, 360, 30)])
    axes.tick_params(axis="x", pad=1, labelsize=SMALL)
    axes.grid(color=PALE, linewidth=0.5)
    axes.spines["polar"].set(color=GREY, linewidth=0.7)


def _direction(angle_deg: int) -> str:
    ways = {0: "forward", 90: "out-\nward", 180: "backward", 270: "in-\nward"}
    return ways.get(angle_deg, f"{angle_deg}°")


def _curves(around: Around) -> dict[str, tuple[Array, Array]]:
    """Collect angles and forces by name."""
    edges = {"bound": around.outline.upright_n, "point_mass": around.outline.point_mass_n}
    return {name: (OUTLINE_RAD, values) for name, values in edges.items()} | {
        name: (around.angles_rad, values) for name, values in around.survived.items()
    }


def _shares(axes: Axes, around: Around) -> None:
    """Draw parts of the bound over the direction."""
    tidy(axes)
    degrees = np.degrees(around.angles_rad)
    axes.axhline(100.0, **{**_STYLES["bound"].line(), "label": "_"})
    for name, values in around.survived.items():
        axes.plot(degrees, values / around.bounds.upright_n * 100, **_STYLES[name].line(markersize=3.2))
    axes.set(xlim=(-5, 350), ylim=(0, None), xticks=range(0, 360, 90))
    axes.set_xticklabels([_direction(angle).replace("-\n", "") for angle in range(0, 360, 90)])
    axes.set_xlabel("direction of the push", fontsize=NORMAL - 1, color=INK)
    axes.set_ylabel("part of the bound, torso upright [%]", fontsize=NORMAL - 1, color=INK)
