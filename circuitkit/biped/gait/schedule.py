"""The gait file, and the time plan that follows from it: when each foot stands where, tick by tick."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from circuitkit.base.source import FileModel, find_data_file, read_yaml, validate_model
from circuitkit.base.source.fields import Metres, Radians, Ratio, Seconds
from circuitkit.simulation.scenario import LONGEST_S

Array = NDArray[np.float64]

FOLDER = "sims/gaits"

# Phases of a walk; transfer, lift and extend are the paper's movements (Fig. 3).
PHASES = ("stand", "transfer", "lift", "extend")
STAND, TRANSFER, LIFT, EXTEND = range(4)
LEFT, RIGHT = 0, 1


def require_order(model: FileModel, low: str, high: str) -> None:
    """Refuse two fields of which the first is not less than the second.

    Raises:
        ValueError: It is not; names both with their values.
    """
    found = getattr(model, low), getattr(model, high)
    if found[0] >= found[1]:
        message = f"found {low} {found[0]:g} and {high} {found[1]:g}; allowed: {low} before {high}"
        raise ValueError(message)


class Window(FileModel):
    """A part of single support."""

    start: Ratio = Field(ge=0, le=1, description="Where it begins, as a part of single support.")
    end: Ratio = Field(ge=0, le=1, description="Where it ends, as a part of single support.")

    @model_validator(mode="after")
    def _ordered(self) -> Window:
        require_order(self, "start", "end")
        return self


class Lift(Window):
    """How the swing foot is lifted: by `height` times sin^2 over the window."""

    height: Metres = Field(ge=0, le=0.08, description="Highest point of the swing foot.")


class ZmpReference(FileModel):
    """Where the ZMP shall be under the support foot, from the ankle's middle line."""

    forward: Metres = Field(description="Ahead of the ankle of the support foot.")
    sideways: Metres = Field(
        gt=0, description="From the middle between the feet, to the support foot's side."
    )


class GaitSpec(FileModel):
    """A walk of the paper's three movements: transfer, lift and extend."""

    gait: str = Field(description="Name.")
    pattern: Literal["three_movements"] = Field(
        description="How the joints are found: eqs. 3-10 of the paper."
    )
    description: str = ""
    control_step: Seconds = Field(ge=1e-6, description="Time between two sets of joint angles.")
    double_support: Seconds = Field(gt=0, le=LONGEST_S, description="Duration of `transfer`.")
    single_support: Seconds = Field(
        gt=0, le=LONGEST_S, description="Duration of `lift` and `extend` together."
    )
    step_length: Metres = Field(
        ge=0, le=0.08, description="From the footprint to the next one; 0 marches on the spot."
    )
    stand: Seconds = Field(gt=0, le=LONGEST_S, description="Time to stand before the first step.")
    knee: Radians = Field(gt=0, lt=2, description="Knee pitch of the standing leg.")
    zmp: ZmpReference
    lift: Lift
    swing: Window = Field(description="When the swing foot moves forward; it must be in the air.")
    com_height: Metres = Field(gt=0, description="z_CoM of the pendulum.")

    @model_validator(mode="after")
    def _whole_ticks(self) -> GaitSpec:
        for name in ("double_support", "single_support", "stand"):
            ticks = getattr(self, name) / self.control_step
            if abs(ticks - round(ticks)) > 1e-6:  # noqa: PLR2004 - far below a tick
                message = f"{name} is {ticks:g} control steps; allowed: a whole number of control steps"
                raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _swing_in_the_air(self) -> GaitSpec:
        if self.swing.start < self.lift.start or self.swing.end > self.lift.end:
            found = (
                f"swing is from {self.swing.start:g} to {self.swing.end:g} of single support, "
                f"the lift from {self.lift.start:g} to {self.lift.end:g}"
            )
            message = f"{found}; allowed: a swing within the lift"
            raise ValueError(message)
        if self.step_length > 0 and self.lift.height == 0:
            message = (
                f"lift.height is 0 and step_length {self.step_length:g} m; "
                "allowed: a lift of more than 0, or a step of 0"
            )
            raise ValueError(message)
        return self

    @property
    def step_ticks(self) -> int:
        """Ticks of one step: double and single support."""
        return round((self.double_support + self.single_support) / self.control_step)

    @property
    def stand_ticks(self) -> int:
        """Ticks before the first step."""
        return round(self.stand / self.control_step)

    def steps_within(self, ticks: int) -> int:
        """Steps that cover a walk of so many ticks from standing; at least one."""
        return max(ticks - self.stand_ticks, 0) // self.step_ticks + 1


