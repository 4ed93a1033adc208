"""The sensors of a model: those of the MJCF, and those that expressions need beside them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from circuitkit.base.errors import ExpressionError, listing, suggest
from circuitkit.circuit.expressions.expression import Name

_OBJECT = mujoco.mjtObj
# What a sensor's numbers are; one that is not here, such as a user's or a plug-in's, fits any unit.
UNIT_OF_TYPE = {
    "touch": "N", "accelerometer": "m/s^2", "velocimeter": "m/s", "gyro": "rad/s", "force": "N",
    "torque": "N*m",
    "rangefinder": "m", "ballquat": "1", "ballangvel": "rad/s", "framepos": "m", "framequat": "1",
    "framexaxis": "1", "frameyaxis": "1", "framezaxis": "1", "framelinvel": "m/s", "frameangvel": "rad/s",
    "framelinacc": "m/s^2", "frameangacc": "rad/s^2", "subtreecom": "m", "subtreelinvel": "m/s",
    "insidesite": "1",
    "geomdist": "m", "geomnormal": "1", "geomfromto": "m", "e_potential": "N*m", "e_kinetic": "N*m",
    "clock": "s",
    "subtreeangmom": "N*m*s",
}  # fmt: skip
OF_HINGE_AND_SLIDE = {
    "jointpos": ("rad", "m"), "jointvel": ("rad/s", "m/s"), "jointactfrc": ("N*m", "N"),
    "jointlimitpos": ("rad", "m"), "jointlimitvel": ("rad/s", "m/s"), "jointlimitfrc": ("N*m", "N"),
}  # fmt: skip
_WIDTHS = {"quat": 4, "fromto": 6, "camprojection": 2}
# How many numbers these have depends on their settings; the compiler knows.
_OPEN_WIDTH = frozenset({"contact", "user", "plugin", "tactile", "rangefinder"})
_THREE = frozenset({
    "accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer",
    "ballangvel", "framepos", "framexaxis", "frameyaxis", "framezaxis", "framelinvel",
    "frameangvel", "framelinacc", "frameangacc", "subtreecom", "subtreelinvel", "subtreeangmom",
    "geomnormal",
})  # fmt: skip


def word_of(kind: mujoco.mjtSensor) -> str:
    """What an MJCF calls a kind of sensor, such as `jointpos`."""
    return str(kind.name).removeprefix("mjSENS_").lower()


class Sensors:
    """The sensors of a model: those of the MJCF, and those that expressions need beside them."""

    def __init__(self, mj: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
        """Take stock of an MJCF."""
        self._mj = mj
        self.own = {sensor.name: sensor for sensor in mj.sensors}
        self._added: dict[tuple[Any, ...], str] = {}
        self._names = {
            "body": {body.name: body for body in mj.bodies},
            "site": {site.name: site for site in mj.sites},
            "geom": {geom.name: geom for geom in mj.geoms},
            "camera": {camera.name: camera for camera in mj.cameras},
            "joint": {joint.name: joint for joint in mj.joints},
            "tendon": {tendon.name: tendon for tendon in mj.tendons},
            "actuator": {actuator.name: actuator for actuator in mj.actuators},
        }

    def width(self, name: str) -> int:
        """How many numbers a sensor of the MJCF has."""
        word = word_of(self.own[name].type)
        if word in _OPEN_WIDTH:
            return self._widths[name]
        if word in _THREE:
            return 3
        return next((width for ending, width in _WIDTHS.items() if word.endswith(ending)), 1)

    @cached_property
    def _widths(self) -> dict[str, int]:
        """How many numbers each sensor has, by a compilation of its own."""
        try:
            model = self._mj.copy().compile()
        except ValueError:
            return dict.fromkeys(
                self.own, 1
            )  # what is wrong with the model is said when it is compiled itself
        # A sensor whose part is gone is not copied; this is said as well when the model itself is compiled.
        sensors = (model.sensor(number) for number in range(model.nsensor))
        return dict.fromkeys(self.own, 1) | {sensor.name: int(sensor.dim[0]) for sensor in sensors}

    def named(self, kind: str) -> dict[str, Any]:
        """The parts of a kind by name, such as bodies; without those that have no name."""
        return {name: part for name, part in self._names[kind].items() if name}

    def part(self, kinds: Iterable[str], name: str) -> tuple[str, Any]:
        """Find a part; the first kind that has the name.

        Raises:
            ExpressionError: The MJCF has none; lists those it has.
        """
        for kind in kinds:
            if name in self.named(kind):
                return kind, self._names[kind][name]
        have = [each for kind in kinds for each in self.named(kind)]
        raise no_such(" or ".join(kinds), name, have)

    def add(self, kind: mujoco.mjtSensor, obj: Any, name: str, **more: Any) -> str:  # noqa: ANN401 - as above
        """A sensor of the compiled model; the same one for the same arguments. Returns its name."""
        key = (kind, obj, name, *sorted((k, str(v)) for k, v in more.items()))
        if key not in self._added:
            own = f"circuitkit {len(self._added)} {word_of(kind)} {name}"
            intprm = more.pop("intprm", None)
            sensor = self._mj.add_sensor(name=own, type=kind, objtype=obj, objname=name, **more)
            if intprm is not None:
                sensor.intprm[: len(intprm)] = intprm
            self._added[key] = own
        return self._added[key]


def column(sensor: str, component: int = 0) -> Name:
    """The name that stands for a column of `sensordata` in a bound expression."""
    return Name(f"{sensor}\0{component}")


def column_index(model: mujoco.MjModel, name: str) -> int:
    """Which column of `sensordata` a name made by `column` is."""
    sensor, _, component = name.partition("\0")
    return int(model.sensor(sensor).adr[0]) + int(component)


def no_such(kind: str, name: str, have: Iterable[str]) -> ExpressionError:
    """An error that lists the parts of the MJCF that there are."""
    names = list(have)
    hint = suggest(name, names)
    message = f"the MJCF has no {kind} '{name}'; allowed: {listing(names)}"
    return ExpressionError(f"{message}; {hint}" if hint else message)


def unit_of_sensor(model: mujoco.MjModel, number: int) -> str | None:
    """The SI unit of a sensor of a compiled model; None where MuJoCo knows none.

    Args:
        model: The model.
        number: The sensor's.
    """
    word = word_of(mujoco.mjtSensor(int(model.sensor_type[number])))
    of_joint = int(model.sensor_objtype[number]) == int(_OBJECT.mjOBJ_JOINT)
    if of_joint and word in OF_HINGE_AND_SLIDE:
        joint = int(model.sensor_objid[number])
        hinge = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)
        return OF_HINGE_AND_SLIDE[word][0 if hinge else 1]
    return UNIT_OF_TYPE.get(word)


def sensor_at(model: mujoco.MjModel, column: int) -> int:
    """Which sensor of a compiled model writes a column of `sensordata`."""
    return int(np.flatnonzero(model.sensor_adr <= column)[-1])
