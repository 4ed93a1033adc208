"""The largest push that a walk survives, under several controllers: the table of the README.

`python -m circuitkit.study.push_limits` measures it again.

A force counts as survived if the robot stands in the runs of all seeds, at it and at every smaller one.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit import load_circuit, resolve
from circuitkit.gait.lipm import dcm, largest_push_force
from circuitkit.gait.support import distances_to_edge
from circuitkit.robots import body_number
from circuitkit.robots.spec import Sole
from circuitkit.simulate import CONTROLLERS, Plan, Push, Scenario, load_scenario, make_plan
from circuitkit.simulate.disturbance import Trial, push_start
from circuitkit.simulate.loop import run_loop, run_to_see_who_stands

Array = NDArray[np.float64]

AFTER_PUSH_S = 5.0
_STEP = 4  # the first step of the walk's repeating part in which the left foot carries
_BLOCK = 4  # forces that are tried at once


@dataclass(frozen=True)
class PushKind:
    """Pushes that differ only in force.

    Attributes:
        direction: Such as `inward`.
        duration_s: How long.
    """

    direction: str
    duration_s: float


PUSH_KINDS = tuple(
    PushKind(direction, duration) for direction in ("outward", "inward") for duration in (0.1, 0.2, 0.4)
)


def plan_for_pushes(scenario: Scenario, gait: str, circuit: str | None = None) -> Plan:
    """The scenario with another gait, pushed early and watched for five seconds after the push.

    Raises:
        InputError: A file is wrong or missing.
    """
    push = scenario.pushes[0]
    start = push.start.model_copy(update={"step": _STEP})
    early = push.model_copy(update={"start": start})
    change = {"gait": gait, "pushes": (early,), "duration": scenario.duration}
    plan = make_plan(scenario.model_copy(update=change), circuit)
    begin, _ = push_start(early, plan.walk)
    longest = max(kind.duration_s for kind in PUSH_KINDS)
    change["duration"] = math.ceil(begin + longest + AFTER_PUSH_S)
    return make_plan(scenario.model_copy(update=change), circuit)


def largest_survived(
    plan: Plan,
    controller: str,
    kinds: Sequence[PushKind] = PUSH_KINDS,
    seeds: Sequence[int] = range(20),
    progress: Callable[[str], object] | None = None,
    grid_n: float = 1.0,
) -> dict[PushKind, float]:
    """The largest force of a grid that is survived, with every smaller one, in the runs of all seeds.

    Args:
        plan: The scenario's plan, with one push whose force, duration and direction are replaced.
        controller: Name of the controller.
        kinds: Directions and durations.
        seeds: Of noise and jitter.
        progress: Is told what has been done.
        grid_n: Step of the grid, [N].

    Returns:
        Newtons for each kind; 0 if not even the smallest is survived.
    """
    limit = dict.fromkeys(kinds, 0)
    going = list(kinds)
    while going:
        cases = [(kind, limit[kind] + i + 1) for kind in going for i in range(_BLOCK)]
        trials = [
            Trial(seed, (_push(plan, kind, number * grid_n),)) for kind, number in cases for seed in seeds
        ]
        stood = run_to_see_who_stands(plan.setup(controller, trials)).reshape(len(cases), len(seeds))
        survived = {case: bool(stood[i].all()) for i, case in enumerate(cases)}
        for kind in list(going):
            start = limit[kind]
            for number in range(start + 1, start + _BLOCK + 1):
                if not survived[kind, number]:
                    going.remove(kind)
                    break
                limit[kind] = number
        if progress is not None:
            progress(", ".join(f"{k.direction} {k.duration_s:g} s: {limit[k] * grid_n:g} N" for k in kinds))
    return {kind: number * grid_n for kind, number in limit.items()}


def _push(plan: Plan, kind: PushKind, force_n: float) -> Push:
    change = {"force": force_n, "duration": kind.duration_s, "direction": kind.direction}
    return plan.scenario.pushes[0].model_copy(update=change)


def dcm_bounds(
    plan: Plan, kinds: Sequence[PushKind] = PUSH_KINDS, *, at_com_height: bool = False
) -> dict[PushKind, float]:
    """What no ankle controller can exceed: the DCM must stay where the feet reach while the push lasts.

    The DCM at the start of the push comes from an undisturbed run. Outward it may not pass the outer edge of
    the foot that carries; inward, since the other foot catches the body, that of the other foot. The torso is
    taken as upright, and the push as acting where the scenario's does.

    Args:
        plan: The scenario's plan; its first push says when, and on which body at which height.
        kinds: Directions and durations.
        at_com_height: For pushes at the height of the CoM instead: those of a point mass.

    Returns:
        Newtons for each kind.
    """
    start = _start_of_push(plan)
    push_height = None if at_com_height else start.push_height_m
    feet = plan.robot.spec.feet
    outer = {
        "outward": plan.robot.spec.legs.hip_offset_y + feet.left.sole.left,
        "inward": -plan.robot.spec.legs.hip_offset_y + feet.right.sole.right,
    }
    mass, height = plan.robot.mass_kg, start.com_height_m
    xi = float(start.dcm_m[1] - start.middle_m[1])
    return {
        kind: largest_push_force(abs(outer[kind.direction] - xi), kind.duration_s, mass, height, push_height)
        for kind in kinds
    }


@dataclass(frozen=True)
class _PushStart:
    """An undisturbed robot when a push would start; positions forward and left, in the world.

    Attributes:
        dcm_m: DCM; shape (2,).
        middle_m: Middle between the ankles; shape (2,).
        corners_m: Corners of both soles; shape (8, 2).
        com_height_m: Height of the CoM.
        push_height_m: Height at which the scenario's first push acts.
    """

    dcm_m: Array
    middle_m: Array
    corners_m: Array
    com_height_m: float
    push_height_m: float


def _start_of_push(plan: Plan) -> _PushStart:
    recording = run_loop(plan.setup("open_loop", [Trial(plan.scenario.seed, ())]))
    push, layout, feet = plan.scenario.pushes[0], plan.robot.layout, plan.robot.spec.feet
    begin, _ = push_start(push, plan.walk)
    tick = round(begin / plan.walk.gait.control_step)
    now = recording.readings[tick, 0]
    height = float(now[layout.com][2])
    ankles = np.stack([now[layout.foot(side)][:2] for side in range(2)])
    return _PushStart(
        dcm_m=dcm(now[layout.com][:2], now[layout.com_velocity][:2], height),
        middle_m=ankles.mean(axis=0),
        corners_m=np.concatenate([_corners_m(foot.sole) for foot in (feet.left, feet.right)])
        + ankles.repeat(4, 0),
        com_height_m=height,
        push_height_m=_height_of(plan, push.body, recording.qpos[tick, 0]) + push.height,
    )


def _corners_m(sole: Sole) -> Array:
    """Corners of a sole from its ankle; shape (4, 2)."""
    return np.array([(x, y) for x in (sole.back, sole.front) for y in (sole.right, sole.left)])


def _height_of(plan: Plan, body: str, qpos: Array) -> float:
    """Height of a body's centre of mass above the floor, [m]."""
    model = plan.robot.model
    data = mujoco.MjData(model)
    data.qpos = qpos
    mujoco.mj_kinematics(model, data)
    return float(data.xipos[body_number(plan.robot, body)][2])


