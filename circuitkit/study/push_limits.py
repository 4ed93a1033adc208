"""The largest push that a walk survives, under several controllers: the table of the README.

A force counts as survived if the robot stands in the runs of all seeds, at it and at every smaller one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from circuitkit.gait.lipm import dcm, largest_push_force
from circuitkit.simulate import Plan, Push, Scenario, make_plan
from circuitkit.simulate.disturbance import Trial, push_start
from circuitkit.simulate.loop import run_loop, run_to_see_who_stands

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


def dcm_bounds(plan: Plan, kinds: Sequence[PushKind] = PUSH_KINDS) -> dict[PushKind, float]:
    """What no ankle controller can exceed: the DCM must stay where the feet reach while the push lasts.

    The DCM at the start of the push comes from an undisturbed run. Outward it may not pass the outer edge of
    the foot that carries; inward, since the other foot catches the body, that of the other foot.

    Returns:
        Newtons for each kind.
    """
    calm = [Trial(plan.scenario.seed, ())]
    recording = run_loop(plan.setup("open_loop", calm))
    begin, _ = push_start(plan.scenario.pushes[0], plan.walk)
    tick = round(begin / plan.walk.gait.control_step)
    height = float(recording.com_m[tick, 0, 2])
    xi = float(dcm(recording.com_m[tick, 0, 1], recording.com_velocity[tick, 0, 1], height))
    feet = plan.robot.spec.feet
    outer = {
        "outward": plan.robot.spec.legs.hip_offset_y + feet.left.sole.left,
        "inward": -plan.robot.spec.legs.hip_offset_y + feet.right.sole.right,
    }
    return {
        kind: largest_push_force(abs(outer[kind.direction] - xi), kind.duration_s, plan.robot.mass_kg, height)
        for kind in kinds
    }


def ratios(limits: dict[PushKind, float], baseline: dict[PushKind, float]) -> dict[PushKind, float]:
    """Limit over the baseline's; infinite where the baseline survives nothing."""
    return {kind: limits[kind] / baseline[kind] if baseline[kind] else math.inf for kind in limits}
