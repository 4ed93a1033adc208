"""The vehicle: what it sees and how it rolls, by hand; its three circuits against lesions and plain rules."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from seeds import changed, measured, run_seeds

from circuitkit import check, compile_circuit, load_circuit
from circuitkit.engine import run

RADIUS_M, TRACK_M = 0.03, 0.14
MEMBERS = 32
FORWARD, BACKWARD, NEAR_M = 6.0, -2.0, 0.3  # of the avoider
STEERING = 16 * math.pi / 8  # [rad/s]: `turn` times the first harmonic of the resting bump


class Wheels:
    """Turns both wheels at constant speeds."""

    name = "wheels"
    observations = ("speed",)
    commands = ("wheel_left", "wheel_right")

    def __init__(self, left, right):
        self.speeds = np.array([left, right])

    def reset(self, batch):
        """Keep nothing."""

    def step(self, observation):
        return np.tile(self.speeds, (len(observation), 1))


class Rule(Wheels):
    """The plain rule: turns away from the nearer side while something is near, at the avoider's speeds."""

    observations = ("distance_left", "distance_right")

    def __init__(self):
        """Keep nothing."""

    def step(self, observation):
        left, right = observation.T
        near = np.minimum(left, right) < NEAR_M
        right_wheel = np.where(near & (left < right), BACKWARD, FORWARD)
        left_wheel = np.where(near & (left >= right), BACKWARD, FORWARD)
        return np.stack([left_wheel, right_wheel], axis=1)


class Integrator(Wheels):
    """A number in the place of the ring, with the ring's steering."""

    observations = ("turn_rate",)

    def __init__(self):
        """Wait for the reset."""

    def reset(self, batch):
        self.heading = np.zeros(batch)

    def step(self, observation):
        self.heading = self.heading + 0.01 * observation[:, 0]
        steer = STEERING * np.sin(self.heading)
        return np.stack([1 + steer, 1 - steer], axis=1)


def bump(outputs):
    """Direction and length of the population vector; shape (T, B, 32) to (T, B)."""
    vector = (outputs * np.exp(2j * np.pi * np.arange(MEMBERS) / MEMBERS)).mean(axis=-1)
    return np.unwrap(np.angle(vector), axis=0), np.abs(vector)


def turned(recording):
    """How far the vehicle has turned since the start; shape (T, B)."""
    heading = np.unwrap(recording.channel("heading"), axis=0)
    return heading - heading[0]


@pytest.mark.parametrize("name", ["light_seeker", "heading_keeper"])
def test_the_circuits_have_no_errors_and_no_warnings(name):
    assert check(name) == ((), ())


@pytest.mark.parametrize(("left", "right"), [(6.0, 6.0), (3.0, 6.0), (-2.0, 6.0), (2.0, 0.0)])
def test_it_rolls_as_its_wheels_do(left, right):
    """Speed r (l + r) / 2 and rate r (r - l) / track; a wheel slips and lags a little."""
    calm = changed("vehicle_avoids", (), duration=2.0)
    found = run_seeds(calm, [0], Wheels(left, right))
    heading = turned(found)[:, 0]
    assert (heading[-1] - heading[99]) / 1.0 == pytest.approx(RADIUS_M * (right - left) / TRACK_M, rel=0.06)
    speed = found.channel("speed")[150:, 0].mean()
    assert speed == pytest.approx(RADIUS_M * abs(left + right) / 2, rel=0.05)


@pytest.fixture(scope="module")
def sought():
    return run_seeds("vehicle_seeks_light")


def test_light_falls_with_the_square_of_the_distance_and_the_cosine_of_incidence(sought):
    """At the start and at the end it stands."""
    model = sought.robot.model
    data = mujoco.MjData(model)
    for tick in (0, -1):
        data.qpos[:] = sought.qpos[tick, 0]
        mujoco.mj_forward(model, data)
        for side in ("left", "right"):
            to_lamp = data.body("lamp").xpos - data.site(f"eye_{side}").xpos
            axis = data.site(f"eye_{side}").xmat.reshape(3, 3)[:, 0]
            distance = np.linalg.norm(to_lamp)
            expected = max(0.0, axis @ to_lamp / distance) / distance**2
            assert sought.channel(f"light_{side}")[tick, 0] == pytest.approx(expected, rel=1e-3, abs=1e-9)


# ------------------------------------------------------------------------------------------------ avoids


def test_twenty_of_twenty_drive_for_a_minute_and_are_never_stuck():
    found = run_seeds("vehicle_avoids")
    assert measured(found, "survived").all()
    assert measured(found, "stuck_s").max() < 0.05
    assert measured(found, "path").min() > 9.0
    assert measured(found, "touched_s").max() < 0.1


def test_without_sight_it_ends_at_a_wall():
    blind = changed("vehicle_avoids", silenced=("near_left", "near_right"), duration=20.0)
    found = run_seeds(blind, range(5))
    assert measured(found, "stuck_s").min() > 3