@dataclass(frozen=True)
class BoundsAround:
    """What no ankle controller can exceed, for pushes from around; [N], one for each direction.

    Attributes:
        point_mass_n: Of a point mass that is pushed at its height; shape (n,).
        upright_n: Of a body whose torso does not turn, pushed at the height of the pushed body; shape (n,).
    """

    point_mass_n: Array
    upright_n: Array


def dcm_bounds_around(plan: Plan, angles_rad: Array, duration_s: float) -> BoundsAround:
    """The bound of the DCM for pushes from any direction.

    In the plane, the DCM of a point mass under a constant force F u obeys
    xi' = omega (xi - p + F u/(m omega^2)), where the ZMP p may be anywhere in the support polygon P. With
    E = exp(omega d), at the end of the push

        xi(d) = E xi_0 + (E - 1) (F u/(m omega^2) - q),

    where q is a mean of p, and so anywhere in P. The push can be held if xi(d) can be in P. Since P is
    convex, xi(d)/(E - 1) + q is anywhere in P E/(E - 1), so F u/(m omega^2) must lie in (P - xi_0) E/(E - 1),
    or

        F = m omega^2 L / (1 - exp(-omega d))

    as along a line, L being the way from xi_0 along u to the edge of P. P is the hull of both feet: in front,
    behind and outward its edges are those of the foot that carries, inward the other foot catches the body.

    A push at the height h_p instead of the CoM's h brings a moment F (h_p - h). A torso that does not turn
    hands it to the feet (`largest_push_force`), so what can be held is smaller by h/h_p. Whoever
    turns the torso may hold more than that.

    Args:
        plan: The scenario's plan; its first push says when, and on which body at which height.
        angles_rad: Directions; 0 is forward, a quarter turn is to the left; shape (n,).
        duration_s: d.
    """
    start = _start_of_push(plan)
    lengths = distances_to_edge(start.dcm_m, angles_rad, start.corners_m)
    mass, height = plan.robot.mass_kg, start.com_height_m
    return BoundsAround(
        lengths * largest_push_force(1.0, duration_s, mass, height),
        lengths * largest_push_force(1.0, duration_s, mass, height, start.push_height_m),
    )


