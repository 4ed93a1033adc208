"""Weak, dead and soft actuators of every type: the force is s times what it is, in the same state."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from small_robots import Told, run, small_model, small_robot

from circuitkit.base.errors import InputError
from circuitkit.robots import build_model
from circuitkit.simulation.disturbances.actuator import Actuator
from circuitkit.simulation.disturbances.body import Body

MODEL = """
<mujoco>
  %s
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="b"><joint name="h" axis="0 0 1" range="-90 90"/><geom size=".1" mass="1" pos=".3 0 0"/>
      <body name="hand" pos=".5 0 0"><geom size=".03" mass=".1"/></body></body>
    <body name="c" pos="2 0 0"><joint name="ball" type="ball"/><geom size=".1" mass="1"/></body>
  </worldbody>
  <actuator>%s</actuator>
</mujoco>
"""
SOME = {  # by a name: the actuator, its controls, and whether its force is at its limit
    "motor": ('<motor name="a" joint="h" gear="3"/>', [2.0]),
    "motor at its limit": ('<motor name="a" joint="h" forcerange="-1 1.5"/>', [2.0]),
    "position": ('<position name="a" joint="h" kp="9" kv="2" gear="2"/>', [1.0]),
    "position at its limit": ('<position name="a" joint="h" kp="9" kv="2" forcerange="-1 1"/>', [1.0]),
    "filtered position": ('<position name="a" joint="h" kp="9" kv="2" timeconst="1"/>', [1.0]),
    "velocity": ('<velocity name="a" joint="h" kv="2"/>', [1.0]),
    "damper": ('<damper name="a" joint="h" kv="2" ctrlrange="0 1"/>', [0.5]),
    "intvelocity": ('<intvelocity name="a" joint="h" kp="9" actrange="-1 1"/>', [1.0]),
    "cylinder": ('<cylinder name="a" joint="h" timeconst="1" area="2" bias="1 2 3"/>', [0.5]),
    "muscle": ('<muscle name="a" joint="h" lengthrange="-2 2"/>', [1.0]),
    "muscle with a force": ('<muscle name="a" joint="h" lengthrange="-2 2" force="3"/>', [1.0]),
    "muscle at its limit": ('<muscle name="a" joint="h" lengthrange="-2 2" forcerange="-.5 0"/>', [1.0]),
    "general": (
        '<general name="a" joint="h" gaintype="affine" gainprm="1 2 3" biastype="affine" biasprm="1 2 3" '
        'dyntype="filter" dynprm="1"/>', [1.0],
    ),
    "muscle of which only the gain is one": (
        '<general name="a" joint="h" gaintype="muscle" gainprm=".75 1.05 4 200 .5 1.6 1.5 1.3 1.2" '
        'biastype="affine" biasprm="1 2 3" lengthrange="-2 2"/>', [1.0],
    ),
    "pid": ('<pid name="a" joint="h" kp="9" kv="2" ki="3"/>', [1.0, 0.5]),
    "orientation": ('<orientation name="a" joint="ball" kp="9" kv="2"/>', [0.5, 0.2, 0.1]),
    "orientation at its limit": (
        '<orientation name="a" joint="ball" kp="9" kv="2" forcerange="0 1"/>', [1.0, 1.0, 1.0],
    ),
}  # fmt: skip


def forces(model: mujoco.MjModel, control) -> np.ndarray:
    """All generalised forces of the actuators in some state."""
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[:], data.act[:], data.ctrl[:] = 0.1, [0.3, 0.1, 0.2, 0.3], 0.3, control
    mujoco.mj_forward(model, data)
    return np.array(data.qfrc_actuator)


@pytest.mark.parametrize("name", SOME)
@pytest.mark.parametrize("strength", [0.0, 0.3, 1.7])
def test_the_force_is_that_of_the_strong_one_times_the_strength(tmp_path, name, strength):
    actuator, control = SOME[name]
    robot = small_robot(tmp_path, MODEL % ("", actuator))
    strong = forces(build_model(robot).model, control)
    weak = forces(build_model(robot, [Actuator(strength=strength).change]).model, control)
    assert np.abs(strong).max() > 0.1
    np.testing.assert_allclose(weak, strength * strong, rtol=1e-12, atol=1e-14)
    twice = build_model(robot, [Actuator(strength=0.5).change, Actuator(strength=strength).change]).model
    np.testing.assert_allclose(forces(twice, control), 0.5 * weak, rtol=1e-12, atol=1e-14)


def test_a_spell_weakens_a_servo_that_is_at_its_limit_and_ends(tmp_path):
    robot = small_robot(
        tmp_path, MODEL % ("", SOME["motor at its limit"][0]),
        channels={"f": {"unit": "N*m", "is": "force(h)"}}, commands={"u": {"unit": "N*m", "to": {"a": 1}}},
    )  # fmt: skip
    found = run(robot, Told(u=9.0), [Actuator(strength=0.5, start=0.1, duration=0.1)], duration_s=0.3)
    np.testing.assert_allclose(found.channel("f")[:, 0], np.repeat([1.5, 0.75, 1.5], 10))


PLUG = """
  <extension>
    <plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="4"/></instance></plugin>
  </extension>
