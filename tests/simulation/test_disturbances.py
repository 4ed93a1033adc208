"""Every kind of disturbance on small robots: impulses, levers, statistics of noise, faults tick by tick."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_robots import CART, CART_FILE, PUCK, PUCK_FILE, Told, run, small_robot

from circuitkit.base.errors import InputError
from circuitkit.simulation import RunSpec, Scenario, make_plan
from circuitkit.simulation.disturbances.actuator import Actuator
from circuitkit.simulation.disturbances.body import Body
from circuitkit.simulation.disturbances.current import Current
from circuitkit.simulation.disturbances.delay import Delay
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.disturbances.move import Move
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.disturbances.slope import Slope
from circuitkit.simulation.loop import run_loop

GRAVITY = 9.81
INERTIA = 2 / 3 * np.array([0.2**2 + 0.05**2, 0.1**2 + 0.05**2, 0.1**2 + 0.2**2])  # of a box of 2 kg


@pytest.fixture(scope="module")
def puck(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("puck"), PUCK, **PUCK_FILE)


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("cart"), CART, **CART_FILE)


def read(robot, *disturbances, channels=("place",), **more):
    """What the controller read at every tick, and what was true then; shapes (T, B, k)."""
    told = Told(channels, **({"force": 3.0} if "force" in robot.commands else {}))
    recording = run(robot, told, disturbances, **more)
    true = np.stack([recording.channel(name) for name in channels], axis=-1)
    return recording.observations[1:], true[:-1]


def velocity(recording, robot=0):
    return np.array([recording.channel(f"v{x}")[-1, robot] for x in "xyz"])


def spin(recording, robot=0):
    return np.array([recording.channel(f"w{x}")[-1, robot] for x in "xyz"])


# --- pushes -------------------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None)
@given(
    force=st.floats(0.1, 30), duration=st.floats(0.001, 0.3), start=st.floats(0, 0.15),
    direction=st.sampled_from(["forward", "left", "down", "30 deg", "-2 rad"]),
)  # fmt: skip
def test_a_push_gives_its_impulse_over_the_mass_whenever_it_starts_and_ends(
    puck, force, duration, start, direction
):
    push = Push(body="puck", force=force, direction=direction, duration=duration, start=start)
    angle = {"30 deg": math.radians(30), "-2 rad": -2.0}.get(direction)
    way = {"forward": [1, 0, 0], "left": [0, 1, 0], "down": [0, 0, -1]}.get(direction)
    way = [math.cos(angle), math.sin(angle), 0] if way is None else way
    recording = run(puck, disturbances=[push])
    np.testing.assert_allclose(
        velocity(recording), force * duration / 2 * np.array(way), rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(spin(recording), 0, atol=1e-12)
    assert recording.push_n[:, 0].sum() * 0.01 == pytest.approx(force * duration)


def test_channels_are_one_time_step_older_than_positions_whatever_the_control_step(tmp_path):
    """From rest under F = m a: v = a t, and semi-implicit Euler's x = a t (t + dt) / 2.

    Row k ends at (k + 1) steps; the controller reads in its next step what is recorded, and first the start.
    """
    rate, mass = 4.0, 2.0
    for dt, step_s in ((0.001, 0.01), (0.005, 0.005), (0.002, 0.02)):
        robot = small_robot(tmp_path, PUCK, timestep=f"{dt} s", **PUCK_FILE)
        push = Push(body="puck", force=rate * mass, direction="forward", duration=9.0, start=0.0)
        recording = run(robot, Told(["vx"]), [push], duration_s=20 * step_s, step_s=step_s)
        ends = recording.time_s
        np.testing.assert_allclose(ends, np.arange(1, 21) * step_s)
        seen = ends - dt
        np.testing.assert_allclose(recording.channel("vx")[:, 0], rate * seen, atol=1e-12)
        np.testing.assert_allclose(recording.channel("x")[:, 0], rate * seen * (seen + dt) / 2, atol=1e-12)
        np.testing.assert_allclose(recording.qpos[:, 0, 0], rate * ends * (ends + dt) / 2, atol=1e-12)
        read = recording.observations[:, 0, 0]
        np.testing.assert_array_equal(read, [0.0, *recording.channel("vx")[:-1, 0]])


@pytest.mark.parametrize("at", [(0.1, 0.0, 0.0), (0.0, -0.2, 0.05), (0.05, 0.1, -0.02)])
@pytest.mark.parametrize("direction", ["forward", "left", "up"])
def test_a_push_at_a_point_turns_by_r_times_f(puck, at, direction):
    """L = (r x F) t, and w = L / I for so short a push that nothing has turned yet."""
    push = Push(body="puck", force=0.2, direction=direction, duration=0.02, at=at, start=0.0)
    recording = run(puck, disturbances=[push], duration_s=0.03)
    way = {"forward": [1, 0, 0], "left": [0, 1, 0], "up": [0, 0, 1]}[direction]
    np.testing.assert_allclose(
        spin(recording), np.cross(at, way) * 0.2 * 0.02 / INERTIA, rtol=1e-3, atol=1e-5
    )
    np.testing.assert_allclose(velocity(recording), np.array(way) * 0.2 * 0.02 / 2, atol=1e-9)


def test_a_height_is_a_point_above(puck):
    """As long as the body is upright: the point of `at` turns with it, that of `height` does not."""
    pushes = [
        Push(body="puck", force=2.0, direction="left", duration=0.01, start=0.1, **where)
        for where in ({"height": 0.03}, {"at": (0.0, 0.0, 0.03)})
    ]
    one, two = (run(puck, disturbances=[push]) for push in pushes)
    assert np.abs(spin(one)).max() > 1e-3
    np.testing.assert_array_equal(one.qpos, two.qpos)


def turned(folder, degrees):
    """The puck, turned to the left."""
    body = f'<body name="puck" euler="0 0 {degrees}">'
    return small_robot(folder, PUCK.replace('<body name="puck">', body), **PUCK_FILE)


@pytest.mark.parametrize("degrees", [90.0, 210.0])
def test_a_point_is_one_of_the_body_however_it_stands(tmp_path, degrees):
    """In the body's frame r = (0.1, 0.05, 0) and F goes up, so w = (r x F) t / I there."""
    push = Push(body="puck", force=0.2, direction="up", duration=0.02, at=(0.1, 0.05, 0.0), start=0.0)
    recording = run(turned(tmp_path, degrees), disturbances=[push], duration_s=0.03)
    own = np.array([0.05, -0.1, 0.0]) * 0.2 * 0.02 / INERTIA
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    expected = [c * own[0] - s * own[1], s * own[0] + c * own[1], 0.0]
    np.testing.assert_allclose(spin(recording), expected, rtol=1e-3, atol=1e-5)


