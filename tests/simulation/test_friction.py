"""Friction of chosen bodies: what slides does so by its coefficient; all else of a contact stays."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from small_robots import run, small_robot

from circuitkit.base.errors import InputError
from circuitkit.robots import build_model
from circuitkit.simulation.disturbances.body import Body
from circuitkit.simulation.disturbances.slope import Slope
from circuitkit.simulation.friction import _partners, _surfaces, rub

# A block on a floor, and gravity that pulls it along as on a slope.
BLOCK = """
<mujoco>
  <option timestep="0.002" gravity="2 0 -9.81" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" {floor}/>
    <body name="b" pos="0 0 .1"><freejoint/>
      <geom name="g" type="box" size=".1 .1 .1" mass="1" {block}/></body>
    {more}
  </worldbody>
  {end}
</mujoco>
"""
READ = {"v": {"unit": "m/s", "is": "velocity(b, x)"}}
PAIR = '<contact><pair geom1="floor" geom2="g"/></contact>'


def block(folder, floor="", body="", more="", end=""):
    mjcf = BLOCK.format(floor=floor, block=body, more=more, end=end)
    return small_robot(folder, mjcf, channels=READ)


@pytest.mark.parametrize(
    ("floor", "body", "end"),
    [
        ("", "", ""),
        ("", "", PAIR),
        ('priority="1"', "", ""),
        ("", 'priority="2"', ""),
        ('priority="1" friction=".7"', 'solref=".01 1"', ""),
        ('solref=".005 1" condim="4" friction=".7 .01 .001"', 'solref=".01 1"', ""),
    ],
)
@pytest.mark.parametrize("name", ["b", "*"])
@pytest.mark.parametrize("friction", [0.01, 0.1])
def test_what_slides_is_slowed_by_its_friction(tmp_path, floor, body, end, name, friction):
    """a = 2 m/s^2 - mu g."""
    found = run(block(tmp_path, floor, body, end=end), disturbances=[Body(body=name, friction=friction)])
    v = found.channel("v")[:, 0]
    assert (v[-1] - v[9]) / 0.4 == pytest.approx(2 - friction * 9.81, abs=0.01)


@pytest.mark.parametrize(
    ("floor", "body", "end"),
    [
        ('solref="0.5 1"', "", ""),
        ('priority="1"', "", ""),
        ("", "", PAIR),
        ('solref="0.5 1" friction=".2"', 'friction="1"', ""),
        ('solref="0.5 1" priority="3" friction="1 .1 .1" condim="6"', 'friction="1"', ""),
    ],
)
@pytest.mark.parametrize("name", ["b", "*"])
def test_the_friction_that_it_has_changes_no_bit(tmp_path, floor, body, end, name):
    robot = block(tmp_path, floor, body, end=end)
    same = run(robot, disturbances=[Body(body=name, friction=1.0)])
    np.testing.assert_array_equal(same.qpos, run(robot).qpos)


@pytest.mark.parametrize(
    ("floor", "body"),
    [
        (
            'solref=".3 .7" solimp=".8 .9 .01 .5 2" solmix="3" friction=".6 .02 .003" condim="4"',
            'solref=".1 .5" solimp=".7 .9 .02 .5 2" friction=".5 .01 .004" condim="6"',
        ),
        ('solref=".3 .7" solmix="0"', 'solref=".1 .5" solmix="0"'),
        ('solref=".3 .7" solmix="0"', 'solref=".1 .5"'),
        ('solref=".3 .7"', 'solref=".1 .5" solmix="0"'),
        ('solref=".3 .7" solmix="1e-15"', 'solref=".1 .5" solmix="1e-16"'),
        ('solref=".3 .7" solmix="1e-15"', 'solref=".1 .5" solmix="1e-15"'),
        ('solref="-900 -70"', 'solref=".1 .5"'),
        ('solref=".3 .7"', 'solref="-900 -50"'),
        ('solref="0 0"', 'solref=".1 .5"'),
        ('solref=".3 .7"', 'solref="0 0"'),
        ('solref=".3 .7" priority="2" condim="4" friction=".6 .02 .003"', 'solref=".1 .5" condim="6"'),
        ('solref=".3 .7" condim="6"', 'solref=".1 .5" priority="2" condim="4" friction=".6 .02 .003"'),
    ],
)  # fmt: skip
@pytest.mark.parametrize("friction", [0.05, 3.0])
def test_a_contact_is_the_same_but_for_its_sliding_friction(tmp_path, floor, body, friction):
    """Softness, rolling and number of dimensions of a mixture of two surfaces, as MuJoCo mixes them."""
    robot = block(tmp_path, floor=floor, body=body)
    contacts = []
    for changes in ([], [Body(body="b", friction=friction).change]):
        model = build_model(robot, changes).model
        data = mujoco.MjData(model)
        data.qpos[2] = 0.099
        mujoco.mj_forward(model, data)
        contacts.append(data.contact)
    plain, changed = contacts
    assert len(plain) == 4
    np.testing.assert_array_equal(changed.dim, plain.dim)
    np.testing.assert_allclose(changed.solref, plain.solref, rtol=1e-14)
    np.testing.assert_allclose(changed.solimp, plain.solimp, rtol=1e-14)
    np.testing.assert_array_equal(changed.friction[:, 2:], plain.friction[:, 2:])
    np.testing.assert_array_equal(changed.friction[:, :2], friction)


# Spheres that all overlap: of the world, of bodies welded to it and to each other, of parents and children.
CROWD = """
<mujoco>
  <option>{flag}</option>
  <default><geom size=".2"/></default>
  <worldbody>
    <geom name="w1"/><geom name="w2" pos=".01 0 0"/>
    <body name="fixed"><geom name="f" pos="0 .01 0"/>
      <body name="arm"><joint/><geom name="arm" pos="0 0 .01"/></body></body>
    <body name="a"><freejoint/><geom name="a1" pos=".02 0 0"/><geom name="a2" pos="0 .02 0"/>
      <body name="glued"><geom name="g" pos="0 0 .02"/>
        <body name="c"><joint/><geom name="c" pos=".03 0 0"/></body></body>
      <body name="child"><joint/><geom name="child" pos="0 .03 0"/>
        <body name="grand"><joint/><geom name="grand" pos="0 0 .03"/></body></body></body>
    <body name="o"><freejoint/><geom name="o1" contype="2" conaffinity="0" pos=".04 0 0"/>
      <geom name="o2" contype="0" conaffinity="3" pos="0 .04 0"/></body>
    <body name="p"><freejoint/><geom name="p1" contype="4" conaffinity="2" pos="0 0 .04"/></body>
  </worldbody>
  <contact><exclude body1="o" body2="a"/><exclude body1="arm" body2="c"/><pair geom1="f" geom2="c"/></contact>
