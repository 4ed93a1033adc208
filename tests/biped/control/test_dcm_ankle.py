"""PD on the DCM error: its equation by hand, its limits, and each robot for itself."""

from __future__ import annotations

import numpy as np
import pytest
from walking import interface_of, known_of, plan_of

from circuitkit.control import load_controller


@pytest.fixture(scope="module")
def reference():
    return known_of(plan_of(duration=2.0))


def build(reference, **changes):
    """The shipped controller, on a robot that keeps its plan exactly, with changes."""
    exact = {"derivative": "0 rad*s/m", "walk_delay": "0 s", "walk_sway": "100 %"}
    spec = load_controller("dcm_ankle", {f"lateral.{key}": value for key, value in (exact | changes).items()})
    return spec.bind(interface_of(reference))


def planned(reference, tick, *, com=0.0, velocity=0.0, batch=1):
    """What a robot exactly on its plan senses, plus an error of the CoM and of its velocity."""
    middle = reference.ankles_m[tick, :, 1].mean()
    row = [
        reference.com_m[tick, 1] - middle + com,
        reference.com_velocity[tick, 1] + velocity,
        reference.feet_apart_m[tick, 1],
    ]
    return np.tile(row, (batch, 1))


def run(controller, rows):
    return np.array([controller.step(row).copy() for row in rows])


def test_on_the_plan_it_adds_nothing(reference):
    controller = build(reference)
    assert (controller.observations, controller.commands) == (
        ("com_y", "com_velocity_y", "feet_y"),
        ("ankle_roll",),
    )
    commands = run(controller, [planned(reference, tick) for tick in range(reference.walk.ticks)])
    np.testing.assert_allclose(commands, 0.0, atol=1e-12)


def test_it_leans_against_the_error_in_proportion(reference):
    controller = build(reference, proportional="5 rad/m", limit="1 rad")
    row = planned(reference, 0, com=0.01, velocity=0.06)
    expected = -5.0 * (0.01 + 0.06 / reference.omega)
    np.testing.assert_allclose(run(controller, [row])[0], expected, rtol=1e-12)


def test_the_rate_counts_from_the_second_reading(reference):
    controller = build(
        reference, proportional="0 rad/m", derivative="0.1 rad*s/m", derivative_filter="0 s", limit="1 rad"
    )
    rows = [planned(reference, 0), planned(reference, 1, com=0.002)]
    np.testing.assert_allclose(run(controller, rows)[:, 0, 0], [0.0, -0.1 * 0.002 / 0.01], atol=1e-12)


def test_the_error_is_from_the_walk_as_the_robot_is_known_to_walk(reference):
    controller = build(reference, walk_delay="40 ms", walk_sway="90 %")
    tick = 150
    controller._tick = tick
    row = planned(reference, tick)
    middle = reference.ankles_m[tick, :, 1].mean()
    row[0, 0] = 0.9 * reference.com_m[tick - 4, 1] - middle
    row[0, 1] = 0.9 * reference.com_velocity[tick - 4, 1]
    np.testing.assert_allclose(run(controller, [row]), 0.0, atol=1e-12)


def test_to_lean_forward_the_ankles_pitch_the_other_way(reference):
    spec = load_controller("dcm_ankle", {"sagittal": {"proportional": "8 rad/m", "limit": "15 deg"}})
    controller = spec.bind(interface_of(reference))
    assert controller.commands == ("ankle_roll", "ankle_pitch")
    assert controller.observations[:2] == ("com_y", "com_x")
    y, vy, fy = planned(reference, 0)[0]
    x = reference.com_m[0, 0] - reference.ankles_m[0, :, 0].mean()
    row = np.array([[y, x + 0.01, vy, reference.com_velocity[0, 0], fy, reference.feet_apart_m[0, 0]]])
    roll, pitch = run(controller, [row])[0, 0]
    assert pitch == pytest.approx(8.0 * 0.01)
    assert abs(roll) < 0.01


def test_it_keeps_within_its_limit(reference):
    controller = build(reference, limit="10 deg")
    assert run(controller, [planned(reference, 0, com=1.0)])[0, 0, 0] == pytest.approx(-np.radians(10))


def test_the_swing_foot_does_not_matter_in_single_support(reference):
    tick = reference.footsteps[0].first_tick + 10
    still = planned(reference, tick)
    astray = still.copy()
    astray[0, 2] += 0.04  # the right foot, in the air, 40 mm further right: the middle moves by 20 mm
    astray[0, 0] += 0.02
    controller = build(reference)
    controller._tick = tick
    np.testing.assert_allclose(run(controller, [astray]), 0.0, atol=1e-12)


def test_a_missing_reading_gives_no_command_and_leaves_others_alone(reference):
    controller = build(reference)
    controller.reset(2)
    rows = [planned(reference, tick, com=0.01 * (tick + 1), batch=2) for tick in range(2)]
    rows[1][0, 0] = np.nan
    commands = run(controller, rows)
    assert np.isnan(commands[1, 0, 0])
    assert commands[1, 1, 0] < commands[0, 1, 0]