def test_a_body_that_is_pulled_at_a_point_swings_like_a_pendulum(tmp_path):
    """I a'' = -F r sin a about its centre of mass: after half a period it is turned to the other side."""
    pull, away, angle = 2.0, 0.1, 10.0
    period = 2 * math.pi * math.sqrt(INERTIA[2] / (pull * away)) * (1 + math.radians(angle) ** 2 / 16)
    push = Push(body="puck", force=pull, direction="forward", duration=9.0, at=(away, 0, 0), start=0.0)
    recordings = [
        run(
            turned(tmp_path / "one", angle),
            disturbances=[push],
            step_s=0.002,
            duration_s=period / 2,
            seeds=seeds,
        )
        for seeds in ((0,), (3, 4))
    ]
    w, x, y, z = recordings[0].qpos[-1, 0, 3:]
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    assert math.degrees(yaw) == pytest.approx(-angle, rel=0.01)
    assert spin(recordings[0])[2] == pytest.approx(0.0, abs=0.01)
    np.testing.assert_array_equal(recordings[1].qpos[:, 1], recordings[0].qpos[:, 0])


def test_a_torque_turns_about_its_direction_and_moves_nothing(puck):
    push = Push(body="puck", torque=0.01, direction="up", duration=0.1, start=0.1)
    recording = run(puck, disturbances=[push])
    np.testing.assert_allclose(spin(recording), [0, 0, 0.01 * 0.1 / INERTIA[2]], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(velocity(recording), 0, atol=1e-12)


def test_pushes_on_one_body_add_up_and_each_robot_has_its_own_seed(puck):
    pushes = [
        Push(body="puck", force=3.0, direction=way, duration=0.1, start=0.05) for way in ("forward", "left")
    ]
    recording = run(puck, disturbances=[Jitter(start=0.03), *pushes], seeds=(1, 2))
    for robot in (0, 1):
        np.testing.assert_allclose(velocity(recording, robot), [0.15, 0.15, 0], rtol=1e-6, atol=1e-12)
    windows = recording.effects.windows_s
    assert windows[0, 0] != windows[1, 0]
    assert (np.abs(windows[:, 0] - 0.05) <= 0.03).all()


def test_a_push_that_begins_before_the_start_begins_at_the_start(puck):
    push = Push(body="puck", force=3.0, direction="forward", duration=0.1, start=0.0)
    for seed in range(5):
        recording = run(puck, disturbances=[Jitter(start=0.05), push], seeds=(seed,))
        np.testing.assert_allclose(velocity(recording), [0.15, 0, 0], rtol=1e-6, atol=1e-12)


# --- noise --------------------------------------------------------------------------------------------------


def noise_of(cart, *noises, channels=("place", "twice"), seeds=range(8), **more):
    seen, true = read(cart, *noises, channels=channels, seeds=tuple(seeds), duration_s=4.0, **more)
    return seen - true


def test_noise_is_white_with_its_deviation_and_its_own_in_each_robot(cart):
    noise = noise_of(cart, Noise(channel="place", std="2 mm"), channels=("place",))[..., 0]
    assert noise.std() == pytest.approx(0.002, rel=0.05)
    assert abs(noise.mean()) < 0.0002
    np.testing.assert_allclose(np.corrcoef(noise.T) - np.eye(8), 0, atol=0.2)
    assert abs((noise[1:] * noise[:-1]).mean() / noise.var()) < 0.08


def test_noise_in_a_sensor_is_in_all_that_is_computed_from_it(cart):
    """Twice the place is computed from the same sensor; noise in itself is its own."""
    noise = noise_of(cart, Noise(channel="place", std="1 mm"))
    np.testing.assert_allclose(noise[..., 1], 2 * noise[..., 0], atol=1e-15)
    own = noise_of(cart, Noise(channel="twice", std="1 mm"))
    assert not own[..., 0].any()
    assert own[..., 1].std() == pytest.approx(0.001, rel=0.05)


def test_drift_keeps_its_deviation_and_forgets_with_its_time_constant(cart):
    """An Ornstein-Uhlenbeck process: correlation exp(-lag / tau)."""
    noise = noise_of(
        cart, Noise(channel="place", std="1 mm", drift=0.1), channels=("place",), seeds=range(40)
    )[..., 0]
    assert noise.std() == pytest.approx(0.001, rel=0.08)
    for lag in (1, 5, 10):
        found = (noise[lag:] * noise[:-lag]).mean() / noise.var()
        assert found == pytest.approx(math.exp(-lag * 0.01 / 0.1), abs=0.06)


def test_noise_has_its_time(cart):
    seen, true = read(cart, Noise(channel="place", std="1 mm", start=0.1, duration=0.2))
    noisy = np.flatnonzero((seen != true).any(axis=(1, 2))) + 1  # the first tick has no reading before
    np.testing.assert_array_equal(noisy, np.arange(10, 30))


def test_noise_in_a_sensor_of_the_mjcf_that_is_no_channel(cart):
    """A pattern that means no channel may be a sensor's name; the pole's angle is not touched."""
    noise = noise_of(cart, Noise(channel="rail", std="1 mm"), seeds=(0,), channels=("place", "angle"))
    assert not noise.any()  # the channels read sensors of their own


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ({"place": "1 mm", "pl*": "2 mm"}, "of 'place', by 'place' and by 'pl*'"),
        ({"twice": "1 mm", "t*": "2 mm"}, "of 'twice', by 'twice' and by 't*'"),
        ({"rail": "1 mm", "rail*": "2 mm"}, "of 'rail again', by 'rail' and by 'rail*'"),
    ],
)  # fmt: skip
def test_two_deviations_of_one_reading_are_refused(tmp_path, names, said):
    """Of a channel that is a sensor, of a computed one, and of a sensor of the MJCF that a channel reads."""
    again = {"unit": "m", "is": "sensor(rail)"}
    robot = small_robot(tmp_path, CART, channels={**CART_FILE["channels"], "rail again": again})
    with pytest.raises(InputError) as caught:
        run(robot, Told(["place"]), [Noise(std=names)])
    assert str(caught.value) == (
        f"disturbances[0].noise.std: found two deviations {said}; allowed: one in each noise; noises of "
        "their own add up"
    )


