"""The gait file: the numbers of a walk."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from circuitkit.base.source import FileModel, find_data_file, read_yaml, validate_model
from circuitkit.base.source.fields import Metres, Radians, Ratio, Seconds

FOLDER = "sims/gaits"


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
    control_step: Seconds = Field(gt=0, description="Time between two sets of joint angles.")
    double_support: Seconds = Field(gt=0, description="Duration of `transfer`.")
    single_support: Seconds = Field(gt=0, description="Duration of `lift` and `extend` together.")
    step_length: Metres = Field(
        ge=0, le=0.08, description="From the footprint to the next one; 0 marches on the spot."
    )
    stand: Seconds = Field(gt=0, description="Time to stand before the first step.")
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
