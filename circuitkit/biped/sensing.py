"""What a biped's sensors say: places in `sensordata`, channels of force cells and CoM, the centre of pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import parse_unit
from circuitkit.circuit.expressions.expression import Binary, Name, Number, Unary
from circuitkit.robots.channels import Channel, Formula, Quotient

Array = NDArray[np.float64]

_CELLS_PER_FOOT = 4
_LEAST_LOAD_N = 1.0  # below this a foot counts as unloaded, and its ZMP as in the middle


@dataclass(frozen=True)
class SensorLayout:
    """Order of a biped's part of `sensordata`: cells, wrench of each foot (force, torque, point), CoM, CoM velocity,
    gyro, accelerometer, up axis and position of the torso, position of each foot, angles of the legs' joints.

    Attributes:
        cells: Names of the eight force cells, left foot first.
        legs: The legs' joints by role.
        start: Column of the first cell.
        total: Columns of `sensordata` in all.
    """  # noqa: D205 - the summary is a list

    cells: tuple[str, ...]
    legs: tuple[str, ...]
    start: int = 0
    total: int = 0

    @property
    def forces(self) -> slice:
        """The force cells, [N]."""
        return slice(self.start, self.start + len(self.cells))

    def wrench(self, side: int) -> slice:
        """Force on the foot, torque and point of attack, world frame; `side` 0 is left."""
        return self._after(9 * side, 9)

    @property
    def com(self) -> slice:
        """Centre of mass, [m]."""
        return self._after(18, 3)

    @property
    def com_velocity(self) -> slice:
        """Its velocity, [m/s]."""
        return self._after(21, 3)

    @property
    def gyro(self) -> slice:
        """Angular velocity of the torso in its own frame, [rad/s]."""
        return self._after(24, 3)

    @property
    def accelerometer(self) -> slice:
        """Acceleration of the torso without gravity taken off, in its own frame, [m/s^2]."""
        return self._after(27, 3)

    @property
    def torso_up(self) -> slice:
        """The torso's z axis, world frame."""
        return self._after(30, 3)

    @property
    def torso(self) -> slice:
        """Position of the torso, [m]."""
        return self._after(33, 3)

    def foot(self, side: int) -> slice:
        """Position of the ankle; `side` 0 is left."""
        return self._after(36 + 3 * side, 3)

    @property
    def leg_joints(self) -> slice:
        """Angles of the legs' joints in the MJCF's own sense, [rad]."""
        return self._after(42, len(self.legs))

    @property
    def width(self) -> int:
        """How many numbers a robot's sensors give."""
        return len(self.cells) + 42 + len(self.legs)

    def _after(self, start: int, count: int) -> slice:
        begin = self.start + len(self.cells) + start
        return slice(begin, begin + count)


