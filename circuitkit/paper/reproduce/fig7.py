"""Makes figure 7, w against the force of a push, by eq. 21 and as measured, with the bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray

from circuitkit.draw.style import (
    EXCITATORY,
    INHIBITORY,
    INK,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
)
from circuitkit.paper import equations as eq
from circuitkit.paper.design import body_of
from circuitkit.paper.design_figure import design_figure
from circuitkit.paper.design_sheet import (
    NAO_ANKLE_GEAR,
    PAPER_BODY,
    PAPER_GAMMA,
    PAPER_MOTOR_TORQUE_NM,
    PAPER_STEP_S,
    Body,
    Sheet,
    make_sheet,
)
from circuitkit.paper.push_bounds import PushKind
from circuitkit.paper.reproduce.drawing import WIDTH_IN, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    Verdict,
    agrees,
    all_hold,
    one_line,
    plain,
    seeds_in_words,
)
from circuitkit.paper.reproduce.forces import bounds
from circuitkit.paper.runs import plan_of
from circuitkit.simulation import Plan
from circuitkit.study import Results, Study

STUDY = "fig7"
_QUICK: Mapping[str, Any] = {
    "axes": {
        "circuit.w": ["-2.5 deg", "-1.2 deg", "-0.5 deg", "0 deg", "0.5 deg", "1.2 deg", "2.5 deg"],
        "push.force": ["4 N", "8 N", "12 N", "16 N", "20 N", "24 N", "28 N"],
    },
    "seeds": {"count": 4},
}

Array = NDArray[np.float64]

DIRECTION, W, FORCE = "push.direction", "circuit.w", "push.force"
DIRECTIONS = ("outward", "inward")
PUSH_N, PUSH_S = 20.0, 0.2  # section 5.2 and Fig. 7
PAPER_W_RAD, PAPER_EQ_22_N = math.radians(1.63), 22.48
PAPER_SHIFT_M, PAPER_ANGLE_RAD = 0.06, math.radians(22.0)  # section 4.2
PAPER_ZMP_BY_TORQUE_M = 0.0014  # section 4.2
_WITHIN = 0.02


@dataclass(frozen=True)
class Plane:
    """Survival over the plane of w and force, in one direction.

    Attributes:
        weights_rad: w, ascending; shape (k,).
        forces_n: Ascending; shape (f,).
        share: Which part of the runs was survived; shape (k, f).
        bound_n: Bound of the DCM for the push where it acts.
        point_mass_n: The same for a push at the height of the centre of mass.
    """

    weights_rad: Array
    forces_n: Array
    share: Array
    bound_n: float
    point_mass_n: float

    def largest_n(self, weight: int) -> float:
        """Find the largest force that all runs of a w survived, with every smaller one; 0 if none."""
        fallen = np.flatnonzero(self.share[weight] < 1.0)
        count = fallen[0] if len(fallen) else len(self.forces_n)
        return float(self.forces_n[count - 1]) if count else 0.0

    @property
    def best(self) -> int:
        """The w of the largest such force; of several that of the most runs survived."""
        return max(
            range(len(self.weights_rad)), key=lambda i: (self.largest_n(i), float(self.share[i].sum()))
        )


class Fig7(ReportFigure):
    """Draws w against force by eqs. 21 and 22, and the survival measured over the same plane."""

    kind: ClassVar[str] = "fig7"
    order: ClassVar[int] = 7
    title: ClassVar[str] = "Figure 7: w against the force"
    studies: ClassVar[tuple[str, ...]] = (STUDY,)
    effort: ClassVar[Effort] = Effort(full_s=480.0, quick_s=45.0)

    def run(self, job: Job) -> Finding:
        """Draw eq. 21 as the paper does, and who survived over the same plane."""
        sheet = make_sheet(force_n=PUSH_N, duration_s=PUSH_S, gamma=PAPER_GAMMA, step_s=PAPER_STEP_S)
        study = job.study(STUDY, _QUICK)
        plan = plan_of(study)
        planes = measure(job, study, plan)
        nao = body_of(plan.robot, plan.body.motion.knowledge.walk.gait)
        pictures = (
            Picture(
                save(design_figure(sheet), job.folder, "fig7"),
                "Left, as in the paper: w by eq. 21 against the force of a push of 0.2 s, with the bound of "
                "eq. 22. Right, what the paper does not show: how the bounds depend on the push's duration.",
                "Two panels: w over force with the stable region above a line, and force over duration",
            ),
            Picture(
                save(_measured_figure(planes, sheet), job.folder, "fig7_measured"),
                "Which part of the runs is survived: dark all, white none. Dashed: eq. 21 for either sign of "
                "w, by which the runs above the upper and below the lower line survive. Upright lines: the "
                "bounds of eq. 22 and of the DCM, for the push on the torso and for one at the centre of "
                "mass.",
                "Two planes of w and force, for pushes outward and inward, in shades of grey",
            ),
        )
        seeds = study.seeds
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=(*_claims_of_equations(nao), *_claims_of_runs(planes, len(seeds))),
            pictures=pictures,
            tables=(_table(planes),),
            text=one_line(_TEXT),
            seeds=seeds_in_words(seeds),
            studies=self.studies,
            data=_data(sheet, planes, nao),
        )


_TEXT = """
Eq. 21 gives the w that moves the centre of mass in each step as far as the push does; above its line the
paper calls the walk stable, below unstable. Measured is the paper's network with that w and three numbers
that it does not give (a leak of the angle, thresholds 4 mm inside the edges, one foot from 90 % of the load
on), for both signs of w: positive as eq. 14 is printed, away from the violated edge, negative towards it.
"""


def measure(job: Job, study: Study, plan: Plan) -> dict[str, Plane]:
    """Run the study for the survival over the plane, and work out the bounds on the same walk.

    Args:
        job: Runs the study.
        study: Its axes are direction, w and force.
        plan: Of its scenario.
    """
    results = job.sweep(study)
    kinds = tuple(PushKind(direction, PUSH_S) for direction in DIRECTIONS)
    upright, point_mass = bounds(plan, kinds)
    return {
        kind.direction: _plane(results, kind.direction, upright[kind], point_mass[kind]) for kind in kinds
    }


def _plane(results: Results, direction: str, bound_n: float, point_mass_n: float) -> Plane:
    shares = {
        (float(str(share.labels[W])), float(str(share.labels[FORCE]))): share.share
        for share in results.shares()
        if share.labels[DIRECTION] == direction
    }
    weights, forces = (sorted({pair[axis] for pair in shares}) for axis in (0, 1))
    table = np.array([[shares[weight, force] for force in forces] for weight in weights])
    return Plane(np.array(weights), np.array(forces), table, bound_n, point_mass_n)


def _claims_of_equations(nao: Body) -> Iterator[Claim]:
    mass, height = PAPER_BODY.mass_kg, PAPER_BODY.com_height_m
    robot = (mass, height, PAPER_STEP_S)
    weight = eq.weight_against_push(PUSH_N, PUSH_S, *robot, gamma=PAPER_GAMMA)
    gamma = eq.gamma_of_weight(PAPER_W_RAD, PUSH_N, PUSH_S, *robot)
    lasting = eq.largest_lasting_force(2 * PAPER_SHIFT_M, mass, height)
    short = eq.largest_force_for_duration(2 * PAPER_SHIFT_M, PUSH_S, mass, height)
    yield Claim(
        "20 N for 0.2 s need w = 1.63°",
        "1.63°",
        f"{math.degrees(weight):.3f}°",
        f"eq. 21, γ = {PAPER_GAMMA:g}",
        agrees(weight, PAPER_W_RAD, _WITHIN),
        f"1.63° is γ = {gamma:.3f}, less than the 1 that eq. 18 asks for.",
        "section 5.2, eq. 21",
    )
    yield Claim(
        "No force above 22.48 N can be held without a step",
        "22.48 N",
        f"{lasting:.2f} N for ever, {short:.2f} N for 0.2 s",
        "eq. 22 with g = 9.81 m/s², and the bound of the DCM with the same 0.12 m",
        all_hold(agrees(lasting, PAPER_EQ_22_N, _WITHIN) is Verdict.HOLDS, short <= PAPER_EQ_22_N),
        "The number agrees, but it is the bound for a push that lasts: as long as the capture point has not "
        "left the support when the push ends, the ankles can bring the body back.",
        "section 4.2, eq. 22",
    )
    bare, geared = (
        eq.zmp_shift_from_acceleration(eq.com_acceleration_from_torque(torque, mass, height), height)
        for torque in (PAPER_MOTOR_TORQUE_NM, eq.joint_torque(PAPER_MOTOR_TORQUE_NM, NAO_ANKLE_GEAR))
    )
    edge = nao.sole_edge_m or math.nan
    yield Claim(
        "The ankle's torque moves the ZMP by 0.0014 m at most, so only shifting the CoM counts",
        "0.0014 m",
        f"{bare:.4f} m with the motor's torque, {geared:.2f} m with the joint's; the sole ends at {edge:.3f}",
        "eqs. 2 and 13, with and without the gear",
        agrees(min(geared, edge), PAPER_ZMP_BY_TORQUE_M, _WITHIN),
        f"Eq. 13 takes the stall torque of the motor, 73.44 mN·m; behind the gear of {NAO_ANKLE_GEAR:g} the "
        f"joint has {PAPER_BODY.joint_torque_nm:.1f} N·m. The foot's edge is what limits it.",
        "section 4.2, eq. 13",
    )
    lever = nao.lever_m or math.nan
    shift = eq.com_shift_from_angle(PAPER_ANGLE_RAD, lever)
    yield Claim(
        "The CoM can shift by 0.06 m, at the ankle's 22°",
        "0.06 m",
        f"{shift:.3f} m; by eq. 16 it would be {eq.com_shift_from_angle(PAPER_ANGLE_RAD, height):.3f} m",
        "the model's kinematics, the hips turning back",
        agrees(shift, PAPER_SHIFT_M, 0.1),
        f"The paper's own number is not that of its eq. 16: with hips that turn back the lever is "
        f"{lever:.3f} m, not z_CoM = {height:g} m, and eqs. 17 and 21 ask for too small a w.",
        "section 4.2, eq. 16",
    )


def _claims_of_runs(planes: Mapping[str, Plane], seeds: int) -> Iterator[Claim]:
    above, below = (_survived(planes, as_printed=True, stable=stable) for stable in (True, False))
    towards = _survived(planes, as_printed=False, stable=True)
    runs = f"study `{STUDY}`, {seeds} runs a cell, both directions, forces up to eq. 22"
    yield Claim(
        "Above the line of eq. 21 the walk is stable, below it is not",
        "100 % and 0 %",
        f"{above:.0%} of the runs above survive, {below:.0%} of those below",
        f"{runs}, w > 0 as eq. 14 is printed",
        all_hold(above > 1 - _WITHIN, below < _WITHIN),
        "Eq. 21 knows neither that the angle must return nor that the foot may tip. A network that reads the "
        "ZMP and presses against the push drives it further to the edge and never lets go (decision 19); "
        "with the other sign, which yields, it is "
        f"{towards:.0%} above the line, and small w hold most.",
        "section 4.2, Fig. 7",
    )
    best = {direction: plane.largest_n(plane.best) for direction, plane in planes.items()}
    under = [
        best[direction] <= bound
        for direction, plane in planes.items()
        for bound in (plane.bound_n, plane.point_mass_n)
    ]
    yield Claim(
        "No w holds more than the bound of the DCM",
        "-",
        "; ".join(
            f"{direction}: {best[direction]:g} N at {math.degrees(plane.weights_rad[plane.best]):.3g}°, "
            f"bound {plain(plane.bound_n)} N on the torso, {plain(plane.point_mass_n)} N at the CoM"
            for direction, plane in planes.items()
        ),
        f"study `{STUDY}`, {seeds} runs a cell, survived in all of them",
        all_hold(*under),
        source="beyond the paper",
    )


def _survived(planes: Mapping[str, Plane], *, as_printed: bool, stable: bool) -> float:
    """Count which part of the runs is survived on one side of eq. 21, for one sign of w, up to eq. 22."""
    mass, height = PAPER_BODY.mass_kg, PAPER_BODY.com_height_m
    found = []
    for plane in planes.values():
        for i, weight in enumerate(plane.weights_rad):
            for k, force in enumerate(plane.forces_n):
                needed = eq.weight_against_push(float(force), PUSH_S, mass, height, PAPER_STEP_S, PAPER_GAMMA)
                has_sign = weight > 0 if as_printed else weight < 0
                on_this_side = bool(abs(weight) >= needed) == stable
                if has_sign and on_this_side and force <= PAPER_EQ_22_N:
                    found.append(plane.share[i, k])
    return float(np.mean(found)) if found else math.nan


def _table(planes: Mapping[str, Plane]) -> Table:
    weights = next(iter(planes.values())).weights_rad
    rows = tuple(
        (f"{math.degrees(weight):.3g}°", *(f"{plane.largest_n(i):g} N" for plane in planes.values()))
        for i, weight in enumerate(weights)
    )
    return Table(
        "Largest force of 0.2 s that all runs survive, with every smaller one, by w",
        ("w", *(f">{direction}" for direction in planes)),
        rows,
    )


def _measured_figure(planes: Mapping[str, Plane], sheet: Sheet) -> Figure:
    """Draw a plane for each direction: the survived share in shades of grey, with eq. 21 and the bounds."""
    left, top, between, bar, height, bottom = 0.62, 0.32, 0.22, 0.55, 2.7, 0.85
    width = (WIDTH_IN - left - between - bar - 0.35) / 2
    with house_style():
        figure = new_figure(WIDTH_IN, top + height + bottom)
        for i, (direction, plane) in enumerate(planes.items()):
            axes = axes_at(figure, left + i * (width + between), top, width, height)
            image = _paint_plane(axes, plane, sheet)
            axes.set_title(f"pushed {direction}", loc="left", fontsize=SMALL + 1.0)
            axes.set_xlabel("force of the push [N]")
            axes.tick_params(labelleft=i == 0)
            if i == 0:
                axes.set_ylabel(f"w [° in a step of {1e3 * sheet.step_s:g} ms]")
                plain_legend(axes, "upper left", (0.0, -0.18), ncols=2, columnspacing=2.0, handlelength=2.6)
        at = axes_at(figure, left + 2 * width + between + 0.15, top, 0.12, height)
        scale = figure.colorbar(image, cax=at)
        scale.set_label("part of the runs survived [1]")
        scale.outline.set_linewidth(0.6)
    return figure


def _paint_plane(axes: Axes, plane: Plane, sheet: Sheet) -> Any:  # noqa: ANN401 - a mesh, which has no public type
    degrees = np.degrees(plane.weights_rad)
    mesh = axes.pcolormesh(
        _edges(plane.forces_n),
        _edges(degrees),
        plane.share,
        cmap=_greys(),
        vmin=0.0,
        vmax=1.0,
        edgecolors="#c4c4c4",
        linewidth=0.2,
    )
    force = np.linspace(0.0, _edges(plane.forces_n)[-1], 100)
    slope = math.sin(sheet.weight_rad) / sheet.force_n
    line = np.degrees(np.arcsin(slope * force))
    for sign in (1.0, -1.0):
        label = f"eq. 21, $\\gamma$ = {sheet.gamma:g}" if sign > 0 else None
        _over_grey(axes, force, sign * line, linestyle="--", colour=EXCITATORY, label=label)
    for value, dashes, colour, text in (
        (plane.bound_n, "-", INHIBITORY, "bound of the DCM, pushed on the torso"),
        (plane.point_mass_n, "-.", INHIBITORY, "the same, pushed at the CoM"),
        (sheet.bounds[0].lasting_force_n, ":", INK, "eq. 22"),
    ):
        _over_grey(axes, [value, value], [-90.0, 90.0], linestyle=dashes, colour=colour, label=text)
    axes.axhline(0.0, color=INK, linewidth=0.5)
    axes.set_xlim(*_ends(plane.forces_n))
    axes.set_ylim(*_ends(degrees))
    return mesh


def _greys() -> Any:  # noqa: ANN401 - a colour map
    """Make a colour map from white to a grey on which lines can be seen."""
    return LinearSegmentedColormap.from_list("survival", ["#ffffff", "#808080"])


def _over_grey(axes: Axes, x: Sequence[float] | Array, y: Sequence[float] | Array, **style: Any) -> None:  # noqa: ANN401
    """Draw a line with a pale rim, so that it is seen on grey and on white."""
    axes.plot(
        x,
        y,
        color=style["colour"],
        linestyle=style["linestyle"],
        label=style["label"],
        linewidth=1.5,
        path_effects=[Stroke(linewidth=2.6, foreground="white", alpha=0.75), Normal()],
    )


def _edges(values: Array) -> Array:
    """Place the edges of cells halfway between ascending values."""
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _ends(values: Array) -> tuple[float, float]:
    edges = _edges(values)
    return float(edges[0]), float(edges[-1])


def _data(sheet: Sheet, planes: Mapping[str, Plane], nao: Body) -> dict[str, object]:
    return {
        "eq_21_weight_rad": sheet.weight_rad,
        "eq_22_force_n": sheet.bounds[0].lasting_force_n,
        "dcm_bound_paper_n": sheet.bounds[0].force_n,
        "lever_m": nao.lever_m,
        "planes": {
            direction: {
                "weights_rad": plane.weights_rad,
                "forces_n": plane.forces_n,
                "share": plane.share,
                "dcm_bound_torso_n": plane.bound_n,
                "dcm_bound_com_n": plane.point_mass_n,
            }
            for direction, plane in planes.items()
        },
    }
