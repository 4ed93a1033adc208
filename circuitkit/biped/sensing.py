"""What a biped's sensors say: their places in `sensordata`, channels, and what follows from a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.anatomy import BipedSpec
from circuitkit.biped.gait.lipm import GRAVITY_M_S2, zmp_from_com
from circuitkit.circuit.expressions.expression import Binary, Name, Number, Unary
from circuitkit.robots.channels import Channel, Formula, Quotient
from circuitkit.simulation.recording import Recording

Array = NDArray[np.float64]

SETTLED_S = 2.0  # until then a walk that begins from standing is not on its limit cycle
_ALONE = 0.95  # a foot that carries more than this part of the weight carries it alone
_CELLS_PER_FOOT = 4
LEAST_LOAD_N = 1.0  # below this a foot counts as unloaded, and its ZMP as in the middle


@dataclass(frozen=True)
class SensorLayout:
    """Order of a biped's part of `sensordata`: cells, wrench of each foot (force, torque, point), CoM and its
    velocity, gyro, accelerometer, up axis and position of the torso, each foot's position, the legs' angles.

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
    ground_m: float,
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
        ground_m: Height of the floor, [m].
    """
    found = _Channels(layout)
    _add_sums(found, cells_xy_m, hip_offset_y_m)
    _add_body(found)
    _add_places(found)
    if ground_m != 0:
        com_z = found.channels["com_z"]
        above = _from_zero("com_z", layout.com.start + 2, 1.0, ground_m)
        found.channels["com_z"] = Channel("com_z", com_z.unit, above, com_z.description)
    for number, (joint, (sign, offset)) in enumerate(zip(layout.legs, zeros, strict=True)):
        description = f"angle of the {joint.replace('_', ' ')}"
        if offset == 0:
            found.add(joint, "rad", found.one(layout.leg_joints, number, sign), description)
        else:
            angle = _from_zero(joint, layout.leg_joints.start + number, sign, offset)
            found.channels[joint] = Channel(joint, parse_unit("rad"), angle, description)
    for number, foot in enumerate(("left", "right")):
        load = found.one(layout.wrench(number), 2)
        found.add(f"load_{foot}", "N", load, f"weight on the {foot} foot, by its contacts")
    for number, name in enumerate(layout.cells):
        bare = Quotient(found.one(layout.forces, number), np.zeros(layout.total))
        found.channels[name] = Channel(name, parse_unit("N"), bare, "force cell", cell_range, of_sensor=True)
    return found.channels


class _Channels:
    """Collects channels that are quotients of sums of sensor readings.

    Attributes:
        layout: Where the sensors stand.
        channels: What there is so far.
    """

    def __init__(self, layout: SensorLayout) -> None:
        self.layout = layout
        self.channels: dict[str, Channel] = {}

    def row(self, place: slice | int, weights: Array | float) -> Array:
        """Weights of all readings: these at a place, none elsewhere."""
        row = np.zeros(self.layout.total)
        row[place] = weights
        return row

    def one(self, place: slice, axis: int, weight: float = 1.0) -> Array:
        """Weights of all readings: one of a vector, none elsewhere."""
        return self.row(place.start + axis, weight)

    def add(self, name: str, unit: str, above: Array, description: str, below: Array | None = None) -> None:
        """Add a channel: a sum, or the quotient of two."""
        least = np.zeros(self.layout.total) if below is None else below
        self.channels[name] = Channel(
            name, parse_unit(unit), Quotient(above, least, LEAST_LOAD_N), description
        )


def _add_sums(found: _Channels, cells_xy_m: Array, hip_offset_y_m: float) -> None:
    """What the force cells say together."""
    force = found.layout.forces
    side = np.repeat([1.0, -1.0], _CELLS_PER_FOOT)
    total = found.row(force, 1.0)
    across = found.row(force, cells_xy_m[:, 1] + side * hip_offset_y_m)
    forward = found.row(force, cells_xy_m[:, 0])
    found.add("zmp_x", "m", forward, "ZMP by the force cells, forward of the ankles", total)
    found.add("zmp_y", "m", across, "ZMP by the force cells, left of the middle between the feet", total)
    found.add(
        "force_difference", "1", found.row(force, side), "(left - right) / (left + right) of the cells", total
    )
    found.add("load", "N", total, "sum of all force cells")


def _add_body(found: _Channels) -> None:
    """What the torso's sensors say."""
    layout = found.layout
    for axis, letter in enumerate("xyz"):
        found.add(f"gyro_{letter}", "rad/s", found.one(layout.gyro, axis), "rate of the torso")
        found.add(f"acceleration_{letter}", "m/s^2", found.one(layout.accelerometer, axis), "IMU")
        found.add(f"com_velocity_{letter}", "m/s", found.one(layout.com_velocity, axis), "of the CoM")
    for axis, letter in enumerate("xy"):
        lean = found.one(layout.torso_up, axis)
        found.add(f"tilt_{letter}", "1", lean, "torso's lean: component of its up axis")
    found.add("upright", "1", found.one(layout.torso_up, 2), "vertical component of the torso's up axis")


