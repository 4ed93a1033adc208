"""What sensors say: places in `sensordata`, the channels that controllers read, the centre of pressure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.gait import LEG_JOINTS

Array = NDArray[np.float64]

_CELLS_PER_FOOT = 4
_LEAST_LOAD_N = 1.0  # below this a foot counts as unloaded, and its ZMP as in the middle


@dataclass(frozen=True)
class SensorLayout:
    """Order of `sensordata`: cells, wrench of each foot (force, torque, point), CoM, CoM velocity, gyro,
    accelerometer, up axis and position of the torso, position of each foot, angles of the legs' joints.

    Attributes:
        cells: Names of the eight force cells, left foot first.
    """  # noqa: D205 - the summary is a list

    cells: tuple[str, ...]

    @property
    def forces(self) -> slice:
        """The force cells, [N]."""
        return slice(0, len(self.cells))

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
        """Angles of `LEG_JOINTS`, [rad]."""
        return self._after(42, len(LEG_JOINTS))

    @property
    def width(self) -> int:
        """How many numbers a robot's sensors give."""
        return len(self.cells) + 42 + len(LEG_JOINTS)

    def _after(self, start: int, count: int) -> slice:
        return slice(len(self.cells) + start, len(self.cells) + start + count)


@dataclass(frozen=True)
class Channel:
    """Something a controller can read: a quotient of two linear forms of sensor readings.

    Attributes:
        name: Name.
        unit: SI unit.
        numerator: Weights of all sensors; shape (s,).
        denominator: Weights of all sensors; shape (s,); all zero for a plain linear form.
        description: What it is.
    """

    name: str
    unit: Unit
    numerator: Array
    denominator: Array
    description: str


def channels(layout: SensorLayout, cells_xy_m: Array, hip_offset_y_m: float) -> dict[str, Channel]:
    """All channels of a robot with two feet of four force cells.

    The ZMP is from the middle between the feet as if they stood side by side at the hips' distance, since the
    cells do not know where the feet are; the CoM is from the middle between the feet where they are.

    Args:
        layout: Where the sensors stand.
        cells_xy_m: Position of each cell from its ankle; shape (8, 2).
        hip_offset_y_m: Half the distance between the feet.
    """
    width, force = layout.width, layout.forces
    side = np.repeat([1.0, -1.0], _CELLS_PER_FOOT)
    total, none = np.zeros(width), np.zeros(width)
    total[force] = 1.0

    def cells(weights: Array) -> Array:
        row = np.zeros(width)
        row[force] = weights
        return row

    def one(place: slice, axis: int) -> Array:
        row = np.zeros(width)
        row[place.start + axis] = 1.0
        return row

    metre, plain = parse_unit("m"), parse_unit("1")
    zmp_y = cells(cells_xy_m[:, 1] + side * hip_offset_y_m)
    every = [
        Channel(
            "zmp_x", metre, cells(cells_xy_m[:, 0]), total, "ZMP by the force cells, forward of the ankles"
        ),
        Channel("zmp_y", metre, zmp_y, total, "ZMP by the force cells, left of the middle between the feet"),
        Channel(
            "force_difference", plain, cells(side), total, "(left - right) / (left + right) of the cells"
        ),
        Channel("load", parse_unit("N"), total, none, "sum of all force cells"),
    ]
    for axis, letter in enumerate("xyz"):
        every += [
            Channel(f"gyro_{letter}", parse_unit("rad/s"), one(layout.gyro, axis), none, "rate of the torso"),
            Channel(
                f"acceleration_{letter}", parse_unit("m/s^2"), one(layout.accelerometer, axis), none, "IMU"
            ),
            Channel(
                f"com_velocity_{letter}",
                parse_unit("m/s"),
                one(layout.com_velocity, axis),
                none,
                "of the CoM",
            ),
        ]
    for axis, letter in enumerate("xy"):
        tilt = one(layout.torso_up, axis)
        every.append(Channel(f"tilt_{letter}", plain, tilt, none, "torso's lean: component of its up axis"))
    left, right = layout.foot(0), layout.foot(1)
    for axis, (letter, way) in enumerate({"x": "forward of", "y": "left of", "z": "above"}.items()):
        com, apart = one(layout.com, axis), one(left, axis) - one(right, axis)
        if letter != "z":
            com -= (one(left, axis) + one(right, axis)) / 2
        origin = "floor" if letter == "z" else "middle between the ankles, where they are"
        every += [
            Channel(f"com_{letter}", metre, com, none, f"CoM {way} the {origin}"),
            Channel(f"feet_{letter}", metre, apart, none, f"left ankle {way} the right one"),
        ]
    for number, joint in enumerate(LEG_JOINTS):
        angle = one(layout.leg_joints, number)
        every.append(
            Channel(joint, parse_unit("rad"), angle, none, f"angle of the {joint.replace('_', ' ')}")
        )
    return {channel.name: channel for channel in every}


class Observer:
    """Computes chosen channels from sensor readings, for all robots at once.

    Every robot's result is summed in the same order whatever the batch, so it is the same to the last bit.
    """

    def __init__(self, layout: SensorLayout, available: dict[str, Channel], names: Sequence[str]) -> None:
        """Pick channels.

        Raises:
            UnknownNameError: There is no such channel; lists those there are.
        """
        for name in names:
            if name not in available:
                kind = "sensor channel"
                raise UnknownNameError(kind, name, available)
        chosen = [available[name] for name in names]
        self.names = tuple(names)
        self.units = tuple(channel.unit for channel in chosen)
        rows = np.array([c.numerator for c in chosen] + [c.denominator for c in chosen]).reshape(
            -1, layout.width
        )
        used = np.flatnonzero(rows.any(axis=0))
        self._columns = slice(int(used[0]), int(used[-1]) + 1) if len(used) else slice(0, 0)
        self._weights = np.ascontiguousarray(rows[:, self._columns])
        self._count = len(chosen)
        # A plain linear form is divided by one: its "load" is 0, and the least load takes its place.
        self._least = np.array([_LEAST_LOAD_N if c.denominator.any() else 1.0 for c in chosen])

    def __call__(self, readings: Array) -> Array:
        """Channels, shape (B, k), of readings, shape (B, s), all of which are numbers."""
        return self._divided(np.vecdot(readings[:, None, self._columns], self._weights))

    def bound(self, readings: Array) -> Callable[[Array], object]:
        """The same for one array of readings that changes in place, without making arrays on the way.

        Args:
            readings: Shape (B, s).

        Returns:
            What writes the channels into an array of shape (B, k).
        """
        view, weights, least = readings[:, None, self._columns], self._weights, self._least
        sums = np.empty((len(readings), len(weights)))
        above, below = sums[:, : self._count], sums[:, self._count :]

        def observe(values: Array) -> None:
            np.vecdot(view, weights, sums)
            np.maximum(below, least, out=below)
            np.divide(above, below, values)

        return observe

    def where_some_are_missing(self, readings: Array) -> Array:
        """The same for readings that may be missing (not a number), to the same bits where none is.

        Zero times not-a-number is no zero: here a channel misses only the readings that it uses.
        """
        used = np.where(self._weights != 0, readings[:, None, self._columns], 0.0)
        return self._divided(np.vecdot(used, self._weights))

    def _divided(self, sums: Array) -> Array:
        values: Array = sums[:, : self._count] / np.maximum(sums[:, self._count :], self._least)
        return values


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