def channels(
    layout: SensorLayout,
    cells_xy_m: Array,
    hip_offset_y_m: float,
    zeros: Sequence[tuple[float, float]],
    cell_range: tuple[float, float],
) -> dict[str, Channel]:
    """All channels of a robot with two feet of four force cells.

    The ZMP is from the middle between the feet as if they stood side by side at the hips' distance, since the
    cells do not know where the feet are; the CoM is from the middle between the feet where they are.

    Args:
        layout: Where the sensors stand.
        cells_xy_m: Position of each cell from its ankle; shape (8, 2).
        hip_offset_y_m: Half the distance between the feet.
        zeros: For each of the legs' joints 1, or -1 where it turns the other way in the MJCF; and the MJCF's
            angle where ours is 0, [rad].
        cell_range: What a cell can show, [N].
    """
    width, force = layout.total, layout.forces
    side = np.repeat([1.0, -1.0], _CELLS_PER_FOOT)
    total, none = np.zeros(width), np.zeros(width)
    total[force] = 1.0

    def cells(weights: Array) -> Array:
        row = np.zeros(width)
        row[force] = weights
        return row

    def one(place: slice, axis: int, weight: float = 1.0) -> Array:
        row = np.zeros(width)
        row[place.start + axis] = weight
        return row

    found: dict[str, Channel] = {}

    def add(name: str, unit: str, above: Array, below: Array, description: str) -> None:
        value = Quotient(above, below, _LEAST_LOAD_N)
        found[name] = Channel(name, parse_unit(unit), value, description)

    zmp_y = cells(cells_xy_m[:, 1] + side * hip_offset_y_m)
    add("zmp_x", "m", cells(cells_xy_m[:, 0]), total, "ZMP by the force cells, forward of the ankles")
    add("zmp_y", "m", zmp_y, total, "ZMP by the force cells, left of the middle between the feet")
    add("force_difference", "1", cells(side), total, "(left - right) / (left + right) of the cells")
    add("load", "N", total, none, "sum of all force cells")
    for axis, letter in enumerate("xyz"):
        add(f"gyro_{letter}", "rad/s", one(layout.gyro, axis), none, "rate of the torso")
        add(f"acceleration_{letter}", "m/s^2", one(layout.accelerometer, axis), none, "IMU")
        add(f"com_velocity_{letter}", "m/s", one(layout.com_velocity, axis), none, "of the CoM")
    for axis, letter in enumerate("xy"):
        add(f"tilt_{letter}", "1", one(layout.torso_up, axis), none, "torso's lean: component of its up axis")
    add("upright", "1", one(layout.torso_up, 2), none, "vertical component of the torso's up axis")
    left, right = layout.foot(0), layout.foot(1)
    for axis, (letter, way) in enumerate({"x": "forward of", "y": "left of", "z": "above"}.items()):
        com, apart = one(layout.com, axis), one(left, axis) - one(right, axis)
        if letter != "z":
            com -= (one(left, axis) + one(right, axis)) / 2
        origin = "floor" if letter == "z" else "middle between the ankles, where they are"
        add(f"com_{letter}", "m", com, none, f"CoM {way} the {origin}")
        add(f"feet_{letter}", "m", apart, none, f"left ankle {way} the right one")
    for number, (joint, (sign, offset)) in enumerate(zip(layout.legs, zeros, strict=True)):
        description = f"angle of the {joint.replace('_', ' ')}"
        if offset == 0:
            add(joint, "rad", one(layout.leg_joints, number, sign), none, description)
        else:
            angle = _from_zero(joint, layout.leg_joints.start + number, sign, offset)
            found[joint] = Channel(joint, parse_unit("rad"), angle, description)
    for number, foot in enumerate(("left", "right")):
        add(f"load_{foot}", "N", one(layout.wrench(number), 2), none, f"weight on the {foot} foot, by its contacts")
    for number, name in enumerate(layout.cells):
        bare = Quotient(one(layout.forces, number), none)
        found[name] = Channel(name, parse_unit("N"), bare, "force cell", cell_range)
    return found


def _from_zero(joint: str, column: int, sign: float, offset: float) -> Formula:
    """sign (angle - offset)."""
    difference = Binary("-", Name(joint), Number(offset))
    return Formula(difference if sign > 0 else Unary("-", difference), {joint: column})


def centre_of_pressure(readings: Array, layout: SensorLayout, side: int) -> tuple[Array, Array]:
    """True centre of pressure of a foot on the ground, and the load it carries.

    From the contact wrench (F, M at p): x = p_x - M_y / F_z, y = p_y + M_x / F_z.

    Args:
        readings: Sensor readings; shape (..., s).
        layout: Where the sensors stand.
        side: 0 left, 1 right.

    Returns:
        Position in the world, shape (..., 2), [m], not a number without load; and the load, shape (...), [N].
    """
    wrench = readings[..., layout.wrench(side)]
    load = wrench[..., 2]
    carried = np.where(load > _LEAST_LOAD_N / 10, load, np.nan)
    point = wrench[..., 6:8] + np.stack([-wrench[..., 4], wrench[..., 3]], axis=-1) / carried[..., None]
    return point, load


def total_centre_of_pressure(readings: Array, layout: SensorLayout) -> Array:
    """True centre of pressure of both feet together, which is the ZMP; shape (..., 2), [m], world frame."""
    points, loads = zip(*(centre_of_pressure(readings, layout, side) for side in range(2)), strict=True)
    weights = np.stack([np.where(np.isfinite(p[..., 0]), w, 0.0) for p, w in zip(points, loads, strict=True)])
    moments = np.nan_to_num(np.stack(points)) * weights[..., None]
    total = weights.sum(axis=0)
    sum_of_moments: Array = moments.sum(axis=0) / np.where(total > 0, total, np.nan)[..., None]
    return sum_of_moments
