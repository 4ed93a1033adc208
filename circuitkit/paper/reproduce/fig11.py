"""Makes figure 11, the largest force that is survived in all of 20 runs, by its duration, with its claims."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from matplotlib.axes import Axes

from circuitkit.draw.style import INK, NORMAL, house_style, new_figure, tidy
from circuitkit.paper.push_bounds import PushKind
from circuitkit.paper.reproduce.drawing import STYLES, WIDTH_IN, label_of, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    Verdict,
    agrees,
    all_hold,
    count,
    one_line,
    plain,
    reaches,
    seeds_in_words,
    signed_percent,
)
from circuitkit.paper.reproduce.forces import Forces, listed, measure
from circuitkit.study import Study, wilson_interval

STUDY, THROUGH_COM = "fig11", "fig11_com"
_QUICK: Mapping[str, Any] = {
    "axes": {"push.duration": ["0.1 s", "0.2 s", "0.4 s", "0.7 s", "1.0 s"]},
    "seeds": {"count": 4},
    "search": {"step": "2 N", "check_below": 0},
}
_QUICK_COM: Mapping[str, Any] = {"seeds": {"count": 3}, "search": {"step": "4 N", "check_below": 0}}
DIRECTIONS = ("outward", "inward")
IMPROVEMENT, LARGEST_N, BOUND_N = 1.5255, 22.0, 22.48  # the paper's
TARGET_OF_BOUND, TARGET_OVER_MPC = 0.85, 1.5
READ, TUNED, CAPTURE = "binn", "binn_tuned", "binn_capture"
_IN_WORDS = {READ: "as the paper reads", TUNED: "tuned", CAPTURE: "reading the capture point"}
_SHORT_S = 0.3
_TUNED_FOR_S = (0.1, 0.2, 0.4)
_SOURCE, _BEYOND = "section 5.2", "beyond the paper"
_KNOWS_MORE = (
    "It reads the true centre of mass, which this MPC is not; its equal is the MPC that knows it, below."
)


class Fig11(ReportFigure):
    """Searches the largest force survived in all of 20 runs, by duration, beside the bound."""

    kind: ClassVar[str] = "fig11"
    order: ClassVar[int] = 11
    title: ClassVar[str] = "Figure 11: compensation of an external force"
    studies: ClassVar[tuple[str, ...]] = (STUDY, THROUGH_COM)
    effort: ClassVar[Effort] = Effort(full_s=900.0, quick_s=115.0)

    def run(self, job: Job) -> Finding:
        """Search the largest survived forces, set them beside the bound and the paper's, draw them."""
        study = job.study(STUDY, _QUICK)
        forces, at_com = measure(job, study), measure(job, job.study(THROUGH_COM, _QUICK_COM))
        seeds = study.seeds
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=claims_of(forces, at_com, len(seeds)),
            pictures=(_draw(job, forces, len(seeds)),),
            tables=(
                *(_table(forces, direction, "") for direction in DIRECTIONS),
                _means(forces),
                *(
                    _table(at_com, direction, ", pushed through the centre of mass")
                    for direction in DIRECTIONS
                ),
            ),
            text=_text(study),
            seeds=seeds_in_words(seeds),
            studies=self.studies,
            data={
                "largest_survived_n": listed(forces.survived),
                "dcm_bound_n": listed({"torso": forces.bound, "centre of mass": forces.point_mass}),
            },
        )


def _text(study: Study) -> str:
    seeds = len(study.seeds)
    share, _ = wilson_interval(seeds, seeds)
    step = study.search.step if study.search is not None else ""
    return one_line(f"""
        A push at the torso begins at the same moment of *lift*, in the first step of the walk's repeating
        part, outward or inward (towards the foot in the air). A force counts as survived if the robot
        stands 5 s after the push in all {seeds} runs, and also with the forces next below; forces lie on
        a grid of {step}. {seeds} of {seeds} runs mean that at least {share * 100:.0f} % stand (95 %
        Wilson interval). Robot, walk, pushes, noise and seeds are the same for all; what they know is not.
        `mpc` reads the angles of the joints, `binn` and `binn_tuned` the force cells; `mpc_full`,
        `dcm_ankle` and `binn_capture` are given the true centre of mass and its velocity, which no sensor
        of a NAO gives. The bound is what the DCM (capture point) allows any control with the ankles: the
        largest constant force after which it has not passed the outer edge that can still carry the
        robot, for a torso that stays upright and is pushed where it is, above the centre of mass. Who
        turns the torso, or tips it, may hold more than that. At the height of the centre of mass more
        could be held (point mass).""")