def test_noises_of_their_own_add_up(cart):
    """Independent ones: their variances do."""
    both = [Noise(channel="place", std="3 mm"), Noise(channel="pl*", std="4 mm")]
    assert noise_of(cart, *both, channels=("place",)).std() == pytest.approx(0.005, rel=0.05)


@pytest.mark.parametrize("channel", ["place", "pl*", "twice", "t*", "rail"])
def test_noise_and_spikes_have_the_unit_of_every_channel_and_sensor_that_they_change(cart, channel):
    """Also where nobody reads it; of a sensor that is no channel, by its type."""
    what = {"pl*": "channel 'place'", "t*": "channel 'twice'", "rail": "sensor 'rail'"}
    has = f"found '5 N', and the {what.get(channel, f'channel {channel!r}')} has 'm'; allowed: a unit like it"
    for wrong, key in (
        (Noise(channel=channel, std="5 N"), "noise.std"),
        (Fault(channel=channel, reading="spike", value="5 N"), "fault.value"),
    ):
        for reader in (Told(["place", "twice"]), Told(force=0.0)):
            with pytest.raises(InputError) as caught:
                run(cart, reader, [wrong])
            assert str(caught.value) == f"disturbances[0].{key}: {has}"
    run(cart, Told(["place"]), [Noise(channel=channel, std="5 mm")])
    run(cart, Told(["place"]), [Fault(channel="felt", reading="spike", value="5 m/s^2")])


