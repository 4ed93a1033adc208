"""Makes the figure of the outlook: a step for what the ankles cannot hold, and a circuit that hands over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from circuitkit.biped.plots import MM, PUSH_FILL
from circuitkit.draw.style import EXCITATORY, GREY, INHIBITORY, INK, NORMAL, house_style, new_figure, tidy
from circuitkit.paper.push_bounds import PushKind
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
from circuitkit.paper.reproduce.forces import Forces, listed, measure
from circuitkit.paper.runs import plan_of, record
from circuitkit.simulation import Recording
from circuitkit.study import CaseBuilder, Study

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

STUDY = "stepping"
_QUICK: Mapping[str, Any] = {"seeds": {"count": 2}, "search": {"step": "3 N", "check_below": 0}}
_STYLES: Mapping[str, LineStyle] = {
    "open_loop": STYLES["open_loop"],
    "ankles": LineStyle("ankle circuit alone", STYLES["binn_tuned"].colour, (0, (4, 1.5)), "s", filled=False),
    "stepping": LineStyle("with steps beside it", INHIBITORY, "-", "D"),
    "bound": STYLES["bound"],
    "point_mass": STYLES["point_mass"],
}
_DIRECTIONS = ("outward", "inward")
_CALM_S, _QUICK_CALM_S = 60.0, 10.0
_BEFORE_S, _AFTER_S = 0.4, 4.6
_BEYOND = "section 5.2, outlook"


@dataclass(frozen=True)
class Calm:
    """A walk that nobody pushes.

    Attributes:
        duration_s: How long.
        survived: Whether it stands at the end.
        stepping_ticks: In how many ticks the circuit let a step act.
        nearest_m: How near the DCM came to where a step would begin; negative is inside.
        apart_m: Largest difference of any position from the walk under the ankle circuit alone.
    """

    duration_s: float
    survived: bool
    stepping_ticks: int
    nearest_m: float
    apart_m: float


class Stepping(ReportFigure):
    """Steps where the ankles cannot hold a push any more."""

    kind: ClassVar[str] = "stepping"
    order: ClassVar[int] = 50
    title: ClassVar[str] = "Stepping beside the ankles"
    studies: ClassVar[tuple[str, ...]] = (STUDY,)
    effort: ClassVar[Effort] = Effort(full_s=160.0, quick_s=30.0)

    def run(self, job: Job) -> Finding:
        """Search the largest forces, watch a walk without pushes, draw a run that only a step survives."""
        study = job.study(STUDY, _QUICK)
        forces = measure(job, study)
        calm = walk_calmly(study, _QUICK_CALM_S if job.quick else _CALM_S)
        shown = most_gained(forces)
        seeds = study.seeds
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=_claims(forces, calm, len(seeds)),
            pictures=(_draw_forces(job, forces, len(seeds)), _draw_run(job, study, shown, forces)),
            tables=(_table(forces),),
            text=_text(study, calm),
            seeds=f"{seeds_in_words(seeds)}; what is drawn and the walk without pushes: seed {seeds[0]}",
            studies=self.studies,
            data={
                "largest_survived_n": listed(forces.survived),
                "bound_n": list(forces.bound.values()),
                "calm_s": calm.duration_s,
                "calm_stepping_ticks": calm.stepping_ticks,
                "calm_nearest_m": calm.nearest_m,
                "calm_apart_m": calm.apart_m,
            },
        )


def most_gained(forces: Forces) -> PushKind:
    """Find the push of which steps hold most more than the ankles alone."""
    mine, theirs = forces.survived["stepping"], forces.survived["ankles"]
    return max(forces.kinds, key=lambda kind: mine[kind] - theirs[kind])


def walk_calmly(study: Study, duration_s: float) -> Calm:
    """Walk without pushes, with steps allowed and under the ankle circuit alone."""
    alone = _settings(study, "ankles") | {"push": [], "duration": f"{duration_s} s"}
    ankles = CaseBuilder(study).case(alone)
    plan, specs = ankles.plan(), [ankles.spec(study.seeds[0])]
    found, other = (record(plan, controller, specs) for controller in ("stepping", ankles.controller))
    dcm, left, right = (_traced(found, name) for name in ("dcm_y", "left_limit", "right_limit"))
    acting = _traced(found, "step_share_left") + _traced(found, "step_share_right")
    ticks = min(found.ticks, other.ticks)
    return Calm(
        duration_s=duration_s,
        survived=found.ended_s() is None,
        stepping_ticks=int(np.count_nonzero(acting)),
        nearest_m=float(np.maximum(dcm - left, right - dcm).max()),
        apart_m=float(np.abs(found.qpos[:ticks] - other.qpos[:ticks]).max()),
    )


def _settings(study: Study, contender: str) -> dict[str, Any]:
    """Collect the fields that a contender of the study sets."""
    return dict(next(cell.settings for cell in study.cells if cell.labels["contender"] == contender))


def _traced(recording: Recording, name: str) -> Array:
    """Take what the controller recorded of itself; shape (T,)."""
    return np.asarray(recording.trace[:, 0, recording.trace_names.index(name)])


def _claims(forces: Forces, calm: Calm, runs: int) -> tuple[Claim, ...]:
    stepping, kinds = forces.survived["stepping"], forces.kinds
    above = [kind for kind in kinds if stepping[kind] > forces.bound[kind]]
    alone = [kind for kind in kinds if forces.survived["ankles"][kind] > forces.bound[kind]]
    best = max(kinds, key=lambda kind: stepping[kind] / forces.bound[kind])
    ratio, won = forces.ratio("stepping", "ankles"), forces.wins("stepping", "ankles")
    worse = forces.wins("ankles", "stepping")
    supplemented = Verdict.PARTLY if worse else Verdict.HOLDS
    how = f"largest force survived in all of {runs} runs, durations and directions of the study"
    return (
        Claim(
            "For stronger pushes steps supplement the ankles",
            "proposed",
            f"{signed_percent(ratio)} on average, more in {count(won, len(kinds))} kinds of push, "
            f"less in {worse}",
            f"controller stepping over its ankle circuit alone; {how}",
            supplemented if ratio > 1 else Verdict.FAILS,
            source=_BEYOND,
        ),
        Claim(
            "With steps the walk survives beyond the bound of the ankles",
            "-",
            f"in {count(len(above), len(kinds))} kinds of push (the ankles alone in {len(alone)}); most: "
            f"{plain(stepping[best])} N against {plain(forces.bound[best])} N, {best.direction} for "
            f"{best.duration_s:g} s",
            f"the bound by the DCM for ankles alone, torso upright; {how}",
            reaches(len(above), len(kinds), 0),
            why=one_line("""
            Mostly it is no step in the air: after some 50 ms the body has tipped onto the other foot, or it
            falls over the foot on which it stands. Spreading the leg then pushes the body back from it. The
            bound is for a torso that stays upright; one that leans for a moment takes up some of the push, so
            ankles may exceed it, too."""),
            source="beyond the paper",
        ),
        Claim(
            "A walk that nobody pushes stays with the ankles",
            "-",
            f"a step acts in {calm.stepping_ticks} of the ticks of {calm.duration_s:g} s; positions differ "
            f"by {plain(calm.apart_m)} m at most",
            "gait_march, controller stepping against its ankle circuit alone, same seed",
            all_hold(calm.survived and calm.stepping_ticks == 0),
            source="beyond the paper",
        ),
    )


def _text(study: Study, calm: Calm) -> str:
    step = study.search.step if study.search is not None else ""
    return one_line(f"""
        While the DCM (capture point) stays where the ankles can hold it, the ankle circuit acts alone. When
        it comes near the end of that, the circuit `hand_over` lets a step act as well: the leg on the side of
        the fall goes outward by the DCM's error at the end of the step, (ξ - ξ_planned) exp(ω t), as far as
        it reaches, and stretches; the times of the walk stay. Pushes and what counts as survived are those of
        Fig. 11; forces lie on a grid of {step}. Undisturbed the DCM keeps {-calm.nearest_m * MM:.0f} mm or
        more away from the end of what the ankles can hold.""")


def _table(forces: Forces) -> Table:
    headings = ("", *(f">{kind.direction} {kind.duration_s:g} s" for kind in forces.kinds), ">of the bound")
    rows = [
        (
            _STYLES[name].label,
            *(plain(own[kind]) for kind in forces.kinds),
            f"{forces.of_bound(name) * 100:.0f} %",
        )
        for name, own in forces.survived.items()
    ]
    for name, bound in (("bound", forces.bound), ("point_mass", forces.point_mass)):
        rows.append((_STYLES[name].label, *(plain(bound[kind]) for kind in forces.kinds), ""))
    return Table("Largest force survived in all runs [N]", headings, tuple(rows))


def _draw_forces(job: Job, forces: Forces, runs: int) -> Picture:
    with house_style():
        figure = new_figure(WIDTH_IN, 3.4)
        figure.set_layout_engine("constrained")
        panels = figure.subplots(1, 2)
        for axes, direction in zip(panels, _DIRECTIONS, strict=True):
            kinds = forces.of_direction(direction)
            durations = [kind.duration_s for kind in kinds]
            tidy(axes)
            for name, own in forces.survived.items():
                axes.plot(durations, [own[kind] for kind in kinds], **_STYLES[name].line())
            for name, bound in (("bound", forces.bound), ("point_mass", forces.point_mass)):
                axes.plot(durations, [bound[kind] for kind in kinds], **_STYLES[name].line(linewidth=1.6))
            axes.set_title(direction, fontsize=NORMAL)
            axes.set(xlabel="duration of the force [s]", xlim=(0.05, 0.45), xticks=[0.1, 0.2, 0.3, 0.4])
            axes.set_ylim(bottom=0)
        panels[0].set_ylabel(f"largest force survived\nin all of {runs} runs [N]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        file = save(figure, job.folder, "stepping")
    caption = one_line(f"""
        Largest force that the walk survives in all of {runs} runs. Left, pushed away from the foot in the
        air; right, towards it. The bound is for ankles alone.""")
    return Picture(file, caption, "Force over duration: open loop, ankles alone, with steps, and the bound.")


def _draw_run(job: Job, study: Study, kind: PushKind, forces: Forces) -> Picture:
    """Draw the DCM, who acts and where the feet go, in a run at the largest force that steps survive."""
    force = forces.survived["stepping"][kind]
    push = {
        "controller": "stepping",
        "push.direction": kind.direction,
        "push.duration": f"{kind.duration_s} s",
        "push.force": f"{max(force, 1.0)} N",
    }
    plan = plan_of(study, push)
    recording = record(plan, "stepping", [plan.own_spec(study.seeds[0])])
    start, end = recording.effects.windows_s[0]
    dt = recording.step_s
    ticks = np.arange(recording.ticks)
    shown = (ticks * dt > start - _BEFORE_S) & (ticks * dt < start + _AFTER_S)
    time_s = ticks[shown] * dt - start
    with house_style():
        figure = new_figure(WIDTH_IN, 5.0)
        figure.set_layout_engine("constrained")
        panels = figure.subplots(3, 1, sharex=True, height_ratios=[6, 1.3, 4])
        for axes in panels:
            tidy(axes)
            axes.axvspan(0.0, end - start, color=PUSH_FILL, alpha=0.5, linewidth=0)
        _dcm_panel(panels[0], time_s, recording, shown)
        _acting_panel(panels[1], time_s, recording, shown)
        _legs_panel(panels[2], time_s, recording, shown)
        panels[2].set(xlabel="time from the start of the push [s]", xlim=(time_s[0], time_s[-1]))
        file = save(figure, job.folder, "stepping_run")
    caption = one_line(f"""
        {plain(force)} N {kind.direction} for {kind.duration_s:g} s. Above, the DCM, where the ankles can hold
        it (between the dashed lines); in the middle, when the circuit lets a step act, against a fall to the
        left or to the right; below, what is added to the walk. Shaded, the push.""")
    return Picture(
        file, caption, "Time series: the DCM with its band, when a step acts, and the angles that are added."
    )


_LEGEND: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "frameon": False, "borderaxespad": 0.2}


def _dcm_panel(axes: Axes, time_s: Array, recording: Recording, shown: Flags) -> None:
    series = {name: _traced(recording, name)[shown] * MM for name in ("dcm_y", "left_limit", "right_limit")}
    planned = series["dcm_y"] - _traced(recording, "dcm_error_y")[shown] * MM
    axes.plot(time_s, series["dcm_y"], color=INK, linewidth=1.4, label="DCM")
    axes.plot(time_s, planned, color=GREY, linewidth=1.0, linestyle=":", label="as planned")
    for name, label in (("left_limit", "end of what the ankles can hold"), ("right_limit", None)):
        axes.plot(time_s, series[name], color=EXCITATORY, linewidth=1.0, linestyle="--", label=label)
    axes.set_ylabel("DCM, to the left [mm]")
    axes.legend(ncols=3, **_LEGEND)


def _acting_panel(axes: Axes, time_s: Array, recording: Recording, shown: Flags) -> None:
    """Draw bars where the circuit lets a step act."""
    rows = {"right": "step_share_right", "left": "step_share_left"}
    for height, name in enumerate(rows.values()):
        acts = _traced(recording, name)[shown] > 0
        axes.fill_between(
            time_s, height + 0.15, height + 0.85, where=acts, step="post", color=INHIBITORY, linewidth=0
        )
    axes.set(ylim=(0, len(rows)), yticks=[0.5, 1.5], yticklabels=list(rows), ylabel="step\nto the")
    axes.grid(visible=False, axis="y")


def _legs_panel(axes: Axes, time_s: Array, recording: Recording, shown: Flags) -> None:
    degrees = np.degrees(recording.commands[shown, 0])
    names: Sequence[str] = recording.command_names
    styles = {
        "left_foot_y": ("left leg, outward", 1.0, EXCITATORY, "-"),
        "right_foot_y": ("right leg, outward", -1.0, INHIBITORY, "--"),
        "ankle_roll": ("ankles, to the left", 1.0, INK, ":"),
    }
    for name, (label, sign, colour, dashes) in styles.items():
        if name in names:
            values = sign * degrees[:, names.index(name)]
            axes.plot(time_s, values, color=colour, linestyle=dashes, linewidth=1.2, label=label)
    axes.set_ylabel("added angle [deg]")
    axes.legend(ncols=3, **_LEGEND)