def _table(forces: Forces, direction: str, where: str) -> Table:
    kinds = forces.of_direction(direction)
    rows = [
        (label_of(name), *(_force(own[kind], name in forces.falls_unpushed) for kind in kinds))
        for name, own in forces.survived.items()
    ]
    rows.append((label_of("bound"), *(plain(forces.bound[kind]) for kind in kinds)))
    rows.append((label_of("point_mass"), *(plain(forces.point_mass[kind]) for kind in kinds)))
    headings = ("controller", *(f">{kind.duration_s:g} s" for kind in kinds))
    return Table(f"Largest force survived in all runs, {direction}{where} [N]", headings, tuple(rows))


def _force(force: float, falls: bool) -> str:
    return "falls unpushed" if falls and force == 0 else plain(force)


def _means(forces: Forces) -> Table:
    baselines = ("mpc", "mpc_full", "open_loop")
    rows = tuple(
        (
            label_of(name),
            *(signed_percent(forces.ratio(name, baseline)) for baseline in baselines),
            f"{forces.of_bound(name) * 100:.0f} %",
        )
        for name in forces.survived
    )
    headings = ("controller", *(f">over {label_of(name)}" for name in baselines), ">of the bound")
    return Table("Means of the ratios over durations and directions", headings, rows)


def _draw(job: Job, forces: Forces, runs: int) -> Picture:
    with house_style():
        figure = new_figure(WIDTH_IN, 4.4)
        figure.set_layout_engine("constrained")
        panels = figure.subplots(1, 2)
        for axes, direction in zip(panels, DIRECTIONS, strict=True):
            _panel(axes, forces, direction)
        panels[0].set_ylabel(f"largest force survived in all of {runs} runs [N]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        file = save(figure, job.folder, "fig11")
    caption = one_line(f"""
        Largest force that the walk survives in all of {runs} runs, by how long it acts. Left, pushed away
        from the foot in the air; right, towards it. Dotted, the bound for any control with the ankles
        that keeps the torso upright, pushed there and, pale, at the height of the centre of mass. The
        star is the one point that the paper's text gives of its figure, whose direction it does not give.""")
    return Picture(file, caption, "Force over duration: a curve for each controller, and those of the bound.")


def _panel(axes: Axes, forces: Forces, direction: str) -> None:
    kinds = forces.of_direction(direction)
    durations = [kind.duration_s for kind in kinds]
    tidy(axes)
    for name, bound in (("bound", forces.bound), ("point_mass", forces.point_mass)):
        axes.plot(durations, [bound[kind] for kind in kinds], **STYLES[name].line(linewidth=1.6))
    for name, own in forces.survived.items():
        axes.plot(durations, [own[kind] for kind in kinds], **STYLES[name].line())
    star: Any = {"color": INK, "markersize": 9, "linestyle": "none", "zorder": 5}
    axes.plot([0.1], [LARGEST_N], marker="*", label="BiNN in the paper, at most", **star)
    axes.set_title(direction, fontsize=NORMAL)
    axes.set(xlabel="duration of the force [s]", xlim=(0.0, 1.05), xticks=[0.2, 0.4, 0.6, 0.8, 1.0])
    axes.set_ylim(bottom=0)


def claims_of(forces: Forces, at_com: Forces, runs: int) -> tuple[Claim, ...]:
    """Judge all claims of Fig. 11.

    Args:
        forces: For pushes at the torso, of the contenders binn, binn_tuned, binn_capture, mpc and mpc_full.
        at_com: The same for pushes through the centre of mass; needs binn_capture only.
        runs: How many had to be survived.
    """
    how = f"mean of the ratios over durations and directions; all of {runs} runs survived"
    return (
        *(_every_duration(forces, name, runs) for name in (TUNED, CAPTURE)),
        *(_improvement(forces, name, how) for name in (READ, TUNED, CAPTURE)),
        _shorter(forces, how),
        _largest(forces, runs),
        _bound(forces, runs),
        *(_of_bound(forces, name, "at the torso") for name in (TUNED, CAPTURE)),
        _of_bound(at_com, CAPTURE, "through the centre of mass"),
        *(_over_mpc_where_tuned(forces, name) for name in (TUNED, CAPTURE)),
        *(_full_feedback(forces, name, how) for name in (TUNED, CAPTURE)),
    )


def _circuit(forces: Forces, name: str) -> str:
    return f"circuit {forces.circuits.get(name, name)}"


def _every_duration(forces: Forces, name: str, runs: int) -> Claim:
    won, pushes = forces.wins(name, "mpc"), len(forces.kinds)
    return Claim(
        f"The BiNN ({_IN_WORDS[name]}) withstands more than the MPC for every duration",
        "all",
        count(won, pushes),
        f"{_circuit(forces, name)} against mpc, in how many kinds of push it survives more; {runs} runs",
        reaches(won, pushes, 0),
        source=_SOURCE,
    )


def _improvement(forces: Forces, name: str, how: str) -> Claim:
    ratio = forces.ratio(name, "mpc")
    verdict = reaches(ratio, IMPROVEMENT, 1.0)
    alone = "It falls even without a push. " if name in forces.falls_unpushed else ""
    reason = f"{alone}On this plant the paper's w is too quick and lifts the edge of the foot: see Fig. 9."
    why = reason if name == READ and verdict is not Verdict.HOLDS else ""
    return Claim(
        f"The BiNN ({_IN_WORDS[name]}) is on average 52.55 % better than the MPC",
        "+52.55 %",
        signed_percent(ratio),
        f"{_circuit(forces, name)} over mpc; {how}",
        verdict,
        why=_KNOWS_MORE if name == CAPTURE else why,
        source=_SOURCE,
    )


def _shorter(forces: Forces, how: str) -> Claim:
    short = forces.ratio(TUNED, "mpc", [k for k in forces.kinds if k.duration_s <= _SHORT_S + 1e-9])
    long = forces.ratio(TUNED, "mpc", [k for k in forces.kinds if k.duration_s > _SHORT_S + 1e-9])
    return Claim(
        "The improvement is larger for shorter durations",
        "larger",
        f"{signed_percent(short)} up to {_SHORT_S:g} s, {signed_percent(long)} beyond",
        f"{_circuit(forces, TUNED)} over mpc; {how}",
        all_hold(short > long),
        source=_SOURCE,
    )


def _largest(forces: Forces, runs: int) -> Claim:
    kinds = [forces.shortest(direction) for direction in DIRECTIONS]
    found = {kind: forces.survived[TUNED][kind] for kind in kinds}
    return Claim(
        "The largest force, for 0.1 s, is 22 N",
        f"{LARGEST_N:g} N",
        ", ".join(f"{plain(force)} N {kind.direction}" for kind, force in found.items()),
        f"{_circuit(forces, TUNED)}, {kinds[0].duration_s:g} s, {runs} runs; the paper gives no direction",
        all_hold(*(agrees(force, LARGEST_N, 0.1) is Verdict.HOLDS for force in found.values())),
        why=one_line("""
        Inward, the foot in the air comes down and catches the robot, so that more can be held than on one
        foot; outward the edge of the foot that carries is near."""),
        source=_SOURCE,
    )


def _bound(forces: Forces, runs: int) -> Claim:
    best = max((TUNED, CAPTURE), key=lambda name: forces.survived[name][forces.largest(name)])
    kind = forces.largest(best)
    force = forces.survived[best][kind]
    return Claim(
        "Ankles hold no force above the 22.48 N of eq. 22",
        f"{BOUND_N} N",
        f"{plain(force)} N, {kind.direction} for {kind.duration_s:g} s",
        f"{_circuit(forces, best)}, the largest force of all, survived in all of {runs} runs",
        all_hold(force <= BOUND_N),
        why=one_line("""
        Eq. 22 is the bound for a push that lasts, at the height of the CoM. A short one ends before the
        capture point has gone far, so that m ω² L / (1 - exp(-ω d)) stands in its place; for long d that
        is eq. 22 with its own distance L."""),
        source="eq. 22",
    )


def _of_bound(forces: Forces, name: str, where: str) -> Claim:
    part = forces.of_bound(name, tuned_for(forces.kinds))
    return Claim(
        f"The BiNN ({_IN_WORDS[name]}) reaches 85 % of what ankles can hold, pushed {where}",
        "-",
        f"{part * 100:.0f} %",
        f"{_circuit(forces, name)} over the DCM bound, mean over 0.1, 0.2, 0.4 s and both directions",
        reaches(part, TARGET_OF_BOUND),
        source=_BEYOND,
    )


def _over_mpc_where_tuned(forces: Forces, name: str) -> Claim:
    ratio = forces.ratio(name, "mpc", tuned_for(forces.kinds))
    return Claim(
        f"The BiNN ({_IN_WORDS[name]}) holds 1.5 times what the MPC holds, for the durations it is tuned for",
        "-",
        signed_percent(ratio),
        f"{_circuit(forces, name)} over mpc, mean of the ratios over 0.1, 0.2, 0.4 s and both directions",
        reaches(ratio, TARGET_OVER_MPC),
        why=_KNOWS_MORE if name == CAPTURE else "",
        source=_BEYOND,
    )


def tuned_for(kinds: Sequence[PushKind]) -> list[PushKind]:
    """Pick the pushes with the durations that circuits are tuned for."""
    return [kind for kind in kinds if any(math.isclose(kind.duration_s, d) for d in _TUNED_FOR_S)]


def _full_feedback(forces: Forces, name: str, how: str) -> Claim:
    ratio = forces.ratio(name, "mpc_full")
    return Claim(
        f"The BiNN ({_IN_WORDS[name]}) withstands more than an MPC that knows the centre of mass",
        "-",
        signed_percent(ratio),
        f"{_circuit(forces, name)} over mpc_full; {how}",
        all_hold(ratio > 1.0),
        source=_BEYOND,
    )
