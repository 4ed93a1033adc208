"""The references of a biped: a gait, and standing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import Document, FileModel, validate_model
from circuitkit.base.source.fields import Metres, Radians, Ratio, Seconds
from circuitkit.biped.control.reference import Body, WalkReference, stand_reference, walk_reference
from circuitkit.biped.dynamics import BodyDynamics, as_walked, generalised_positions, legs_of, servo_targets
from circuitkit.biped.gait import LEFT, PHASES, SIDES, GaitSpec, Walk, load_gait, plan_walk
from circuitkit.biped.gait.pattern import plan_stand
from circuitkit.biped.gait.schedule import FOLDER, Lift, Schedule, Window, ZmpReference, plan_steps
from circuitkit.biped.robot import BipedBody, biped_of
from circuitkit.control import Array
from circuitkit.robots import RobotModel
from circuitkit.simulation.reference import Moment, Motion, NumbersFile, Reference
from circuitkit.simulation.scenario import beside as file_beside


class GaitMoment(FileModel):
    """A moment of a gait."""

    step: int = Field(ge=0, description="Number of the step, from 0; the left foot carries the even ones.")
    phase: Literal["transfer", "lift", "extend"] = Field(description="Movement of that step.")
    at: Ratio = Field(ge=0, le=1, description="How far into the movement.")


class GaitReference(Reference):
    """Walks by a gait file; brings `planned_com_*`, moments of steps, and the ways inward and outward."""

    kind: ClassVar[str] = "gait"
    settings = str
    file = NumbersFile(FOLDER, GaitSpec)

    def __init__(self, gait: GaitSpec) -> None:
        """Take the numbers of a walk."""
        self.gait = gait
        self.name = gait.gait
        self.step_s = gait.control_step

    @classmethod
    def read(cls, value: str, beside: Document) -> GaitReference:
        """Read a gait file."""
        return cls(load_gait(file_beside(value, beside)))

    def moment(self, where: Mapping[str, Any], duration_s: float) -> Moment:
        """When a movement of a step is so far, and which way is inward then.

        Raises:
            InputError: The walk is over before, or the words are others.
        """
        start = _moment(where)
        gait = self.gait
        ticks = round(duration_s / gait.control_step)
        schedule = _schedule(gait, ticks)
        phase = PHASES.index(start.phase)
        first_step = plan_steps(gait, 1)
        moment = start.at * np.count_nonzero(first_step.phase == phase)
        found = np.flatnonzero((schedule.step == start.step) & (schedule.phase == phase))
        if len(found) == 0 or moment > len(found):
            whole = (ticks - np.count_nonzero(first_step.step < 0)) // gait.step_ticks
            steps = f"steps 0 to {whole - 1}, or " if whole > 0 else ""
            message = (
                f"found step {start.step}, and the walk ends before that '{start.phase}'; allowed: {steps}a "
                "longer duration"
            )
            raise InputError(Problem("", 0, 0, "start", message))
        return Moment(
            float(found[0] + moment) * gait.control_step, _directions(int(schedule.support[found[0]]))
        )

    def at(self, time_s: float) -> Moment:
        """The moment at a time, and which way is inward then."""
        tick = round(time_s / self.gait.control_step)
        support = int(_schedule(self.gait, tick + 1).support[tick])
        return Moment(time_s, _directions(support) if support >= 0 else {})

    def require(self, robot: RobotModel) -> None:
        """Refuse a robot that is no biped.

        Raises:
            InputError: It is none.
        """
        biped_of(robot)

    def motion(self, robot: RobotModel, ticks: int, step_s: float) -> Motion:
        """A walk that is right for this robot's whole body, and what to send to its servos.

        Raises:
            InputError: The robot is no biped, or the control steps differ.
            SimulationError: A leg cannot reach its foot.
        """
        if step_s != self.gait.control_step:
            found = f"found a control step of {step_s * 1e3:g} ms"
            message = f"{found}; allowed: that of the gait, {self.gait.control_step * 1e3:g} ms"
            raise InputError(Problem("", 0, 0, "control_step", message))
        body = biped_of(robot)
        dynamics = BodyDynamics(body)
        walk, torques_and_targets = plan_walk(
            self.gait,
            body.block.legs.geometry(),
            ticks,
            dynamics.zmp,
            lambda walk: _torques_and_targets(dynamics, body, walk),
        )
        return _motion(robot, body, walk, torques_and_targets, walk_reference)


class StandSpec(FileModel):
    """How a biped stands."""

    knee: Radians = Field(default=float(np.radians(33.0)), gt=0, lt=2, description="Knee pitch.")
    forward: Metres = Field(default=0.0, description="The ZMP ahead of the ankles.")
    com_height: Metres = Field(default=0.27, gt=0, description="z_CoM of the pendulum, for controllers.")
    control_step: Seconds = Field(default=0.01, gt=0, description="Time between two commands.")


class StandReference(Reference):
    """Stands on both feet, the whole body's ZMP between them; brings `planned_com_*`."""

    kind: ClassVar[str] = "stand"
    settings = StandSpec
    name = "stand"

    def __init__(self, spec: StandSpec | None = None) -> None:
        """Take the numbers."""
        self.spec = StandSpec() if spec is None else spec
        self.step_s = self.spec.control_step

    @classmethod
    def read(cls, value: StandSpec, beside: Document) -> StandReference:  # noqa: ARG003 - names no file
        """Take the numbers."""
        return cls(value)

    def require(self, robot: RobotModel) -> None:
        """Refuse a robot that is no biped.

        Raises:
            InputError: It is none.
        """
        biped_of(robot)

    def motion(self, robot: RobotModel, ticks: int, step_s: float) -> Motion:  # noqa: ARG002 - has its own
        """The posture that stands.

        Raises:
            InputError: The robot is no biped.
            SimulationError: A leg cannot reach its foot.
        """
        spec, body = self.spec, biped_of(robot)
        gait = GaitSpec(
            gait="stand", pattern="three_movements", control_step=spec.control_step,
            double_support=5 * spec.control_step, single_support=50 * spec.control_step, step_length=0.0,
            stand=ticks * spec.control_step, knee=spec.knee, com_height=spec.com_height,
            zmp=ZmpReference(forward=spec.forward, sideways=body.block.legs.hip_offset_y),
            lift=Lift(start=0.0, end=1.0, height=0.0), swing=Window(start=0.2, end=0.8),
        )  # fmt: skip
        dynamics = BodyDynamics(body)
        walk, found = plan_stand(
            gait,
            body.block.legs.geometry(),
            dynamics.zmp,
            lambda walk: _torques_and_targets(dynamics, body, walk),
        )
        return _motion(robot, body, walk, found, stand_reference)