def _add_places(found: _Channels) -> None:
    """Where the centre of mass and the feet are."""
    layout = found.layout
    left, right = layout.foot(0), layout.foot(1)
    for axis, (letter, way) in enumerate({"x": "forward of", "y": "left of", "z": "above"}.items()):
        com, apart = found.one(layout.com, axis), found.one(left, axis) - found.one(right, axis)
        if letter != "z":
            com -= (found.one(left, axis) + found.one(right, axis)) / 2
        origin = "floor" if letter == "z" else "middle between the ankles, where they are"
        found.add(f"com_{letter}", "m", com, f"CoM {way} the {origin}")
        found.add(f"feet_{letter}", "m", apart, f"left ankle {way} the right one")


def _from_zero(joint: str, column: int, sign: float, offset: float) -> Formula:
    """Sign (angle - offset)."""
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
    carried = np.where(load > LEAST_LOAD_N / 10, load, np.nan)
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


class BipedView:
    """A recording as a biped's; T ticks of B robots.

    Attributes:
        recording: The recording.
        layout: Where in `sensordata` each sensor stands.
        block: The block of the robot file.
    """

    def __init__(self, recording: Recording) -> None:
        """Look at a recording of a robot with a `biped` block."""
        self.recording = recording
        body = recording.robot.blocks["biped"]
        self.layout: SensorLayout = body.layout
        self.block: BipedSpec = body.block
        self._ground_m: float = body.ground_m

    @property
    def _readings(self) -> Array:
        return self.recording.readings

    @cached_property
    def loads_n(self) -> Array:
        """Weight on each foot, left and right, from the contacts; shape (T, B, 2)."""
        return np.stack([centre_of_pressure(self._readings, self.layout, s)[1] for s in range(2)], axis=-1)

    @cached_property
    def support(self) -> NDArray[np.int64]:
        """Who carries, by the measured load: 0 the left foot alone, 1 the right, 2 both; shape (T, B)."""
        return support_by_load(self.loads_n)

    @cached_property
    def centre_of_pressure_m(self) -> Array:
        """Centre of pressure by contacts, from the middle between the feet; (T, B, 2); nan in the air."""
        feet = np.stack([self._readings[..., self.layout.foot(s)] for s in range(2)])
        middle: Array = total_centre_of_pressure(self._readings, self.layout) - feet[..., :2].mean(axis=0)
        return middle

    @cached_property
    def com_m(self) -> Array:
        """Centre of mass from the middle between the feet, up from the ground; shape (T, B, 3)."""
        com = self._readings[..., self.layout.com].copy()
        for side in range(2):
            com[..., :2] -= self._readings[..., self.layout.foot(side)][..., :2] / 2
        com[..., 2] -= self._ground_m
        return com

    @cached_property
    def com_velocity(self) -> Array:
        """Its velocity in the world; shape (T, B, 3), [m/s]."""
        return self._readings[..., self.layout.com_velocity]

    @cached_property
    def zmp_by_com_m(self) -> Array:
        """ZMP by eq. 2 from the centre of mass, from the middle between the feet; shape (T, B, 2).

        On a slope gravity accelerates along the floor as well, and presses on it with less.
        """
        velocity = self.com_velocity[..., :2]
        if self.recording.ticks == 1:  # no difference can be taken
            acceleration = np.zeros_like(velocity)
        else:
            acceleration = np.gradient(velocity, self.recording.step_s, axis=0)
        gravity = self.recording.robot.model.opt.gravity
        felt = (acceleration - gravity[:2]) * (GRAVITY_M_S2 / -gravity[2])
        return zmp_from_com(self.com_m[..., :2], felt, self.com_m[..., 2:])

    def columns(self) -> dict[str, tuple[Array, Unit]]:
        """What is recorded beside the channels; shape (T, B) each."""
        metre, speed = parse_unit("m"), parse_unit("m/s")
        found: dict[str, tuple[Array, Unit]] = {}
        for axis, letter in enumerate("xy"):
            found[f"cop_{letter}"] = (self.centre_of_pressure_m[..., axis], metre)
            found[f"zmp_by_com_{letter}"] = (self.zmp_by_com_m[..., axis], metre)
        for axis, letter in enumerate("xyz"):
            found[f"com_{letter}"] = (self.com_m[..., axis], metre)
            found[f"com_velocity_{letter}"] = (self.com_velocity[..., axis], speed)
            found[f"torso_{letter}"] = (self._readings[..., self.layout.torso][..., axis], metre)
        return found


def support_by_load(loads_n: Array) -> NDArray[np.int64]:
    """Who carries: 0 the left foot alone, 1 the right, 2 both; shape (...).

    Args:
        loads_n: Weight on each foot, left and right; shape (..., 2).
    """
    total = loads_n.sum(axis=-1)
    share = loads_n / np.maximum(total, 1e-9)[..., None]
    alone = share > _ALONE
    return np.where(alone[..., 0], 0, np.where(alone[..., 1], 1, 2))


def support_edges_m(block: BipedSpec) -> Array:
    """Edges of the support polygon for feet side by side at the hips' distance, sideways.

    Returns:
        Shape (3, 2): on the left foot, on the right foot, on both; right edge, left edge; [m].
    """
    offset = block.legs.hip_offset_y
    left, right = block.feet.left.extent, block.feet.right.extent
    left_foot = (offset + left.right, offset + left.left)
    right_foot = (-offset + right.right, -offset + right.left)
    return np.array([left_foot, right_foot, (right_foot[0], left_foot[1])])