def test_a_pattern_over_channels_of_several_units_takes_none(cart):
    with pytest.raises(InputError, match=r"found '1 m', and the channel 'speed' has 'm/s'; allowed: a unit"):
        run(cart, Told(["place"]), [Fault(channel="*p*", reading="spike", value="1 m")])


def test_where_mujoco_knows_no_unit_of_a_sensor_any_fits(tmp_path):
    robot = small_robot(tmp_path, CART.replace("<sensor>", '<sensor><user name="own" dim="1"/>'), **CART_FILE)
    run(robot, Told(["place"]), [Noise(channel="own", std="5 N")])


def test_a_range_clips_what_is_read_and_not_what_is(tmp_path):
    place = {"unit": "m", "is": "joint(slide)", "range": ["-1 mm", "2 mm"]}
    robot = small_robot(tmp_path, CART, channels={**CART_FILE["channels"], "place": place})
    recording = run(robot, Told(["place"]), [Noise(channel="place", std="10 mm")])
    assert recording.observations.min() == -0.001
    assert recording.observations.max() == 0.002
    assert not recording.channel("place").any()


# --- faults -------------------------------------------------------------------------------------------------


def test_a_missing_reading_is_no_number_and_neither_is_what_is_computed_from_it(cart):
    seen, true = read(cart, Fault(channel="place", reading="missing", start=0.1, duration=0.05),
                      channels=("place", "twice", "speed"))  # fmt: skip
    seen, true = seen[:, 0], true[:, 0]
    missing = np.isnan(seen)
    np.testing.assert_array_equal(np.flatnonzero(missing[:, 0]) + 1, np.arange(10, 15))
    np.testing.assert_array_equal(missing[:, 0], missing[:, 1])
    assert not missing[:, 2].any()
    np.testing.assert_array_equal(seen[~missing], true[~missing])


@pytest.mark.parametrize("channel", ["place", "twice"])
def test_zero_stuck_and_spike(cart, channel):
    """Of a channel that is a sensor, and of one that is computed."""
    span = {"channel": channel, "start": 0.2, "duration": 0.1}
    inside = slice(19, 29)  # ticks 20 to 29; the first tick has no reading before
    for reading, change in (
        ("zero", np.zeros_like),
        ("stuck", lambda true: np.broadcast_to(true[:1], true.shape)),
        ("spike", lambda true: true + 0.05),
    ):
        seen, true = read(
            cart,
            Fault(reading=reading, **span, **({"value": "5 cm"} if reading == "spike" else {})),
            channels=(channel,),
        )
        np.testing.assert_allclose(seen[inside], change(true[inside]), atol=1e-15)
        outside = np.ones(len(true), dtype=bool)
        outside[inside] = False
        np.testing.assert_array_equal(seen[outside], true[outside])
        assert np.ptp(true[inside]) > 1e-4


@settings(max_examples=40)
@given(start_ms=st.integers(0, 180), duration_ms=st.integers(1, 60))
def test_a_fault_is_in_the_control_steps_that_begin_in_its_time(cart, start_ms, duration_ms):
    fault = Fault(channel="place", reading="missing", start=start_ms / 1e3, duration=duration_ms / 1e3)
    expected = [tick for tick in range(20) if start_ms <= 10 * tick < start_ms + duration_ms]
    if not expected:
        with pytest.raises(
            InputError, match=r"in which no control step of 0\.01 s begins; allowed: at least one"
        ):
            read(cart, fault, duration_s=0.2)
        return
    controller = Told(("place",), force=3.0)
    run(cart, controller, [fault], duration_s=0.2)
    missing = np.isnan(np.array(controller.seen)[:, 0, 0])
    np.testing.assert_array_equal(np.flatnonzero(missing), expected)


def test_what_outlasts_the_run_needs_no_memory_beyond_it(puck):
    """1 N for 0.2 s on 2 kg; the channels are one time step of 1 ms older than the end."""
    push = Push(body="puck", force=1.0, direction="forward", start=0.1, duration=1e12)
    assert velocity(run(puck, disturbances=[push], duration_s=0.3))[0] == pytest.approx(0.199 / 2, rel=1e-9)


