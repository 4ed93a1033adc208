"""Sensor channels and centres of pressure, worked out cell by cell and moment by moment."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walking import NAO_LEG_JOINTS, nao, nao_body

from circuitkit.base.errors import UnknownNameError, listing
from circuitkit.biped.gait import LEG_JOINTS
from circuitkit.biped.sensing import centre_of_pressure, total_centre_of_pressure
from circuitkit.robots import Observer

LAYOUT = nao_body().layout
CHANNELS = nao().channels
CELLS = {  # Aldebaran, from the ankle, in metres; the ankles stand at y = 0.05 and -0.05
    "LFsrFL": (0.07025, 0.0299),
    "LFsrFR": (0.07025, -0.0231),
    "LFsrRL": (-0.03025, 0.0299),
    "LFsrRR": (-0.02965, -0.0191),
    "RFsrFL": (0.07025, 0.0231),
    "RFsrFR": (0.07025, -0.0299),
    "RFsrRL": (-0.03025, 0.0191),
    "RFsrRR": (-0.02965, -0.0299),
}
loads = st.lists(st.floats(0.5, 25), min_size=8, max_size=8)


def readings(cells=None, batch=1, **parts):
    """Sensor readings with the given cells and parts; the rest is random."""
    values = np.random.default_rng(3).normal(size=(batch, LAYOUT.total))
    if cells is not None:
        values[:, LAYOUT.forces] = cells
    for name, value in parts.items():
        values[:, getattr(LAYOUT, name)] = value
    return values


def observe(values, *names):
    return Observer(CHANNELS, names)(values)


def test_the_layout_is_the_order_of_the_models_sensors():
    model = nao().model
    places = {
        "com": LAYOUT.com,
        "com_velocity": LAYOUT.com_velocity,
        "gyro": LAYOUT.gyro,
        "accelerometer": LAYOUT.accelerometer,
        "torso_up": LAYOUT.torso_up,
        "torso_position": LAYOUT.torso,
        "left_wrench": LAYOUT.wrench(0),
        "right_wrench": LAYOUT.wrench(1),
        "l_ankle_position": LAYOUT.foot(0),
        "r_ankle_position": LAYOUT.foot(1),
    }
    places |= {name: slice(i, i + 1) for i, name in enumerate(CELLS)}
    angles = LAYOUT.leg_joints.start
    places |= {f"{role}_angle": slice(angles + i, angles + i + 1) for i, role in enumerate(LEG_JOINTS)}
    assert model.nsensor == len(places)
    assert model.nsensordata == LAYOUT.total
    for name, place in places.items():
        sensor = model.sensor(f"biped {name}")
        assert (place.start, place.stop) == (sensor.adr[0], sensor.adr[0] + sensor.dim[0])
    assert LAYOUT.cells == tuple(CELLS)


@given(loads)
def test_zmp_is_the_mean_of_the_cells_weighted_by_their_load(cells):
    zmp_x = sum(f * x for f, (x, _) in zip(cells, CELLS.values(), strict=True)) / sum(cells)
    sideways = [y + (0.05 if name[0] == "L" else -0.05) for name, (_, y) in CELLS.items()]
    zmp_y = sum(f * y for f, y in zip(cells, sideways, strict=True)) / sum(cells)
    left, right = sum(cells[:4]), sum(cells[4:])
    found = observe(readings(cells), "zmp_x", "zmp_y", "force_difference", "load")
    expected = [zmp_x, zmp_y, (left - right) / (left + right), left + right]
    np.testing.assert_allclose(found, [expected], rtol=1e-12, atol=1e-15)


@given(loads)
def test_left_and_right_are_mirror_images(cells):
    """Swap each cell with its mirror image: LFsrFL with RFsrFR and so on."""
    mirrored = [cells[i] for i in (5, 4, 7, 6, 1, 0, 3, 2)]
    (zmp_x, zmp_y, difference), (other_x, other_y, other) = (
        observe(readings(values), "zmp_x", "zmp_y", "force_difference")[0] for values in (cells, mirrored)
    )
    assert other == pytest.approx(-difference, abs=1e-12)
    assert other_y == pytest.approx(-zmp_y, abs=1e-12)
    assert other_x == pytest.approx(zmp_x, abs=0.0006)  # the rear cells stand 0.6 mm apart as published


def test_in_the_air_the_zmp_is_in_the_middle():
    found = observe(readings(np.zeros(8)), "zmp_x", "zmp_y", "force_difference", "load")
    np.testing.assert_array_equal(found, 0.0)


@pytest.mark.parametrize(
    ("name", "part", "axis", "unit"),
    [
        ("gyro_x", "gyro", 0, "rad/s"),
        ("gyro_z", "gyro", 2, "rad/s"),
        ("acceleration_y", "accelerometer", 1, "m/s^2"),
        ("com_velocity_y", "com_velocity", 1, "m/s"),
        ("tilt_x", "torso_up", 0, "1"),
        ("tilt_y", "torso_up", 1, "1"),
        ("com_z", "com", 2, "m"),
        ("left_ankle_roll", "leg_joints", LEG_JOINTS.index("left_ankle_roll"), "rad"),
        ("right_hip_pitch", "leg_joints", LEG_JOINTS.index("right_hip_pitch"), "rad"),
    ],
)
def test_plain_channels_are_one_reading(name, part, axis, unit):
    values = readings()
    assert observe(values, name)[0, 0] == values[0, getattr(LAYOUT, part)][axis]
    assert CHANNELS[name].unit.symbol == unit


def test_the_com_is_seen_from_the_middle_between_the_ankles_wherever_they_are():
    """A turned-away, striding robot: everything moved along leaves it as it is."""
    values = readings()
    com, (left, right) = values[0, LAYOUT.com], (values[0, LAYOUT.foot(side)] for side in (0, 1))
    found = observe(values, "com_x", "com_y", "feet_x", "feet_y", "feet_z")[0]
    np.testing.assert_allclose(found, [*(com - (left + right) / 2)[:2], *(left - right)], atol=1e-15)
    for place in (LAYOUT.com, LAYOUT.foot(0), LAYOUT.foot(1)):
        values[:, place] += [3.0, -2.0, 0.0]
    np.testing.assert_allclose(
        observe(values, "com_x", "com_y", "feet_x", "feet_y", "feet_z")[0], found, atol=1e-14
    )


def test_the_legs_joints_are_as_the_simulation_has_them():
    robot, data = nao_body(), mujoco.MjData(nao().model)
    data.qpos[robot.qpos_index] = np.linspace(-0.3, 0.3, len(robot.qpos_index))
    mujoco.mj_forward(robot.model, data)
    expected = [data.joint(name).qpos[0] for name in NAO_LEG_JOINTS]
    np.testing.assert_array_equal(observe(data.sensordata[None], *LEG_JOINTS)[0], expected)
    assert len(set(expected)) == len(LEG_JOINTS)


def test_channels_are_those_of_the_robot_in_the_order_asked_for():
    observer = Observer(CHANNELS, ["load", "zmp_y"])
    assert observer.names == ("load", "zmp_y")
    assert [CHANNELS[name].unit.symbol for name in observer.names] == ["N", "m"]
    assert Observer(CHANNELS, [])(readings(batch=2)).shape == (2, 0)


def test_an_unknown_channel():
    with pytest.raises(UnknownNameError) as caught:
        Observer(CHANNELS, ["zmp"])
    assert str(caught.value) == (
        f"unknown channel 'zmp'; allowed: {listing(CHANNELS)}; did you mean 'zmp_x'?"
    )


@pytest.mark.parametrize("names", [("zmp_y", "force_difference"), tuple(CHANNELS)])
def test_a_robot_reads_the_same_alone_and_in_a_batch(names):
    values = np.random.default_rng(5).uniform(0, 25, (7, LAYOUT.total))
    together = observe(values, *names)
    for i in range(7):
        np.testing.assert_array_equal(observe(values[i : i + 1], *names)[0], together[i])


def test_a_missing_cell_is_missed_by_the_channels_that_need_it_and_by_no_other():
    values = readings(np.full(8, 5.0), batch=3)
    whole = observe(values, *CHANNELS)
    values[1, 2] = np.nan
    found = Observer(CHANNELS, tuple(CHANNELS)).where_some_are_missing(values)
    need = [name in {"zmp_x", "zmp_y", "force_difference", "load", LAYOUT.cells[2]} for name in CHANNELS]
    np.testing.assert_array_equal(np.isnan(found[1]), need)
    np.testing.assert_array_equal(found[1, ~np.array(need)], whole[1, ~np.array(need)])
    np.testing.assert_array_equal(found[[0, 2]], whole[[0, 2]])


# --- centre of pressure -------------------------------------------------------------------------------------

points = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))


def wrench_about(point, *forces):
    """Force, moment and point of attack of several forces on the ground, taken about one point."""
    total, moment = np.zeros(3), np.zeros(3)
    for at, force in forces:
        total += force
        moment += np.cross(np.subtract([*at, 0.0], [*point, 0.0]), force)
    return np.concatenate([total, moment, [*point, 0.0]])


@given(points, points, st.floats(1, 60), st.floats(-20, 20), st.floats(-20, 20))
def test_a_single_force_has_its_centre_where_it_acts(at, about, up, forward, left):
    values = readings()
    values[:, LAYOUT.wrench(1)] = wrench_about(about, (at, np.array([forward, left, up])))
    point, load = centre_of_pressure(values, LAYOUT, 1)
    np.testing.assert_allclose(point, [at], atol=1e-12)
    assert load[0] == up


def test_two_forces_have_their_centre_between_them():
    values = readings()
    three_to_one = ((0.1, 0.0), np.array([0, 0, 30.0])), ((0.02, 0.04), np.array([0, 0, 10.0]))
    values[:, LAYOUT.wrench(0)] = wrench_about((0.5, -0.5), *three_to_one)
    point, load = centre_of_pressure(values, LAYOUT, 0)
    np.testing.assert_allclose(point, [[0.08, 0.01]], atol=1e-12)
    assert load[0] == 40


def test_a_foot_in_the_air_has_no_centre():
    values = readings()
    values[:, LAYOUT.wrench(0)] = 0.0
    point, load = centre_of_pressure(values, LAYOUT, 0)
    assert np.isnan(point).all()
    assert load[0] == 0


@given(points, points, st.floats(1, 50), st.floats(1, 50))
def test_both_feet_share_the_centre_by_their_load(left_at, right_at, left, right):
    values = readings()
    for side, (at, load) in enumerate(((left_at, left), (right_at, right))):
        values[:, LAYOUT.wrench(side)] = wrench_about((0.0, 0.0), (at, np.array([0.0, 0.0, load])))
    expected = (np.array(left_at) * left + np.array(right_at) * right) / (left + right)
    np.testing.assert_allclose(total_centre_of_pressure(values, LAYOUT), [expected], atol=1e-12)


def test_with_one_foot_in_the_air_the_centre_is_that_of_the_other():
    values = readings(batch=2)
    values[:, LAYOUT.wrench(0)] = 0.0
    values[0, LAYOUT.wrench(1)] = wrench_about((0, 0), ((0.03, -0.06), np.array([1.0, 2.0, 50.0])))
    values[1, LAYOUT.wrench(1)] = 0.0
    total = total_centre_of_pressure(values, LAYOUT)
    np.testing.assert_allclose(total[0], [0.03, -0.06], atol=1e-12)
    assert np.isnan(total[1]).all()


def test_the_wrench_of_a_foot_is_the_sum_of_its_contacts():
    """MuJoCo's own contact forces, one by one, while the robot stands askew.

    Contacts lie a little below the ground, so that their sideways force has a small lever.
    """
    robot = nao_body()
    model, data = robot.model, mujoco.MjData(robot.model)
    data.ctrl[:] = robot.held
    data.qpos[:] = robot.start_qpos
    data.qpos[3:7] = [1.0, 0.004, 0.01, 0.0]
    mujoco.mj_step(model, data, nstep=60)
    mujoco.mj_forward(model, data)
    for side, foot in enumerate(robot.feet_id):
        total, moment, wrench = np.zeros(3), np.zeros(3), np.zeros(6)
        for i, contact in enumerate(data.contact[: data.ncon]):
            if model.geom_bodyid[contact.geom2] == foot:
                mujoco.mj_contactForce(model, data, i, wrench)
                force = contact.frame.reshape(3, 3).T @ wrench[:3]
                total += force
                moment += np.cross(contact.pos, force) + contact.frame.reshape(3, 3).T @ wrench[3:]
        assert total[2] > 5
        point, load = centre_of_pressure(data.sensordata[None], robot.layout, side)
        assert load[0] == pytest.approx(total[2], rel=1e-9)
        np.testing.assert_allclose(point[0], [-moment[1] / total[2], moment[0] / total[2]], atol=2e-4)
        assert data.sensordata[robot.layout.forces][4 * side : 4 * side + 4].sum() == pytest.approx(
            total[2], rel=1e-3
        )
