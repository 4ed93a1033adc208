"""Scenes as others write them: a robot beside loose things, without gravity, on any kind of ground."""

from __future__ import annotations

import numpy as np
import pytest

from circuitkit.robots.starter import write_robot_starter
from circuitkit.simulation import simulate

GROUND = '<geom name="ground" type="plane" size="5 5 .1"/>'
TORSO = """
<body name="torso" pos="0 0 .3"><freejoint name="root"/><geom size=".1"/>
  <body name="arm" pos=".1 0 0"><joint name="j" axis="0 1 0" range="-1 1"/><geom size=".05" pos=".1 0 0"/>
    <body name="hand" pos=".2 0 0"><joint name="k" axis="0 1 0"/><geom size=".03"/><site name="q1"/></body>
  </body>
</body>
"""
CUP = '<body name="cup{0}" pos="{0} 1 .2"><freejoint/><geom size=".05" mass="90"/></body>'
SCENES = {
    "free joint of the torso not first": ("", CUP.format(1) + GROUND + TORSO),
    "zero gravity": ('<option gravity="0 0 0"/>', GROUND + TORSO),
    "limited controls by default": (
        '<default><general ctrllimited="true" ctrlrange="-1 1"/></default>', GROUND + TORSO
    ),
    "sites with names of cells": ("", GROUND + '<site name="h1"/>' + TORSO),
    "loose things": ("", GROUND + TORSO + CUP.format(1) + CUP.format(2)),
    "ground as a box": ("", '<geom name="ground" type="box" size="5 5 .1" pos="0 0 -.1"/>' + TORSO),
    "ground inside a body": ("", '<body name="floor"><geom type="plane" size="5 5 .1"/></body>' + TORSO),
}  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
def test_a_started_file_of_a_scene_runs_and_its_robot_is_the_torso(tmp_path, scene):
    options, world = SCENES[scene]
    motor = '<actuator><motor name="m" joint="j" ctrlrange="-1 1"/></actuator>'
    (tmp_path / "model.xml").write_text(
        f"<mujoco>{options}<worldbody>{world}</worldbody>{motor}</mujoco>", encoding="utf-8"
    )
    write_robot_starter(tmp_path / "model.xml", tmp_path / "robot.yaml")
    (tmp_path / "s.yaml").write_text(
        "scenario: s\nrobot: robot.yaml\ncontrol_step: 10 ms\nduration: 200 ms\n", encoding="utf-8"
    )
    recording = simulate(tmp_path / "s.yaml", controller="open_loop", output=tmp_path / "out").recording
    height = recording.qpos[:, 0, 7 + 2 if "not first" in scene else 2]
    fallen = 0.0 if scene == "zero gravity" else 9.81 * 0.2**2 / 2
    np.testing.assert_allclose(0.3 - height[-1], fallen, atol=0.06)
