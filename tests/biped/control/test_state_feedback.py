"""What the two feedbacks make of what is sensed."""

from __future__ import annotations

import numpy as np
import pytest
from walking import known_of, plan_of

from circuitkit.biped.control.sensed_com import CommandAxis
from circuitkit.biped.control.state_feedback import AngleFeedback, Calibration, ComFeedback

LATERAL = [CommandAxis("lateral")]


@pytest.fixture(scope="module")
def reference():
    return known_of(plan_of(duration=2.5))


def test_the_true_com_is_compared_with_the_walk_as_it_is_known_to_be(reference):
    feedback = ComFeedback(reference, LATERAL, [Calibration(0.03, 0.9)])
    tick = 180
    sensed = [
        0.9 * reference.com_m[tick - 3, 1] + 0.004 - reference.ankles_m[tick, :, 1].mean(),
        0.9 * reference.com_velocity[tick - 3, 1] - 0.02,
        reference.feet_apart_m[tick, 1],
    ]
    position, velocity = feedback.read(tick, np.array([sensed]))
    assert position[0, 0] == pytest.approx(0.004)
    assert velocity[0, 0] == pytest.approx(-0.02)
    further, faster = feedback.correction(
        tick, np.array([sensed]), position - 0.001, velocity + 0.01, velocity
    )
    assert further[0, 0] == pytest.approx(0.001)
    assert faster[0, 0] == pytest.approx(-0.01)


@pytest.fixture(scope="module")
def lagging(reference):
    """Ankles of servos that only lag, theta' = (target - theta) / tau, by many steps of Heun's method."""
    plan = reference.joint_angles(["left_ankle_roll", "right_ankle_roll"])
    fine, tau = 40, reference.body.lag_s[1]
    h = reference.step_s / fine / tau
    angle, angles = plan[0], []
    for target in plan:
        angles.append(angle)
        for _ in range(fine):
            angle = angle + (h - h**2 / 2) * (target - angle)
    return np.array(angles)


def test_a_servo_that_only_lags_is_no_deviation(reference, lagging):
    feedback = AngleFeedback(reference, LATERAL)
    assert feedback.observations == ("left_ankle_roll", "right_ankle_roll")
    none = np.zeros((1, 1))
    shifts = [feedback.correction(tick, row[None], none, none, none)[0] for tick, row in enumerate(lagging)]
    np.testing.assert_allclose(np.array(shifts), 0.0, atol=2e-6)


def test_neither_is_the_lean_that_was_commanded(reference, lagging):
    """A lean that is held comes in like any target: 1 - e^(-t / tau)."""
    feedback = AngleFeedback(reference, LATERAL)
    feedback.reset(1)
    none, lean = np.zeros((1, 1)), np.full((1, 1), 0.02)
    for tick in range(1, 30):
        came = 0.02 * -np.expm1(-tick * reference.step_s / reference.body.lag_s[1])
        shift, _ = feedback.correction(tick, lagging[tick : tick + 1] + came, none, none, lean)
        assert shift[0, 0] == pytest.approx(0.0, abs=2e-6)


def test_an_ankle_that_gives_shifts_the_com_by_eq_3(reference, lagging):
    feedback = AngleFeedback(reference, LATERAL)
    step = reference.footsteps[0]  # the left foot carries
    tick = step.first_tick + 5
    row = lagging[tick]
    moved = row + np.array([0.03, 0.2])  # the foot in the air does not matter
    none = np.zeros((1, 1))
    position, velocity = feedback.correction(tick, moved[None], none, none, none)
    assert position[0, 0] == pytest.approx(
        reference.com_per_lean_m() * (np.sin(moved[0]) - np.sin(row[0])), abs=1e-6
    )
    assert velocity[0, 0] == 0.0


def test_the_com_shifts_by_about_what_was_measured_on_the_robot(reference):
    """0.152 m for each sine of the angle, in a quasi-static trial; the planned walk moves a little more."""
    assert reference.com_per_lean_m() == pytest.approx(0.152, rel=0.1)