def test_dropped_ticks_are_missing_with_their_chance_each_robot_by_itself(cart):
    seen, _ = read(
        cart, Fault(channel="place", reading="dropped", chance=0.3), duration_s=4.0, seeds=tuple(range(6))
    )
    missing = np.isnan(seen[..., 0])
    np.testing.assert_allclose(missing.mean(axis=0), 0.3, atol=0.09)
    assert missing.mean() == pytest.approx(0.3, abs=0.04)
    np.testing.assert_allclose(np.corrcoef(missing.T) - np.eye(6), 0, atol=0.2)


def test_a_stuck_channel_is_stuck_anew_in_another_run(cart):
    fault = Fault(channel="place", reading="stuck", start=0.2)
    one, two = (read(cart, fault, Noise(channel="place", std="1 mm"), seeds=(seed,))[0] for seed in (1, 2))
    assert len(np.unique(one[19:])) == 1
    assert one[-1] != two[-1]


# --- delay --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ticks", [1, 4])
def test_a_delayed_channel_is_what_it_was_and_at_first_what_it_was_first(cart, ticks):
    seen, true = read(cart, Delay(channel="place", by=ticks * 0.01), channels=("place", "speed"))
    np.testing.assert_array_equal(seen[ticks:, 0, 0], true[:-ticks, 0, 0])
    np.testing.assert_array_equal(seen[: ticks - 1, 0, 0], 0)
    np.testing.assert_array_equal(seen[:, 0, 1], true[:, 0, 1])


def test_a_delayed_command_arrives_later(cart):
    force = np.where(np.arange(50) < 20, 0.0, 5.0)
    now = run(cart, Told(force=force))
    late = run(cart, Told(force=force), [Delay(command="force", by=0.05)])
    np.testing.assert_array_equal(late.qpos[25:], now.qpos[20:-5])
    assert not late.qpos[:25].any()
    # What is recorded is what reached the robot; what was written is the same so much earlier.
    np.testing.assert_array_equal(late.command("force")[5:, 0], force[:-5])
    np.testing.assert_array_equal(late.columns()["output_force"], late.command("force")[:, 0])
    assert run(cart, Told(force=force), [Delay(channel="*", by=0.05)]).qpos[-1, 0, 0] == now.qpos[-1, 0, 0]


# --- actuators ----------------------------------------------------------------------------------------------


def pulls(cart, *disturbances):
    """The force of the motor in every tick, asked for 4 N."""
    return run(cart, Told(force=4.0), disturbances).channel("pull")[:, 0]


def test_an_actuator_is_weak_for_the_whole_run(cart):
    np.testing.assert_allclose(pulls(cart, Actuator(actuator="motor", strength=0.25)), 1.0)


def test_an_actuator_is_dead_for_a_while(cart):
    found = pulls(cart, Actuator(strength=0.0, start=0.2, duration=0.1))
    np.testing.assert_allclose(found, np.where((np.arange(50) >= 20) & (np.arange(50) < 30), 0.0, 4.0))


def test_spells_of_actuators_overlap_and_leave_nothing_behind(cart):
    found = pulls(
        cart,
        Actuator(strength=0.5),
        Actuator(strength=0.5, start=0.1, duration=0.2),
        Actuator(actuator="m*", strength=0.1, start=0.2, duration=0.2),
    )
    ticks = np.arange(50)
    expected = (
        2.0
        * np.where((ticks >= 10) & (ticks < 30), 0.5, 1.0)
        * np.where((ticks >= 20) & (ticks < 40), 0.1, 1.0)
    )
    np.testing.assert_allclose(found, expected)


