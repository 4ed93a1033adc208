"""What the `biped` block of a robot file says: which parts of an MJCF are torso, feet and legs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from circuitkit.base.errors import listing, suggest
from circuitkit.base.source import FileModel
from circuitkit.base.source.fields import Metres, Newtons, Radians
from circuitkit.biped.gait import LEG_JOINTS, LegGeometry
from circuitkit.biped.gait.schedule import require_order
from circuitkit.robots.spec import BlockSpec

_OPTIONAL = frozenset({"left_ankle_roll", "right_ankle_roll"})
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")

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
        require_order(self, "back", "front")
        require_order(self, "right", "left")
        return self


class Foot(FileModel):
    """One foot."""

    body: str = Field(description="Body of the foot in the MJCF; its frame is what is called the ankle.")
    sole: Sole | None = Field(
        default=None, description="Extent of the sole, for the support polygon; measured if not given."
    )
    cells: Mapping[str, Pair] = Field(
        default={},
        description="Four force cells: forward and left of the ankle; near the sole's corners if not given.",
    )

    @model_validator(mode="after")
    def _four_cells(self) -> Foot:
        if len(self.cells) not in {0, len(CORNERS)}:
            message = f"cells: found {len(self.cells)}; allowed: {len(CORNERS)}, or none"
            raise ValueError(message)
        return self

    @property
    def extent(self) -> Sole:
        """The sole of a compiled robot, where it is known in any case."""
        if self.sole is None:
            message = f"the sole of '{self.body}' is measured when the robot is compiled"
            raise ValueError(message)
        return self.sole


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
    """Lengths of the legs; what is not given is measured in the MJCF, with straight legs."""

    thigh: Metres = Field(default=0.0, gt=0)
    tibia: Metres = Field(default=0.0, gt=0)
    ankle_height: Metres = Field(default=0.0, ge=0, description="Ankle above the sole.")
    hip_offset_x: Metres = Field(default=0.0, description="Hips ahead of the torso's origin.")
    hip_offset_y: Metres = Field(default=0.0, gt=0, description="Half the distance between the feet.")
    hip_offset_z: Metres = Field(default=0.0, description="Hips below the torso's origin.")

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


class LegJoint(FileModel):
    """A joint of a leg that turns the other way, or is measured from another angle, in the MJCF."""

    joint: str = Field(description="Name in the MJCF.")
    sign: int | None = Field(
        default=None,
        description="-1 if it turns the other way: pitch about -y, roll about -x; read off its axis if not "
        "given.",
    )
    offset: Radians = Field(
        default=0.0, description="Its angle in the MJCF when the leg is straight and the foot level."
    )

    @model_validator(mode="after")
    def _is_a_sign(self) -> LegJoint:
        if self.sign not in {None, 1, -1}:
            message = f"found the sign {self.sign}; allowed: 1 or -1"
            raise ValueError(message)
        return self


class BipedSpec(BlockSpec):
    """What the file says; `robot.BipedBlock` says what becomes of it."""

    torso: str = Field(description="Body that hangs from a free joint and carries everything.")
    imu: str | None = Field(
        default=None, description="Site of the inertial measurement unit; the torso's origin if not given."
    )
    feet: Feet = Field(description="For left and right: body, sole, cells.")
    legs: Legs = Field(
        default=Legs(), description="Lengths of the legs; what is not given is measured in the MJCF."
    )
    joints: Mapping[str, str | LegJoint] = Field(
        description="The MJCF's joint by role; {joint: NAME, sign: -1} where it turns the other way."
    )
    force_cells: ForceCells = Field(
        default=ForceCells(range=(0.0, 1e6)),
        description="The range of the force cells, to which readings are clipped.",
    )

    @model_validator(mode="after")
    def _complete(self) -> BipedSpec:
        needed = [name for name in LEG_JOINTS if name not in _OPTIONAL]
        if missing := [name for name in needed if name not in self.joints]:
            message = f"joints: missing {listing(missing)}; required: {listing(needed)}"
            raise ValueError(message)
        if unknown := [name for name in self.joints if name not in LEG_JOINTS]:
            hint = suggest(unknown[0], LEG_JOINTS)
            message = (
                f"joints: unknown '{unknown[0]}'; allowed: {listing(LEG_JOINTS)}{'; ' if hint else ''}{hint}"
            )
            raise ValueError(message)
        return self

    @property
    def roles(self) -> tuple[str, ...]:
        """The legs' joints that the robot has, in the order of `LEG_JOINTS`."""
        return tuple(role for role in LEG_JOINTS if role in self.joints)

    def joint(self, role: str) -> LegJoint:
        """A joint with its sign."""
        found = self.joints[role]
        return LegJoint(joint=found) if isinstance(found, str) else found

    def cells(self, side: str) -> Mapping[str, tuple[float, float]]:
        """The force cells of a foot; where the file gives none, our own names in places to be measured."""
        given = getattr(self.feet, side).cells
        return given or {f"{side}_cell_{corner}": (0.0, 0.0) for corner in CORNERS}