def _torques_and_targets(dynamics: BodyDynamics, body: BipedBody, walk: Walk) -> Array:
    """Torque and angle of every servo along a walk, side by side; shape (T, 2 n)."""
    positions = generalised_positions(body, walk)
    legs_of(body).check_stops(positions, walk)
    return np.hstack([dynamics.torques(walk), positions[:, body.qpos_index]])


def _motion(
    robot: RobotModel, body: BipedBody, planned: Walk, torques_and_targets: Array,
    known_of: Callable[[Walk, Body], WalkReference],
) -> Motion:  # fmt: skip
    """What a walk asks of the robot, and what controllers may know of it."""
    torques, targets = np.hsplit(torques_and_targets, 2)
    walk = as_walked(body, planned, targets)
    knowledge = known_of(walk, _known_body(robot, body))
    return Motion(
        targets=servo_targets(body, targets, torques),
        start_qpos=generalised_positions(body, planned.rows(slice(0, 1)))[0],
        start=replace(robot.start, qvel=np.zeros(robot.model.nv)),
        planned=knowledge.planned_channels(),
        columns={"step": walk.schedule.step, "phase": walk.schedule.phase},
        knowledge=knowledge,
        pace_s=walk.gait.step_ticks * walk.gait.control_step,
    )


def _known_body(robot: RobotModel, biped: BipedBody) -> Body:
    """What a controller may know of the robot."""
    block, roles = biped.block, biped.block.roles
    soles = [getattr(block.feet, side).sole for side in SIDES]
    extent = [[[sole.back, sole.front], [sole.right, sole.left]] for sole in soles]
    ankle = [
        role if (role := f"left_ankle_{name}") in roles else "left_ankle_pitch" for name in ("pitch", "roll")
    ]
    servo = biped.leg_servo[[roles.index(role) for role in ankle]]
    stiffness = biped.stiffness[servo]
    damping = -robot.model.actuator_biasprm[biped.servos[servo], 2] * biped.gear[servo] ** 2
    return Body(
        biped.mass_kg, block.legs.geometry(), np.array(extent), stiffness, damping / stiffness,
        robot.channel_units, robot.command_units,
    )  # fmt: skip


def _moment(where: Mapping[str, Any]) -> GaitMoment:
    try:
        return validate_model(Document("", dict(where), {}), GaitMoment)
    except InputError as error:
        problems = (
            Problem("", 0, 0, f"start.{p.where}".rstrip("."), p.message, p.hint) for p in error.problems
        )
        raise InputError(*problems) from error


@lru_cache(maxsize=32)
def _schedule(gait: GaitSpec, ticks: int) -> Schedule:
    """The time plan of a walk of so many ticks; made once for all pushes."""
    return plan_steps(gait, gait.steps_within(ticks)).rows(slice(ticks))


def _directions(support: int) -> dict[str, Array]:
    """Inward is towards the foot in the air, outward away from it."""
    outward = 1.0 if support == LEFT else -1.0
    return {"outward": np.array([0.0, outward, 0.0]), "inward": np.array([0.0, -outward, 0.0])}