def test_a_soft_servo_yields_more_and_keeps_its_damping(tmp_path):
    """A servo that holds a pole against its weight: k times the sag is m g l cos(sag)."""
    mjcf = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
      <body name="arm"><joint name="j" axis="0 1 0" damping="5"/>
      <geom type="sphere" pos="1 0 0" size=".01" mass="1"/></body></worldbody></mujoco>"""
    servos = [{"joints": ["j"], "stiffness": "500 N*m/rad", "damping": "20 N*m*s/rad", "torque": "100 N*m"}]
    robot = small_robot(tmp_path, mjcf, servos=servos, channels={"j": {"unit": "rad", "is": "joint(j)"}})
    sags = [
        run(robot, disturbances=each, duration_s=3.0).channel("j")[-1, 0]
        for each in ([], [Actuator(stiffness=0.5)])
    ]
    for sag, stiffness in zip(sags, (500, 250), strict=True):
        assert stiffness * sag == pytest.approx(GRAVITY * math.cos(sag), rel=1e-3)


# --- bodies, ground, water ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "mass"),
    [
        (Body(), 2.0),
        (Body(mass=1.5), 3.0),
        (Body(body="puck", mass=0.5), 1.0),
        (Body(body="puck", payload=3.0), 5.0),
    ],
)
def test_a_body_has_another_mass(puck, change, mass):
    push = Push(body="puck", force=4.0, direction="forward", duration=0.1, start=0.0)
    recording = run(puck, disturbances=[change, push])
    np.testing.assert_allclose(velocity(recording), [0.4 / mass, 0, 0], rtol=1e-6, atol=1e-12)


def pushed_puck(puck, *disturbances):
    """A plan whose file has these disturbances."""
    scenario = Scenario(
        robot=puck, controller=Told(), control_step=0.01, duration=0.2, disturbances=disturbances
    )
    return make_plan(scenario)


@pytest.mark.parametrize(
    ("filed", "own", "mass"),
    [([], [Body(mass=2.0)], 4.0), ([Body(mass=2.0)], [], 2.0), ([Body(mass=2.0)], [Body(mass=0.5)], 1.0)],
)
def test_the_run_says_what_befalls_the_model_whatever_the_file_of_its_plan_says(puck, filed, own, mass):
    push = Push(body="puck", force=4.0, direction="forward", duration=0.1, start=0.0)
    plan = pushed_puck(puck, push, *filed)
    recording = run_loop(plan.setup(plan.controller(), [RunSpec(0, (push, *own))]))
    assert recording.robot.mass_kg == mass
    np.testing.assert_allclose(velocity(recording), [0.4 / mass, 0, 0], rtol=1e-6, atol=1e-12)


def test_robots_of_one_batch_differ_in_pushes_only(puck):
    plan = pushed_puck(puck)
    specs = [RunSpec(0, (Body(mass=2.0), Slope())), RunSpec(1, (Body(mass=3.0), Slope()))]
    with pytest.raises(InputError, match="robots of one batch differ in body; allowed: in push only"):
        plan.setup(plan.controller(), specs)


BLOCK = """
<mujoco>
  <option timestep="0.002" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 .1" friction="0.6"/>
    <body name="block" pos="0 0 .1"><freejoint/>
      <geom name="cube" type="box" size=".2 .2 .1" mass="2" friction="0.6"/></body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(("body", "friction"), [("*", 0.2), ("block", 0.2), ("block", 0.9)])
def test_a_block_on_a_slope_slides_if_its_friction_is_less_than_the_tangent(tmp_path, body, friction):
    """With a = g (sin - mu cos), downhill; a body's own friction counts, more or less than the floor's."""
    robot = small_robot(tmp_path, BLOCK, channels={"v": {"unit": "m/s", "is": "velocity(block, x)"}})
    angle = math.radians(20)
    found = run(
        robot, disturbances=[Body(body=body, friction=friction), Slope(forward=angle)], duration_s=1.0
    )
    v = found.channel("v")[:, 0]
    acceleration = (v[-1] - v[49]) / 0.5
    expected = -GRAVITY * max(math.sin(angle) - friction * math.cos(angle), 0.0)
    assert acceleration == pytest.approx(expected, abs=0.05)


def test_a_slope_turns_gravity_and_leaves_its_size(puck, tmp_path):
    robot = small_robot(tmp_path, PUCK.replace('gravity="0 0 0"', ""), **PUCK_FILE)
    recording = run(
        robot, disturbances=[Slope(forward=math.radians(10), left=math.radians(-5))], duration_s=0.2
    )
    rise = np.array([math.sin(math.radians(10)), math.sin(math.radians(-5))])
    down = -np.array([*rise, math.sqrt(1 - rise @ rise)])
    np.testing.assert_allclose(
        velocity(recording), GRAVITY * down * 0.199, rtol=1e-9
    )  # sensors are a time step old
    assert not velocity(run(puck, disturbances=[Slope(forward=0.1)])).any()


WATER = PUCK.replace('gravity="0 0 0"', 'gravity="0 0 0" density="1000"')


def test_a_current_carries_what_floats_and_has_its_time(tmp_path):
    robot = small_robot(tmp_path, WATER, **PUCK_FILE)
    along = Current(velocity=(0.5, 0.0, 0.0))
    assert run(robot, disturbances=[along], duration_s=2.0).channel("vx")[-1, 0] > 0.3
    assert not run(robot, duration_s=0.5).channel("vx").any()
    later = run(robot, disturbances=[Current(velocity=(0.5, 0, 0), start=0.2, duration=0.2)], duration_s=1.0)
    v = later.channel("vx")[:, 0]
    assert not v[:20].any()
    assert (np.diff(v[20:40]) > 0).all()
    assert (np.diff(v[41:]) < 0).all()