</mujoco>
"""


@pytest.mark.parametrize("flag", ["", '<flag filterparent="disable"/>'])
def test_surfaces_that_may_touch_are_those_of_which_mujoco_makes_contacts(flag):
    model = mujoco.MjModel.from_xml_string(CROWD.format(flag=flag))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pair = {model.geom("f").id, model.geom("c").id}  # says everything itself
    found = {frozenset(map(int, each)) for each in data.contact.geom} - {frozenset(pair)}
    surfaces = _surfaces(model)
    for number in range(model.ngeom):
        partners = {frozenset((number, k)) for k in _partners(model, surfaces, number)}
        assert partners == {each for each in found if number in each}, model.geom(number).name


def test_the_friction_of_everything_is_that_of_cloth_too():
    cloth = (
        '<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" mass="1" radius=".01"/>'
    )
    model = mujoco.MjModel.from_xml_string(
        CROWD.format(flag="").replace("<worldbody>", f"<worldbody>{cloth}")
    )
    before = model.flex_friction.copy(), model.geom_friction.copy()
    rub(model, None, 0.3)
    for found, old in zip((model.flex_friction, model.geom_friction), before, strict=True):
        np.testing.assert_array_equal(found[:, 0], 0.3)
        np.testing.assert_array_equal(found[:, 1:], old[:, 1:])
    np.testing.assert_array_equal(model.pair_friction[0], [0.3, 0.3, 0.005, 0.0001, 0.0001])
    names = [each.name for each in _surfaces(model)]
    assert names[-1] == "cloth"
    assert len(names) - 1 in set(_partners(model, _surfaces(model), names.index("w1")))


def test_a_block_may_slide_beside_a_cloth(tmp_path):
    cloth = (
        '<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" mass="1" pos="0 3 1"/>'
    )
    found = run(block(tmp_path, more=cloth), disturbances=[Body(body="b", friction=0.1)])
    v = found.channel("v")[:, 0]
    assert (v[-1] - v[9]) / 0.4 == pytest.approx(2 - 0.1 * 9.81, abs=0.01)


SECOND = (
    '<body name="bb" pos="0 1 .1"><freejoint/><geom name="h" type="box" size=".1 .1 .1" mass="1" {}/></body>'
)


def test_a_pair_of_other_bodies_keeps_its_friction(tmp_path):
    pairs = '<contact><pair geom1="floor" geom2="g"/><pair geom1="floor" geom2="h"/></contact>'
    robot = block(tmp_path, more=SECOND.format(""), end=pairs)
    model = build_model(robot, [Body(body="b", friction=0.1).change]).model
    np.testing.assert_array_equal(model.pair_friction[:, 0], [0.1, 1.0])
    np.testing.assert_array_equal(model.pair_friction[:, 1:3], [[0.1, 0.005], [1.0, 0.005]])


def test_other_bodies_keep_their_friction(tmp_path):
    robot = block(tmp_path, more=SECOND.format(""))
    moved = run(robot, disturbances=[Body(body="b", friction=0.01)]).qpos[-1, 0]
    assert moved[0] > 0.1
    assert abs(moved[7]) < 1e-3


def test_bodies_that_change_together_need_not_outdo_each_other(tmp_path):
    """Two hard blocks on a soft floor with less friction than both get: the larger of two is theirs."""
    robot = block(tmp_path, floor='solref="0.5 1" friction=".1"', more=SECOND.format(""))
    model = build_model(robot, [Body(body="b*", friction=0.15).change]).model
    np.testing.assert_array_equal(model.geom_friction[:, 0], [0.1, 0.15, 0.15])
    assert not model.geom_priority.any()


def test_a_friction_that_would_change_more_is_refused(tmp_path):
    """The floor is soft and the other block is not: the block cannot have both its mixtures at once."""
    robot = block(tmp_path, floor='solref="0.5 1"', more=SECOND.format(""))
    with pytest.raises(InputError) as caught:
        run(robot, disturbances=[Body(body="b", friction=0.1)])
    assert str(caught.value).endswith(
        "disturbances[0].body.friction: 'g' meets 'floor' and 'h' each in its own way (condim, solref, "
        "solimp, or torsional and rolling friction), so that a friction below theirs cannot be set for it "
        'alone; allowed: a <pair> of the MJCF for what meets, or the friction of all, body: "*"'
    )
    run(robot, disturbances=[Body(body="b", friction=1.5)], duration_s=0.1)  # more is just the larger of two
    first = block(tmp_path, floor='priority="1" solref="0.5 1"', more=SECOND.format(""))
    same = run(first, disturbances=[Body(body="b", friction=1.0)], duration_s=0.1)
    np.testing.assert_array_equal(same.qpos, run(first, duration_s=0.1).qpos)
    apart = block(tmp_path, floor='solref="0.5 1"', more=SECOND.format('contype="2" conaffinity="2"'))
    run(apart, disturbances=[Body(body="b", friction=0.1)], duration_s=0.1)


@pytest.mark.parametrize("gravity", ["0 -9.81 0", "2 0 -9.81", "0 0 9.81"])
def test_a_slope_needs_to_know_what_is_down(tmp_path, gravity):
    mjcf = BLOCK.format(floor="", block="", more="", end="").replace("2 0 -9.81", gravity)
    with pytest.raises(InputError) as caught:
        run(small_robot(tmp_path, mjcf, channels=READ), disturbances=[Slope(forward=0.1)])
    assert str(caught.value).endswith(
        f"disturbances[0].slope: the MJCF's gravity is {gravity} m/s^2; allowed: gravity along -z, or "
        "none; a slope turns it from there"
    )
