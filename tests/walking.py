"""What the tests of bipeds and of their walks share: a NAO, short plans, runs without chance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import mujoco
import numpy as np

from circuitkit.biped.control.reference import WalkReference
from circuitkit.biped.dynamics import generalised_positions
from circuitkit.biped.gait import LEG_JOINTS, GaitSpec, Walk, load_gait
from circuitkit.biped.references import GaitReference
from circuitkit.biped.robot import BipedBody, biped_of
from circuitkit.biped.sensing import BipedView
from circuitkit.control import Interface
from circuitkit.robots import RobotModel, Worlds, build_model, load_robot
from circuitkit.simulation import (
    Disturbance,
    Motion,
    Plan,
    Recording,
    RunSpec,
    Scenario,
    load_scenario,
    make_plan,
)
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.loop import run_loop

GAITS = ("gait_march", "gait_walk_2cm", "gait_walk_4cm")


def nao_joint(role: str) -> str:
    """The NAO's own name of a joint of the legs: left_hip_roll is LHipRoll."""
    return "".join(part.capitalize() for part in role.split("_")).replace("Left", "L").replace("Right", "R")


NAO_LEG_JOINTS = tuple(nao_joint(role) for role in LEG_JOINTS)


@cache
def nao() -> RobotModel:
    """The shipped NAO."""
    return build_model(load_robot("nao"))


def nao_body() -> BipedBody:
    """The shipped NAO as a biped."""
    return biped_of(nao())


@cache
def bare_nao() -> mujoco.MjModel:
    """The MJCF alone: no servos, no sensors."""
    return mujoco.MjModel.from_xml_path(str(load_robot("nao").mjcf_path))


def scenario(
    gait: str = "gait_march", disturbances: Iterable[Disturbance] = (), **changes: Any
) -> Scenario:  # fmt: skip
    """`nao_push` with other disturbances, or none, and three seconds of another gait; and other changes."""
    calm = {"duration": 3.0, "reference": GaitReference(load_gait(gait))}
    return load_scenario("nao_push").with_disturbances(tuple(disturbances)).model_copy(update=calm | changes)


def a_push(**changes: Any) -> Push:
    """20 N to the inside for 0.2 s in the lift of step 0, but for the changes."""
    start = {
        "step": changes.pop("step", 0),
        "phase": changes.pop("phase", "lift"),
        "at": changes.pop("at", 0.4),
    }
    whole = {"body": "torso", "force": 20.0, "direction": "inward", "duration": 0.2, "start": start}
    return Push(**whole | changes)


def fault(cell: str = "LFsrFL", reading: str = "missing", start: float = 1.0, duration: float = 0.2) -> Fault:
    """A force cell that fails."""
    return Fault(channel=cell, reading=reading, start=start, duration=duration)


def plan_of(circuit: str | None = None, **changes: Any) -> Plan:
    """The plan of `scenario(**changes)`."""
    return make_plan(scenario(**changes), circuit)


def known_of(plan: Plan) -> WalkReference:
    """What a controller may know of the walk of a plan."""
    known: WalkReference = plan.body.motion.knowledge
    return known


def interface_of(known: WalkReference) -> Interface:
    """What a controller gets to know of a NAO on a walk."""
    return Interface(nao().channel_units, nao().command_units, known.step_s, known.planned_channels(), known)


def walk_of_nao(gait: GaitSpec, ticks: int) -> tuple[Walk, Motion]:
    """A walk that is right for the NAO, and what its servos are to do."""
    motion = GaitReference(gait).motion(nao(), ticks, gait.control_step)
    return motion.knowledge.walk, motion


def joint_targets(walk: Walk) -> np.ndarray:
    """Angles of all joints of the NAO with servos along a walk; shape (T, n), [rad]."""
    return generalised_positions(nao_body(), walk)[:, nao_body().qpos_index]


def naos(
    motion: Motion,
    commands: Sequence[str] = (),
    batch: int = 1,
    threads: int | None = None,
    robot: RobotModel | None = None,
) -> Worlds:
    """NAOs at the start of a walk, in control steps of 10 ms."""
    made = Worlds(robot or nao(), 0.01, motion.targets, motion.start_qpos, commands, batch, threads)
    made.begin()
    return made


def walk_all(plan: Plan, controller: Any, specs: Sequence[RunSpec]) -> Recording:
    """Robots of one batch."""
    return run_loop(plan.setup(plan.controller(controller), specs))


def walk_alone(plan: Plan, controller: Any = "circuit", seed: int = 0) -> Recording:
    """One robot with the scenario's disturbances."""
    return walk_all(plan, controller, [plan.own_spec(seed)])


def view_of(recording: Recording) -> BipedView:
    """The recording of a biped as one."""
    return BipedView(recording)


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
