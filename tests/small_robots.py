"""Small robots for tests: an MJCF as text, and the robot file for it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from circuitkit.control import Array
from circuitkit.robots import Robot, RobotModel, build_model, load_robot
from circuitkit.simulation import Disturbance, Recording, RunSpec, Scenario, make_plan
from circuitkit.simulation.loop import run_loop

# A cart on a rail with a pole, which a motor pushes; nothing is damped and nothing touches.
CART = """
<mujoco>
  <option timestep="0.002" gravity="0 0 -9.81"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="cart" pos="0 0 1">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom name="box" type="box" size=".1 .1 .1" mass="2"/>
      <body name="pole">
        <joint name="hinge" type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -1" size=".02" mass=".5"/>
        <site name="tip" pos="0 0 -1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="slide" ctrlrange="-20 20"/></actuator>
  <sensor>
    <jointpos name="rail" joint="slide"/><framelinacc name="felt" objtype="site" objname="tip"/>
  </sensor>
  <keyframe><key name="swung" qpos="0.3 0.5" ctrl="1.5"/><key name="home"/></keyframe>
</mujoco>
"""
CART_FILE = {
    "channels": {
        "place": {"unit": "m", "is": "joint(slide)"},
        "speed": {"unit": "m/s", "is": "rate(slide)"},
        "angle": {"unit": "deg", "is": "joint(hinge)"},
        "twice": {"unit": "m", "is": "2 * joint(slide)"},
        "pull": {"unit": "N", "is": "force(slide)"},
    },
    "commands": {"force": {"unit": "N", "to": {"motor": 1}}},
}

# A puck that glides in free fall or without any force, and a block at rest on a floor.
PUCK = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body name="puck"><freejoint name="free"/>
      <geom type="box" size=".1 .2 .05" mass="2"/><site name="s" pos=".1 0 0"/></body>
  </worldbody>
</mujoco>
"""
PUCK_FILE = {
    "channels": {
        **{axis: {"unit": "m", "is": f"position(puck, {axis})"} for axis in "xyz"},
        **{f"v{axis}": {"unit": "m/s", "is": f"velocity(puck, {axis})"} for axis in "xyz"},
        **{f"w{axis}": {"unit": "rad/s", "is": f"angular_velocity(puck, {axis})"} for axis in "xyz"},
    }
}


def robot_file(folder: Path, mjcf: str, **sections: Any) -> Path:
    """Write an MJCF and a robot file for it; returns the path of the robot file."""
    folder.mkdir(exist_ok=True)
    (folder / "model.xml").write_text(mjcf, encoding="utf-8")
    path = folder / "robot.yaml"
    text = yaml.safe_dump(
        {"robot": "small", "mjcf": "model.xml", **sections}, sort_keys=False, allow_unicode=True
    )
    path.write_text(text, encoding="utf-8")
    return path


def small_robot(folder: Path, mjcf: str, **sections: Any) -> Robot:
    """A robot of an MJCF."""
    return load_robot(robot_file(folder, mjcf, **sections))


def small_model(folder: Path, mjcf: str, **sections: Any) -> RobotModel:
    """The compiled robot of an MJCF."""
    return build_model(small_robot(folder, mjcf, **sections))


class Told:
    """A controller that writes what it is told, tick by tick, and remembers what it read."""

    name = "told"

    def __init__(self, observations: Sequence[str] = (), **commands: Any) -> None:
        """Name what it reads, and give each command a number or one a tick."""
        self.observations, self.commands = tuple(observations), tuple(commands)
        self._values = [np.atleast_1d(np.asarray(values, dtype=float)) for values in commands.values()]

    def reset(self, batch: int) -> None:
        """Start again."""
        self._tick, self._batch = 0, batch
        self.seen: list[Array] = []

    def step(self, observation: Array) -> Array:
        """The commands of this tick."""
        self.seen.append(observation.copy())
        row = [values[min(self._tick, len(values) - 1)] for values in self._values]
        self._tick += 1
        return np.tile(np.array(row, dtype=float), (self._batch, 1))


def run(
    robot: Robot,
    controller: Any = None,
    disturbances: Iterable[Disturbance] = (),
    *,
    seeds: Sequence[int] = (0,),
    step_s: float = 0.01,
    duration_s: float = 0.5,
    **fields: Any,
) -> Recording:
    """Run robots, one for each seed."""
    scenario = Scenario(
        robot=robot, controller=controller or Told(), control_step=step_s, duration=duration_s,
        disturbances=list(disturbances), **fields,
    )  # fmt: skip
    plan = make_plan(scenario)
    specs = [RunSpec(seed, scenario.befalling) for seed in seeds]
    return run_loop(plan.setup(plan.controller(), specs))
