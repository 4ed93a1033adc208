"""A made-up humanoid: every length, axis and frame of it is an argument, so that none is that of a NAO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

_AXES = {"roll": (1.0, 0.0, 0.0), "pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}


def turned(axis: Sequence[float], angle_rad: float) -> np.ndarray:
    """Quaternion of a turn about an axis of any length."""
    found = np.zeros(4)
    mujoco.mju_axisAngle2Quat(found, np.array(axis) / np.linalg.norm(axis), angle_rad)
    return found


def _text(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)


@dataclass(frozen=True)
class Humanoid:
    """What it is made of; lengths in metres for a body of 1.7 m.

    Attributes:
        mass_kg: Of all of it.
        hips: Joints of a hip, from the trunk down; names of `_AXES` that hinges turn about.
        axes: Other axes of joints, by role.
        flipped: Roles that turn the other way.
        hip_ahead: Hips ahead of the trunk's origin.
        hip_aside: Half the distance between them.
        bent: Half the angle of the knee when the joints are at zero.
        frame: Quaternion of the trunk's frame when it is upright.
        sole: Whether the sole is one box, or two and a bar for the toes.
        ranges: Other ranges of joints, by the end of their name, [rad].
        stiffness: Of the servos, as a multiple of m g h.
        damping_s: Damping over stiffness.
        option: Attributes of the MJCF's `option`.
        floor: What it stands on.
        more: Further lines of the robot file.
    """

    mass_kg: float = 70.0
    hips: tuple[str, ...] = ("roll", "pitch", "yaw")
    axes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    flipped: tuple[str, ...] = ()
    hip_ahead: float = 0.0
    hip_aside: float = 0.09
    bent: float = 0.0
    frame: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    sole: str = "box"
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    stiffness: float = 8.0
    damping_s: float = 0.01
    option: str = 'timestep="0.002" integrator="implicitfast"'
    floor: str = '<geom type="plane" size="0 0 1"/>'
    more: str = ""

    @property
    def falls(self) -> float:
        """About m g h over the ankles, [N m/rad]."""
        return self.mass_kg * 9.81 * 0.93

    def write(self, folder: Path) -> Path:
        """Write MJCF and robot file; gives the robot file."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "humanoid.xml").write_text(self._mjcf(), encoding="utf-8")
        path = folder / "robot.yaml"
        path.write_text(self._robot_file(), encoding="utf-8")
        return path

    def _zero(self, role: str) -> float:
        kind = role.split("_", 1)[1]
        return {"hip_pitch": -1.0, "knee_pitch": 2.0, "ankle_pitch": -1.0}.get(kind, 0.0) * self.bent

    def _robot_file(self) -> str:
        k, torque = self.stiffness * self.falls, 10 * self.mass_kg
        servo = (
            "  - {{joints: [{}], stiffness: {:.6g} N*m/rad, damping: {:.6g} N*m*s/rad, torque: {:.6g} N*m}}\n"
        )
        text = f"robot: humanoid\nmjcf: humanoid.xml\n{self.more}servos:\n"
        text += servo.format("'left_*', 'right_*'", k, k * self.damping_s, torque)
        text += servo.format("waist", k / 4, k / 4 * self.damping_s, torque)
        text += "biped:\n  torso: trunk\n"
        text += "  feet: {left: {body: left_foot}, right: {body: right_foot}}\n  joints:\n"
        roles = [f"hip_{kind}" for kind in ("roll", "pitch")] + ["knee_pitch", "ankle_pitch", "ankle_roll"]
        for role in (f"{side}_{role}" for side in ("left", "right") for role in roles):
            offset = -self._zero(role) * (-1 if role in self.flipped else 1)
            text += f"    {role}: {{joint: {role}, offset: {offset:.9g} rad}}\n"
        return text

    def _joint(self, role: str) -> str:
        axis = np.array(self.axes.get(role, _AXES[role.rsplit("_", 1)[1]]))
        sign = -1.0 if role in self.flipped else 1.0
        ends = next((r for end, r in self.ranges.items() if role.endswith(end)), (-2.6, 2.6))
        low, high = sorted(sign * (end - self._zero(role)) for end in ends)
        return (
            f'<joint name="{role}" axis="{_text(*sign * axis)}" range="{_text(low, high)}" armature="0.02"/>'
        )

    def _leg(self, side: str, back: np.ndarray) -> str:
        m = self.mass_kg
        seat = np.zeros(3)
        aside = self.hip_aside if side == "left" else -self.hip_aside
        mujoco.mju_rotVecQuat(seat, np.array([self.hip_ahead, aside, -0.1]), back)
        text = ""
        for i, kind in enumerate(self.hips):
            role = f"{side}_hip_{kind}"
            quat = np.zeros(4)
            mujoco.mju_mulQuat(
                quat, back if i == 0 else turned((0, 0, 1), 0), turned((0, 1, 0), self._zero(role))
            )
            place = seat if i == 0 else np.zeros(3)
            text += f'<body name="{role}" pos="{_text(*place)}" quat="{_text(*quat)}">{self._joint(role)}'
            text += f'<inertial pos="0 0 -0.01" mass="{m * 0.015}" diaginertia="0.02 0.02 0.02"/>'
        text += _bone(0.42, 0.1 * m) + self._part(side, "knee_pitch", 0.42) + _bone(0.42, 0.045 * m)
        text += self._part(side, "ankle_pitch", 0.42)
        text += f'<inertial pos="0 0 0" mass="{m * 0.004}" diaginertia="0.007 0.007 0.007"/>'
        text += f'<body name="{side}_foot">{self._joint(f"{side}_ankle_roll")}{self._sole()}'
        return text + "</body>" * (len(self.hips) + 3)

    def _part(self, side: str, name: str, down: float) -> str:
        role = f"{side}_{name}"
        quat = _text(*turned((0, 1, 0), self._zero(role)))
        return f'<body name="{role}" pos="0 0 {-down}" quat="{quat}">{self._joint(role)}'

    def _sole(self) -> str:
        mass = self.mass_kg * 0.004
        if self.sole == "box":
            return f'<geom type="box" pos="0.05 0 -0.065" size="0.12 0.05 0.015" mass="{3 * mass}"/>'
        return (
            f'<geom type="box" pos="-0.035 0 -0.065" size="0.035 0.04 0.015" mass="{mass}"/>'
            f'<geom type="box" pos="0.085 0 -0.065" size="0.05 0.05 0.015" mass="{mass}"/>'
            f'<geom type="capsule" fromto="0.16 -0.05 -0.068 0.16 0.05 -0.068" size="0.012" mass="{mass}"/>'
        )

    def _mjcf(self) -> str:
        m, back = self.mass_kg, np.zeros(4)
        mujoco.mju_negQuat(back, self.frame)
        up, chest = np.zeros(3), np.zeros(3)
        mujoco.mju_rotVecQuat(up, np.array([0.0, 0.0, 1.0]), back)
        mujoco.mju_rotVecQuat(chest, np.array([0.0, 0.0, 0.25]), back)
        box = f'quat="{_text(*back)}" type="box" contype="0" conaffinity="0"'
        height = 0.182 + 0.84 * np.cos(self.bent)
        return f"""\
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option {self.option}/>
  <worldbody>
    {self.floor}
    <body name="trunk" pos="0 0 {height:.6g}" quat="{_text(*self.frame)}">
      <freejoint/>
      <geom {box} size="0.1 0.12 0.08" mass="{0.1 * m}"/>
      <body name="chest">
        <joint name="waist" axis="{_text(*up)}"/>
        <geom {box} pos="{_text(*chest)}" size="0.1 0.15 0.25" mass="{0.55 * m}"/>
      </body>
      {self._leg("left", back)}
      {self._leg("right", back)}
    </body>
  </worldbody>
</mujoco>
"""


def _bone(length: float, mass: float) -> str:
    end = f'fromto="0 0 0 0 0 {-length}" size="0.05"'
    return f'<geom type="capsule" {end} mass="{mass}" contype="0" conaffinity="0"/>'


def write_gait(folder: Path, *, sideways_mm: float = 90.0, single_support_ms: int = 500) -> Path:
    """A gait for it, by the rules of docs/bipeds.md."""
    path = folder / "gait.yaml"
    path.write_text(
        "gait: humanoid\npattern: three_movements\ncontrol_step: 10 ms\ndouble_support: 50 ms\n"
        f"single_support: {single_support_ms} ms\nstep_length: 60 mm\nstand: 1 s\nknee: 25 deg\n"
        f"com_height: 920 mm\nzmp: {{forward: 40 mm, sideways: {sideways_mm} mm}}\n"
        "lift: {height: 20 mm, start: 0 %, end: 100 %}\nswing: {start: 24 %, end: 65 %}\n",
        encoding="utf-8",
    )
    return path