def test_after_a_gust_the_current_of_the_whole_run_flows_again(tmp_path):
    """A puck that is carried along is slowed by a gust against it, and then carried along again."""
    robot = small_robot(tmp_path, WATER, **PUCK_FILE)
    always, gust = Current(velocity=(0.5, 0, 0)), Current(velocity=(-0.5, 0, 0), start=1.0, duration=0.3)
    v = run(robot, disturbances=[always, gust], duration_s=2.5).channel("vx")[:, 0]
    assert v[128] < v[99]
    assert v[-1] > v[128] + 0.01
    assert run(robot, disturbances=[gust], duration_s=2.5).channel("vx")[-1, 0] < 0


# --- starts and objects -------------------------------------------------------------------------------------


def test_jitter_starts_each_robot_otherwise_and_the_same_seed_the_same(puck):
    jitter = Jitter(velocity=0.1, position=0.2, yaw=0.5)
    recording = run(puck, disturbances=[jitter], seeds=(1, 2, 1), duration_s=0.01)
    first = recording.qpos[0]
    np.testing.assert_array_equal(first[0], first[2])
    assert (first[0, [0, 1, 3, 6]] != first[1, [0, 1, 3, 6]]).all()
    many = run(puck, disturbances=[jitter], seeds=tuple(range(300)), duration_s=0.001, step_s=0.001)
    place = many.qpos[0, :, :2]
    assert np.abs(place).max() <= 0.2 + 0.001
    np.testing.assert_allclose(place.std(axis=0), 0.4 / math.sqrt(12), rtol=0.1)
    speed = np.array([many.channel(f"v{x}")[0] for x in "xyz"])
    np.testing.assert_allclose(speed.std(axis=1), [0.1, 0.1, 0], rtol=0.15)
    yaw = 2 * np.arctan2(many.qpos[0, :, 6], many.qpos[0, :, 3])
    assert np.abs(yaw).max() <= 0.5
    assert yaw.std() == pytest.approx(1.0 / math.sqrt(12), rel=0.1)


def test_jitter_of_joints_and_of_a_base_on_rails(cart):
    many = run(
        cart,
        disturbances=[Jitter(joints=0.1, position=0.3)],
        seeds=tuple(range(200)),
        duration_s=0.002,
        step_s=0.002,
    )
    slide, hinge = many.qpos[0].T
    assert np.abs(slide).max() <= 0.3 + 1e-3
    assert hinge.std() == pytest.approx(0.1, rel=0.15)
    assert hinge.mean() == pytest.approx(0, abs=0.03)


def test_jitter_of_a_base_that_there_is_not(cart):
    with pytest.raises(InputError) as caught:
        run(cart, disturbances=[Jitter(yaw=0.1)])
    assert str(caught.value) == (
        "disturbances[0].jitter.yaw: the robot has no base that can turn; allowed: a jitter of joints"
    )


def test_an_object_is_set_down_and_thrown(puck):
    set_down = run(puck, disturbances=[Move(body="puck", position=(1, 2, 3), start=0.2)])
    np.testing.assert_array_equal(set_down.qpos[19, 0, :3], 0)
    np.testing.assert_array_equal(set_down.qpos[20:, 0, :3], [[1, 2, 3]] * 30)
    thrown = run(puck, disturbances=[Move(body="puck", velocity=(0.1, 0, -0.2), start=0.1)])
    np.testing.assert_allclose(velocity(thrown), [0.1, 0, -0.2], atol=1e-12)
    np.testing.assert_allclose(thrown.qpos[-1, 0, :3], np.array([0.1, 0, -0.2]) * 0.4, atol=1e-9)


def test_a_mocap_body_can_be_set_and_not_thrown(tmp_path):
    mjcf = PUCK.replace(
        "<body",
        '<body mocap="true" name="sign"><geom size=".01" contype="0" conaffinity="0"/></body><body',
        1,
    )
    robot = small_robot(tmp_path, mjcf, channels={"x": {"unit": "m", "is": "position(sign, x)"}})
    place = run(robot, disturbances=[Move(body="sign", position=(1, 0, 0), start=0.2)]).channel("x")[:, 0]
    np.testing.assert_array_equal(place, np.arange(50) >= 20)
    with pytest.raises(InputError, match="'sign' cannot be moved so; allowed: a body with a free joint"):
        run(robot, disturbances=[Move(body="sign", velocity=(1, 0, 0))])


# --- all together -------------------------------------------------------------------------------------------