def load_gait(name_or_path: str | Path) -> GaitSpec:
    """Read a gait file.

    Args:
        name_or_path: A path, or the name of a shipped one such as `gait_march`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    return validate_model(read_yaml(find_data_file(name_or_path, FOLDER)), GaitSpec)


@dataclass(frozen=True)
class Schedule:
    """The time plan of a walk; T ticks, feet in the order left, right.

    Attributes:
        step: Step number from 0, -1 while standing; shape (T,).
        phase: Index into `PHASES`; shape (T,).
        support: The foot to stand on, `LEFT` or `RIGHT`, or -1 while standing; shape (T,).
        single_support: How far into single support, 0 to 1; shape (T,).
        feet_x_m: Where the feet are, forward; shape (T, 2).
        lift_m: How high they are; shape (T, 2).
        zmp_m: Reference of the ZMP, forward and sideways; shape (T, 2).
        left_load: Part of the weight on the left foot that goes with it; shape (T,).
    """

    step: NDArray[np.int64]
    phase: NDArray[np.int64]
    support: NDArray[np.int64]
    single_support: Array
    feet_x_m: Array
    lift_m: Array
    zmp_m: Array
    left_load: Array

    def rows(self, which: slice) -> Schedule:
        """Some ticks of it."""
        return Schedule(**{each.name: getattr(self, each.name)[which] for each in fields(self)})


def smooth_step(progress: Array) -> Array:
    """10 s^3 - 15 s^4 + 6 s^5: from 0 to 1 with zero velocity and acceleration at both ends; clipped."""
    s = np.clip(progress, 0.0, 1.0)
    smooth: Array = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return smooth


def plan_steps(gait: GaitSpec, steps: int) -> Schedule:
    """The time plan of `steps` steps from standing; the left foot supports the first one.

    Args:
        gait: The walk.
        steps: How many.
    """
    dt = gait.control_step
    stand_ticks = gait.stand_ticks
    tick = np.arange(stand_ticks + steps * gait.step_ticks)
    step = np.where(tick < stand_ticks, -1, (tick - stand_ticks) // gait.step_ticks)
    in_step = (tick - stand_ticks - step * gait.step_ticks) * dt
    walking = step >= 0
    single = np.where(walking, np.clip((in_step - gait.double_support) / gait.single_support, 0.0, 1.0), 0.0)
    support = np.where(walking, step % 2, -1)

    before, after = _footprints(gait.step_length, steps)
    moved = smooth_step((single - gait.swing.start) / (gait.swing.end - gait.swing.start))
    feet_x = before[step] + (after[step] - before[step]) * moved[:, None]
    raised = gait.lift.height * _bump((single - gait.lift.start) / (gait.lift.end - gait.lift.start))
    lift = np.where(support[:, None] == np.array([RIGHT, LEFT]), raised[:, None], 0.0)

    # The ZMP goes linearly from one support point to the next during double support.
    share = np.where(walking, np.clip(in_step / gait.double_support, 0.0, 1.0), 0.0)[:, None]
    point = _support_points(gait, before)
    previous = np.maximum(step, 0)
    zmp = point[previous] * (1.0 - share) + point[step + 1] * share
    left_load = np.clip(0.5 + 0.5 * zmp[:, 1] / gait.zmp.sideways, 0.0, 1.0)
    return Schedule(step, _phases(gait, step, in_step, single), support, single, feet_x, lift, zmp, left_load)


def _bump(progress: Array) -> Array:
    bump: Array = np.sin(np.pi * np.clip(progress, 0.0, 1.0)) ** 2
    return bump


def _phases(gait: GaitSpec, step: NDArray[np.int64], in_step: Array, single: Array) -> NDArray[np.int64]:
    """The movement of each tick: the foot goes up until the middle of the lift window, then down."""
    top = (gait.lift.start + gait.lift.end) / 2
    in_transfer = in_step < gait.double_support - 1e-9
    moving = np.where(single < top, LIFT, EXTEND)
    return np.where(step < 0, STAND, np.where(in_transfer, TRANSFER, moving))


def _footprints(step_length_m: float, steps: int) -> tuple[Array, Array]:
    """Forward positions of the feet before and after each step; the last row is for standing at first."""
    number = np.arange(steps)
    swing = 1 - number % 2
    before = np.zeros((steps + 1, 2))
    after = np.zeros((steps + 1, 2))
    for k, foot in zip(number, swing, strict=True):
        after[k] = before[k]
        after[k, foot] = before[k, 1 - foot] + step_length_m
        if k + 1 < steps:
            before[k + 1] = after[k]
    return before, after


def _support_points(gait: GaitSpec, before: Array) -> Array:
    """ZMP reference of standing (row 0) and of the single support of step k (row k + 1); (steps + 1, 2)."""
    steps = len(before) - 1
    foot = np.arange(steps) % 2
    points = np.zeros((steps + 1, 2))
    points[:, 0] = gait.zmp.forward
    points[1:, 0] += before[np.arange(steps), foot]
    points[1:, 1] = np.where(foot == LEFT, gait.zmp.sideways, -gait.zmp.sideways)
    return points
