"""The robot file: which names of an MJCF are feet, joints and sensors, and how strong the servos are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, field_validator, model_validator

from circuitkit.base.errors import UnknownNameError, listing, suggest
from circuitkit.base.source import FileModel, read_yaml, validate_model
from circuitkit.base.source.fields import Damping, Metres, NewtonMetres, Newtons, Radians, Stiffness
from circuitkit.biped.gait import LEG_JOINTS, LegGeometry

_HERE = Path(__file__).parent
FILE_NAME = "robot.yaml"

Pair = Annotated[
    tuple[Metres, Metres], BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
]


class Sole(FileModel):
    """Extent of a sole from its ankle."""

    back: Metres
    front: Metres
    right: Metres
    left: Metres

    @model_validator(mode="after")
    def _ordered(self) -> Sole:
        for low, high in (("back", "front"), ("right", "left")):
            found = getattr(self, low), getattr(self, high)
            if found[0] >= found[1]:
                numbers = f"found {low} {found[0]:g} and {high} {found[1]:g}"
                message = f"{numbers}; allowed: {low} before {high}"
                raise ValueError(message)
        return self


class Foot(FileModel):
    """One foot."""

    body: str = Field(description="Body of the foot in the MJCF; its frame sits in the ankle.")
    sole: Sole = Field(description="Extent of the sole, for the support polygon.")
    cells: Mapping[str, Pair] = Field(
        min_length=4, max_length=4, description="The four force sensors: forward and left of the ankle."
    )


class Feet(FileModel):
    """Both feet."""

    left: Foot
    right: Foot

    @model_validator(mode="after")
    def _own_cells(self) -> Feet:
        for name in self.left.cells:
            if name in self.right.cells:
                message = f"the cell '{name}' is in both feet; allowed: names of their own"
                raise ValueError(message)
        return self


class Legs(FileModel):
    """Lengths of the legs."""

    thigh: Metres = Field(gt=0)
    tibia: Metres = Field(gt=0)
    ankle_height: Metres = Field(gt=0)
    hip_offset_y: Metres = Field(gt=0)
    hip_offset_z: Metres = Field(ge=0)

    def geometry(self) -> LegGeometry:
        """The same, as the walking pattern wants it."""
        return LegGeometry(self.thigh, self.tibia, self.ankle_height, self.hip_offset_y, self.hip_offset_z)


class ForceCells(FileModel):
    """What the force cells can measure."""

    range: tuple[Newtons, Newtons] = Field(description="Readings are clipped to this.")

    @model_validator(mode="after")
    def _ordered(self) -> ForceCells:
        low, high = self.range
        if low >= high:
            message = f"found a range from {low:g} to {high:g}; allowed: the lower end first"
            raise ValueError(message)
        return self


class Servo(FileModel):
    """A position servo: torque = stiffness (target - angle) - damping * velocity, within +- torque."""

    joints: tuple[str, ...] = Field(
        min_length=1, description="Names of joints, or beginnings or ends with a *."
    )
    stiffness: Stiffness = Field(gt=0)
    damping: Damping = Field(ge=0)
    torque: NewtonMetres = Field(gt=0, description="Largest torque.")


class Command(FileModel):
    """A channel that controllers write: an angle that is added to the walk's joints."""

    description: str = ""
    unit: Literal["deg", "rad"] = "deg"
    joints: Mapping[str, float] = Field(min_length=1, description="Factor for each joint of the legs.")

    @field_validator("joints")
    @classmethod
    def _known(cls, joints: Mapping[str, float]) -> Mapping[str, float]:
        for name in joints:
            if name not in LEG_JOINTS:
                hint = suggest(name, LEG_JOINTS)
                message = (
                    f"unknown joint '{name}'; allowed: {listing(LEG_JOINTS)}{'; ' if hint else ''}{hint}"
                )
                raise ValueError(message)
        return joints


class RobotSpec(FileModel):
    """A robot in MuJoCo."""

    robot: str = Field(description="Name.")
    description: str = ""
    mjcf: str = Field(description="The model file, beside this one.")
    torso: str = Field(description="Body that carries the head and hangs from the free joint.")
    imu: str = Field(description="Site of the inertial measurement unit.")
    feet: Feet
    legs: Legs
    joints: Mapping[str, str] = Field(description="Name in the MJCF of each joint of the legs.")
    posture: Mapping[str, Radians] = Field(
        default={}, description="Angles of other joints, by their MJCF name."
    )
    force_cells: ForceCells
    servo_profile: str = Field(description="The profile in use.")
    servo_profiles: Mapping[str, tuple[Servo, ...]] = Field(min_length=1)
    commands: Mapping[str, Command]

    _folder: Path = PrivateAttr(default=_HERE)

    @model_validator(mode="after")
    def _complete(self) -> RobotSpec:
        if missing := [name for name in LEG_JOINTS if name not in self.joints]:
            message = f"joints: missing {listing(missing)}; required: {listing(LEG_JOINTS)}"
            raise ValueError(message)
        if unknown := [name for name in self.joints if name not in LEG_JOINTS]:
            message = f"joints: unknown '{unknown[0]}'; allowed: {listing(LEG_JOINTS)}"
            raise ValueError(message)
        if self.servo_profile not in self.servo_profiles:
            raise ValueError(str(self._unknown_profile(self.servo_profile)))
        return self

    def with_servos(self, profile: str | None) -> RobotSpec:
        """The same robot with another servo profile; with its own if None.

        Raises:
            UnknownNameError: It has no such profile; lists those it has.
        """
        if profile is None:
            return self
        if profile not in self.servo_profiles:
            raise self._unknown_profile(profile)
        return self.model_copy(update={"servo_profile": profile})

    def _unknown_profile(self, name: str) -> UnknownNameError:
        return UnknownNameError("servo profile", name, self.servo_profiles)

    @property
    def mjcf_path(self) -> Path:
        """Where the model file lies."""
        return self._folder / self.mjcf


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with circuitkit."""
    return tuple(sorted(path.parent.name for path in _HERE.glob(f"*/{FILE_NAME}")))


def load_robot(name_or_path: str | Path) -> RobotSpec:
    """Read a robot file.

    Args:
        name_or_path: A path to a `robot.yaml`, or the name of a shipped robot such as `nao`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    path = Path(name_or_path)
    if not path.suffix and len(path.parts) == 1:
        if path.name not in shipped_robots():
            kind = "robot (a path to a robot.yaml is allowed as well)"
            raise UnknownNameError(kind, path.name, shipped_robots())
        path = _HERE / path.name / FILE_NAME
    spec = validate_model(read_yaml(path), RobotSpec)
    spec._folder = path.parent
    return spec