"""


@pytest.mark.parametrize(
    ("more", "actuator", "why"),
    [
        (
            "",
            '<dcmotor name="a" joint="h" motorconst="0.1" resistance="1"/>',
            "that of a dcmotor follows from its current",
        ),
        (
            PLUG,
            '<plugin name="a" joint="h" plugin="mujoco.pid" instance="p" actdim="0"/>',
            "a plug-in of MuJoCo computes it",
        ),
        ("", '<pid name="a" joint="h" kp="9" input="pos ff"/>', "a control of it is a force"),
    ],
)
@pytest.mark.parametrize("start", [0.0, 0.1])
def test_a_force_that_cannot_be_scaled_is_said_to_be_so(tmp_path, more, actuator, why, start):
    robot = small_robot(tmp_path, MODEL % (more, actuator))
    with pytest.raises(InputError) as caught:
        run(robot, disturbances=[Actuator(strength=0.5, start=start)])
    assert str(caught.value).endswith(
        f"disturbances[0].actuator.strength: the force of the actuator 'a' cannot be scaled, for {why}; "
        "allowed: actuators whose force is proportional to their gains, such as motor, position, muscle"
    )
    run(robot, disturbances=[Actuator(strength=1.0, start=start)], duration_s=0.2)


@pytest.mark.parametrize("start", [0.0, 0.1])
def test_only_position_servos_have_a_stiffness(tmp_path, start):
    two = '<motor name="a" joint="h"/><position name="s" joint="h" kp="3"/>'
    robot = small_robot(tmp_path, MODEL % ("", two))
    with pytest.raises(InputError) as caught:
        run(robot, disturbances=[Actuator(actuator="a", stiffness=0.5, start=start)])
    assert str(caught.value).endswith(
        "disturbances[0].actuator.stiffness: 'a' is no position servo, and nothing else has a stiffness; "
        "allowed: s"
    )
    run(robot, disturbances=[Actuator(stiffness=0.5, start=start)], duration_s=0.2)
    with pytest.raises(InputError, match="allowed: strength; the robot has no position servo"):
        run(small_robot(tmp_path, MODEL % ("", SOME["motor"][0])), disturbances=[Actuator(stiffness=0.5)])


@pytest.mark.parametrize("name", ["position", "filtered position", "intvelocity", "pid"])
def test_stiffness_is_that_of_the_position_and_leaves_damping(tmp_path, name):
    """The force of a position is halved, and that of a speed is what it was."""
    actuator, _ = SOME[name]
    robot = small_robot(tmp_path, MODEL % ("", actuator))

    def parts(model):
        data, found = mujoco.MjData(model), []
        for position, rate in ((0.1, 0.0), (0.0, 0.3)):
            data.qpos[0], data.qvel[0] = position, rate
            mujoco.mj_forward(model, data)
            found.append(data.actuator_force[0])
        return np.array(found)

    soft = parts(build_model(robot, [Actuator(stiffness=0.5).change]).model)
    np.testing.assert_allclose(soft, parts(build_model(robot).model) * [0.5, 1.0], rtol=1e-12)


@pytest.mark.parametrize("change", [Body(body="hand", payload=1.0), Body(mass=3.0)])
@pytest.mark.parametrize("name", ["muscle", "muscle with a force"])
def test_a_muscle_pulls_as_it_did_whatever_it_carries(tmp_path, change, name):
    actuator, control = SOME[name]
    robot = small_robot(tmp_path, MODEL % ("", actuator))
    loaded = build_model(robot, [change.change]).model
    np.testing.assert_array_equal(forces(loaded, control), forces(build_model(robot).model, control))
    assert loaded.dof_invweight0[0] < small_model(tmp_path, MODEL % ("", actuator)).model.dof_invweight0[0]


def test_a_bracket_is_a_letter_like_others(tmp_path):
    two = '<motor name="leg1" joint="h"/><motor name="leg[1]" joint="h"/>'
    changed = build_model(
        small_robot(tmp_path, MODEL % ("", two)), [Actuator(actuator="leg[1]", strength=0.0).change]
    )
    np.testing.assert_array_equal(changed.model.actuator_gainprm[:, 0], [1.0, 0.0])