def mean_ratio(limits: Mapping[PushKind, float], baseline: Mapping[PushKind, float]) -> float:
    """Mean over the kinds of limit over baseline; infinite if the baseline survives nothing somewhere."""
    return sum(limits[k] / baseline[k] if baseline[k] else math.inf for k in limits) / len(limits)


# What is compared: a name for the table, the controller, the circuit and changes to its parameters.
CONTENDERS: Mapping[str, tuple[str, str, Mapping[str, str]]] = {
    "open loop": ("open_loop", "binn_lateral_tuned", {}),
    "BiNN, towards the edge (tuned)": ("circuit", "binn_lateral_tuned", {}),
    "BiNN, the same, away from the edge": ("circuit", "binn_lateral_tuned", {"w": "0.5 deg"}),
    "BiNN as the paper reads (w 1.63°, away)": ("circuit", "binn_lateral", {}),
}


def table(gait: str, seeds: Sequence[int], progress: Callable[[str], object] | None = None) -> str:
    """The Markdown table of one gait."""
    scenario = load_scenario("nao_push")
    plan = plan_for_pushes(scenario, gait)
    head = " | ".join(f"{kind.direction} {kind.duration_s:g} s" for kind in PUSH_KINDS)
    lines = [
        f"| {gait}, largest force survived [N] | {head} | mean ratio |",
        "|---|" + "---|" * (len(PUSH_KINDS) + 1),
    ]
    baseline: Mapping[PushKind, float] | None = None
    for name, (controller, circuit, changes) in CONTENDERS.items():
        contender = replace(plan, circuit=resolve(load_circuit(circuit), changes))
        limits = largest_survived(contender, controller, seeds=seeds, progress=progress)
        baseline = baseline or limits
        lines.append(_line(name, limits, f"{mean_ratio(limits, baseline):.2f}"))
    lines.append(_line("bound for any ankle control (DCM)", dcm_bounds(plan), ""))
    return "\n".join(lines)


def standing(scenario: Scenario, controller: str, direction: str, seeds: Sequence[int]) -> int:
    """In how many runs of the scenario, pushed in this direction, the robot stands at the end."""
    push = scenario.pushes[0].model_copy(update={"direction": direction})
    plan = make_plan(scenario)
    return int(run_to_see_who_stands(plan.setup(controller, [Trial(seed, (push,)) for seed in seeds])).sum())


def _line(name: str, limits: Mapping[PushKind, float], last: str) -> str:
    return f"| {name} | " + " | ".join(f"{limits[kind]:.0f}" for kind in PUSH_KINDS) + f" | {last} |"


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("gaits", nargs="*", default=["gait_march", "gait_walk_2cm"])
    parser.add_argument("--seeds", type=int, default=20, help="seeds 0 to N-1")
    arguments = parser.parse_args()
    scenario = load_scenario("nao_push")
    for direction in ("inward", "outward"):
        counts = {name: standing(scenario, name, direction, range(arguments.seeds)) for name in CONTROLLERS}
        found = ", ".join(f"{name} stands in {count}" for name, count in counts.items())
        print(f"nao_push, {direction}, {arguments.seeds} seeds: {found}", flush=True)  # noqa: T201 - a script
    for gait in arguments.gaits:
        print(table(gait, range(arguments.seeds), lambda text: print(text, file=sys.stderr, flush=True)))  # noqa: T201 - a script
        print(flush=True)  # noqa: T201 - a script


if __name__ == "__main__":
    main()