def test_a_batch_of_n_is_n_single_robots_to_the_bit(cart):
    """With everything that befalls: noise, drift, dropped ticks, delays, faults, pushes, jitter."""
    every = [
        Jitter(joints=0.1, position=0.1, start=0.05),
        Noise(std={"place": "1 mm", "twice": "2 mm", "angle": "1 deg"}),
        Noise(channel="speed", std="1 cm/s", drift=0.1),
        Fault(channel="place", reading="dropped", chance=0.2),
        Fault(channel="angle", reading="stuck", start=0.3, duration=0.1), Delay(channel="speed", by=0.02),
        Delay(command="force", by=0.01),
        Push(body="pole", force=1.0, direction="forward", duration=0.1, start=0.1),
        Actuator(strength=0.5, start=0.2, duration=0.1),
    ]  # fmt: skip
    names, seeds = ["place", "twice", "angle", "speed"], (3, 1, 4, 1, 5)
    batch = run(cart, Told(names, force=2.0), every, seeds=seeds)
    for i, seed in enumerate(seeds):
        alone = run(cart, Told(names, force=2.0), every, seeds=(seed,))
        for name in ("readings", "qpos", "observations", "commands"):
            one, other = getattr(batch, name)[:, i], getattr(alone, name)[:, 0]
            np.testing.assert_array_equal(one.view(np.int64), other.view(np.int64), err_msg=name)
    assert not np.array_equal(batch.qpos[-1, 0], batch.qpos[-1, 2])


# --- what would do nothing ----------------------------------------------------------------------------------

BEGINNING = [
    lambda **when: Actuator(strength=0.0, **when),
    lambda **when: Current(velocity=(1.0, 0.0, 0.0), **when),
    lambda **when: Fault(channel="place", reading="zero", **when),
    lambda **when: Noise(channel="place", std="1 cm", **when),
    lambda **when: Push(body="cart", force=1.0, direction="forward", **{"duration": 0.1, **when}),
]


@pytest.fixture(scope="module")
def swimming(tmp_path_factory):
    water = CART.replace("<option ", '<option density="1000" ')
    return small_robot(tmp_path_factory.mktemp("swimming"), water, **CART_FILE)


@pytest.mark.parametrize("make", BEGINNING)
@pytest.mark.parametrize("start", [1.0, 50.0])
def test_a_disturbance_that_starts_at_the_end_or_later_is_refused(swimming, make, start):
    disturbance = make(start=start)
    with pytest.raises(InputError) as caught:
        run(swimming, Told(("place",), force=0.0), [disturbance], duration_s=1.0)
    assert str(caught.value) == (
        f"disturbances[0].{disturbance.kind}.start: found {start:g} s, and the run ends at 1 s; allowed: a "
        "start before the end; or a longer duration of the run"
    )


@pytest.mark.parametrize("make", BEGINNING[:-1])
@pytest.mark.parametrize(("start", "found"), [(0.001, "0.001 s to 0.003 s"), (0.501, "0.501 s to 0.503 s")])
def test_a_disturbance_that_no_control_step_sees_is_refused(swimming, make, start, found):
    disturbance = make(start=start, duration=0.002)
    with pytest.raises(InputError) as caught:
        run(swimming, Told(("place",), force=0.0), [disturbance], duration_s=1.0, step_s=0.01)
    assert str(caught.value) == (
        f"disturbances[0].{disturbance.kind}.duration: found {found}, in which no control step of 0.01 s "
        "begins; allowed: at least one, such as with a duration of a control step or longer"
    )


def test_a_move_at_the_end_is_refused(puck):
    with pytest.raises(InputError, match=r"disturbances\[0\].move.start: found 2 s, and the run ends at 1 s"):
        run(puck, disturbances=[Move(body="puck", velocity=(1.0, 0.0, 0.0), start=2.0)], duration_s=1.0)


def test_what_starts_with_the_last_tick_acts_in_it_and_after_it_is_refused(cart):
    fault = Fault(channel="place", reading="missing", start=0.99)
    recording = run(cart, Told(("place",), force=1.0), [fault], duration_s=1.0, step_s=0.01)
    assert np.flatnonzero(np.isnan(recording.observations[:, 0, 0])).tolist() == [99]
    with pytest.raises(InputError, match=r"fault.start: found from 0.996 s on, in which no control step"):
        run(cart, Told(("place",)), [fault.model_copy(update={"start": 0.996})], duration_s=1.0, step_s=0.01)


@pytest.mark.parametrize("when", [{}, {"start": 0.1}])
def test_a_current_needs_water_or_air(cart, when):
    with pytest.raises(InputError) as caught:
        run(cart, disturbances=[Current(velocity=(1.0, 0.0, 0.0), **when)])
    assert str(caught.value) == (
        "disturbances[0].current: the MJCF has neither density nor viscosity, so that nothing feels a "
        'current; allowed: an MJCF with <option density="1000" viscosity="0.0009"/> for water, 1.2 and '
        "0.00002 for air"
    )
