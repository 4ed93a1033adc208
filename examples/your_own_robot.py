"""A robot of your own: an MJCF, names for what can be read and written, and a circuit that moves it.

Run it with: python examples/your_own_robot.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from circuitkit import Robot, Scenario, simulate

PENDULUM = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <body name="rod" pos="0 0 1">
      <joint name="pivot" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.5"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="pivot" kp="1" kv="0.02"/>
  </actuator>
</mujoco>
"""

with tempfile.TemporaryDirectory() as folder:
    mjcf = Path(folder) / "pendulum.xml"
    mjcf.write_text(PENDULUM, encoding="utf-8")
    robot = Robot(
        robot="pendulum",
        mjcf=str(mjcf),
        channels={
            "angle": {"unit": "rad", "is": "joint(pivot)"},
            "stretch": {"unit": "1", "is": "joint(pivot) / 1 rad"},
        },
        commands={"target": {"unit": "rad", "to": {"servo": 1}, "limits": ("-60 deg", "60 deg")}},
    )
    scenario = Scenario(
        scenario="swing",
        robot=robot,
        circuit="matsuoka_half_centre",
        # The circuit's own names are joined to those of the robot.
        connect={"inputs": {"feedback": "stretch"}, "outputs": {"joint_angle": "target"}},
        duration=20.0,
        measures={"frequency": "count(angle > 0 rad) / 20 s", "amplitude": "max(abs(angle))"},
    )
    for controller in ("circuit", "open_loop"):
        measures = simulate(scenario, controller=controller).measures
        print(f"{controller}: {measures['frequency']:.2f} Hz, {measures['amplitude']:.2f} rad")
