"""What the tests of walks, robots and simulations share: a NAO, short plans, runs without chance."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import mujoco
import numpy as np

from circuitkit.biped.gait import LEG_JOINTS
from circuitkit.robots import RobotModel, build_model, load_robot
from circuitkit.simulation import Plan, Push, Recording, load_scenario, make_plan
from circuitkit.simulation.disturbance import Trial
from circuitkit.simulation.loop import run_loop
from circuitkit.simulation.scenario import Fault, Jitter, Scenario, SensorNoise

GAITS = ("gait_march", "gait_walk_2cm", "gait_walk_4cm")


def nao_joint(role: str) -> str:
    """The NAO's own name of a joint of the legs: left_hip_roll is LHipRoll."""
    return "".join(part.capitalize() for part in role.split("_")).replace("Left", "L").replace("Right", "R")


NAO_LEG_JOINTS = tuple(nao_joint(role) for role in LEG_JOINTS)


@cache
def nao() -> RobotModel:
    """The shipped NAO."""
    return build_model(load_robot("nao"))


@cache
def bare_nao() -> mujoco.MjModel:
    """The MJCF alone: no floor, no servos, no sensors."""
    return mujoco.MjModel.from_xml_path(str(load_robot("nao").mjcf_path))


def scenario(**changes: Any) -> Scenario:
    """`nao_push` without pushes, noise and jitter, three seconds long, but for the changes."""
    calm = {
        "duration": 3.0,
        "pushes": (),
        "faults": (),
        "sensor_noise": SensorNoise(),
        "jitter": Jitter(),
        "gait": "gait_march",
    }
    return load_scenario("nao_push").model_copy(update=calm | changes)


def a_push(**changes: Any) -> Push:
    """20 N to the inside for 0.2 s in the lift of step 0, but for the changes."""
    push = load_scenario("nao_push").pushes[0]
    start = push.start.model_copy(update={"step": changes.pop("step", 0), "at": changes.pop("at", 0.4)})
    return push.model_copy(update={"force": 20.0, "direction": "inward", "start": start} | changes)


def fault(cell: str = "LFsrFL", reading: str = "missing", start: float = 1.0, duration: float = 0.2) -> Fault:
    """A force cell that fails."""
    times = {"start": f"{start} s", "duration": f"{duration} s"}
    return Fault.model_validate({"cell": cell, "reading": reading, **times})


def walk_alone(plan: Plan, controller: str = "circuit", seed: int = 0) -> Recording:
    """One robot with the scenario's pushes."""
    return run_loop(plan.setup(controller, [Trial(seed, plan.scenario.pushes)]))


def plan_of(circuit: str | None = None, **changes: Any) -> Plan:
    """The plan of `scenario(**changes)`."""
    return make_plan(scenario(**changes), circuit)


ARRAYS = ("readings", "qpos", "observations", "commands", "trace")


def assert_same_bits(recording: Recording, other: Recording, robots: Sequence[int] = (0,)) -> None:
    """The other recording's robots 0, 1, ... are the chosen robots of the first, to the last bit."""
    for name in ARRAYS:
        chosen = getattr(recording, name)[:, list(robots)]
        found = getattr(other, name)
        ticks = min(len(chosen), len(found))
        np.testing.assert_array_equal(
            chosen[:ticks].view(np.int64), found[:ticks].view(np.int64), err_msg=name
        )