def test_without_the_choice_of_a_side_it_dithers_in_corners():
    """Braitenberg's bare vehicle 3b, and a rule without memory."""
    pair = ("near_left -> near_right", "near_right -> near_left")
    bare = run_seeds(changed("vehicle_avoids", silenced=pair), range(5))
    assert measured(bare, "survived").sum() <= 3
    assert np.median(measured(bare, "path")) < 6.0
    rule = run_seeds("vehicle_avoids", range(5), Rule())
    assert measured(rule, "survived").sum() <= 3


# ------------------------------------------------------------------------------------------------ seeks light


def test_an_eye_settles_at_its_share_of_the_light():
    program = compile_circuit(load_circuit("light_seeker"))
    far = {"distance_left": 1.0, "distance_right": 1.0}
    half, dim = 3.0, 0.05
    for left, right in ((0.05, 0.02), (0.5, 0.4), (6.0, 1.0), (0.0, 0.0)):
        given = far | {"light_left": left, "light_right": right}
        inputs = np.tile([given[name] for name in program.input_names], (200, 1, 1))
        found = run(program, inputs)
        p_left, p_right = left / (half + left), right / (half + right)
        for side, own in (("left", p_left), ("right", p_right)):
            at = program.neuron_names.index(f"eye_{side}")
            expected = own / (dim + p_left + p_right)
            assert found.output[-1, 0, at] == pytest.approx(expected, abs=1e-3)


def test_twenty_of_twenty_end_at_the_lamp(sought):
    assert measured(sought, "survived").all()
    np.testing.assert_allclose(measured(sought, "lamp_distance_m"), 0.18, atol=0.01)
    assert measured(sought, "arrival_s").max() < 30
    assert measured(sought, "touched_s").max() == 0
    assert np.ptp(sought.channel("y")[0]) > 1.5
    assert np.ptp(sought.channel("heading")[0]) > 5  # they start everywhere, in all directions


@pytest.mark.parametrize(
    ("silenced", "arrive"),
    [
        (("eye_left", "eye_right"), 0),
        (("photo_left -> eye_right", "photo_right -> eye_left"), 0),
        (("avoid.near_left", "avoid.near_right"), 3),
    ],
    ids=["blind", "eyes that do not compare", "nothing is near"],
)
def test_each_part_is_needed(silenced, arrive):
    found = run_seeds(changed("vehicle_seeks_light", silenced=silenced, duration=40.0), range(5))
    assert measured(found, "survived").sum() <= arrive


# ------------------------------------------------------------------------------------------------ heading


@pytest.mark.parametrize("rate", [-4.0, -0.3, 0.05, 1.0, 4.0])
def test_the_bump_moves_just_as_fast_as_the_vehicle_turns(rate):
    program = compile_circuit(load_circuit("heading_keeper"))
    found = run(program, np.full((1000, 1, 1), rate), record=["compass"])
    direction, _ = bump(found.output)
    assert direction[-1, 0] - direction[99, 0] == pytest.approx(rate * 9.0, rel=0.005)


def test_the_bump_rests_where_it_is():
    program = compile_circuit(load_circuit("heading_keeper"))
    direction, length = bump(run(program, np.zeros((6000, 1, 1)), record=["compass"]).output)
    assert abs(direction[-1, 0]) < math.radians(0.1)
    assert length[-1, 0] == pytest.approx(math.pi / 8, rel=0.01)  # X / 4 with X = pi / 2


@pytest.fixture(scope="module")
def kept():
    return run_seeds("vehicle_keeps_heading")


def test_twenty_of_twenty_come_back_to_their_heading(kept):
    assert measured(kept, "survived").all()
    error = np.degrees(measured(kept, "heading_error"))
    assert error.max() < 6
    assert np.median(error) < 2
    assert np.degrees(np.ptp(turned(kept), axis=0)).min() > 170  # the twists were strong


def test_the_compass_knows_the_heading_all_the_time(kept):
    first = kept.trace_names.index("compass[0]")
    direction, _ = bump(kept.trace[:, :, first : first + MEMBERS])
    assert np.degrees(np.abs(direction - turned(kept))).max() < 7


def test_it_goes_where_the_goal_is():
    found = run_seeds("vehicle_keeps_heading", range(5), settings={"goal": "90 deg"})
    error = np.degrees(turned(found)[-1]) - 90
    assert np.abs((error + 180) % 360 - 180).max() < 6


@pytest.mark.parametrize("silenced", [("steer_left", "steer_right"), ("shift_left", "shift_right")])
def test_without_steering_or_without_a_moving_bump_it_stays_turned(silenced):
    found = run_seeds(changed("vehicle_keeps_heading", silenced=silenced), range(3))
    assert np.degrees(measured(found, "heading_error")).min() > 90


def test_a_plain_integrator_does_as_well(kept):
    found = run_seeds("vehicle_keeps_heading", range(5), Integrator())
    assert measured(found, "survived").all()
    plain, ring = (np.degrees(measured(r, "heading_error"))[:5].mean() for r in (found, kept))
    assert ring == pytest.approx(plain, abs=1.0)
