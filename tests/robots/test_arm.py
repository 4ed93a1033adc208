"""The arm: its statics by hand, the stretch reflex against the tone alone, and whose rhythm it is."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from seeds import changed, disturbances_of, measured, run_seeds

from circuitkit import check
from circuitkit.robots import load_robot
from circuitkit.simulation.disturbances.body import Body
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.disturbances.push import Push

BODY_KG, HEIGHT_M = 75, 1.75  # Winter's fractions give the rest
PAYLOADS_KG = (0.0, 0.25, 0.5, 1.0)


@pytest.fixture(scope="module")
def arm():
    model = mujoco.MjModel.from_xml_path(str(load_robot("arm").mjcf_path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    return model, data


def _torque(arm, angle=0.0, rate=0.0):
    model, data = arm
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[0], data.qvel[0] = angle, rate
    mujoco.mj_forward(model, data)
    return data.qfrc_actuator[0]


def test_the_circuit_has_no_errors_and_no_warnings():
    assert check("stretch_reflex") == ((), ())


def test_the_inertia_is_that_of_a_forearm_and_a_hand(arm):
    """By Winter: forearm 1.6 % of the mass, centre at 43 % of its length, radius of gyration 30.3 %; hand
    0.6 %, 50.6 % and 29.7 %."""
    forearm_kg, forearm_m = 0.016 * BODY_KG, 0.146 * HEIGHT_M
    hand_kg, hand_m = 0.006 * BODY_KG, 0.108 * HEIGHT_M
    forearm = forearm_kg * forearm_m**2 * (0.43**2 + 0.303**2)
    hand = hand_kg * ((forearm_m + 0.506 * hand_m) ** 2 + (0.297 * hand_m) ** 2)
    model, data = arm
    _torque(arm)
    data.qfrc_applied[0] = 1.0
    without = data.qacc[0]
    mujoco.mj_forward(model, data)
    assert 1 / (data.qacc[0] - without) == pytest.approx(forearm + hand, rel=0.01)
    data.qfrc_applied[0] = 0.0


def test_the_tone_holds_a_right_angle_as_a_spring_and_a_damper(arm):
    assert abs(_torque(arm)) < 0.02
    stiffness = -(_torque(arm, angle=1e-3) - _torque(arm, angle=-1e-3)) / 2e-3
    damping = -(_torque(arm, rate=1e-3) - _torque(arm, rate=-1e-3)) / 2e-3
    assert stiffness == pytest.approx(9.2, abs=0.1)
    assert damping == pytest.approx(0.53, abs=0.02)  # and 0.05 of the joint


@pytest.fixture(scope="module")
def held_by_tone():
    return run_seeds("arm_reflex", controller="open_loop")


@pytest.fixture(scope="module")
def held_by_reflex():
    return run_seeds("arm_reflex")


def test_the_tone_alone_yields_as_its_torque_says(arm, held_by_tone):
    """In the end the muscles' torque is the load's: 8 N at 0.35 m, times the cosine of the angle."""
    found = measured(held_by_tone, "held")
    assert np.ptp(np.degrees(found)) < 0.01
    angle = -found.mean()
    assert _torque(arm, angle=angle) == pytest.approx(8 * 0.35 * math.cos(angle), rel=0.01)


def test_the_reflex_halves_the_deflection_and_more(held_by_tone, held_by_reflex):
    for name, share in (("deflection", 0.42), ("held", 0.33)):
        assert (measured(held_by_reflex, name) < share * measured(held_by_tone, name)).all()
    assert np.degrees(measured(held_by_reflex, "deflection")).mean() == pytest.approx(9.5, abs=0.3)
    assert np.degrees(measured(held_by_reflex, "held")).mean() == pytest.approx(6.2, abs=0.2)


def test_the_reflex_is_calm_before_the_load_and_after(held_by_reflex):
    before = held_by_reflex.channel("elbow")[(held_by_reflex.time_s > 0.7) & (held_by_reflex.time_s < 0.9)]
    assert np.degrees(np.abs(before)).mean() < 0.5
    assert (np.degrees(measured(held_by_reflex, "unrest")) < 1.5).all()


@pytest.mark.parametrize("newtons", [2.0, 4.0, 12.0, 16.0])
def test_it_halves_other_loads_too(newtons):
    loads = [
        d.model_copy(update={"force": newtons}) if isinstance(d, Push) else d
        for d in disturbances_of("arm_reflex")
    ]
    scenario = changed("arm_reflex", loads)
    with_reflex, tone = run_seeds(scenario, range(5)), run_seeds(scenario, range(5), "open_loop")
    assert (measured(with_reflex, "deflection") < 0.5 * measured(tone, "deflection")).all()


def test_without_the_sense_of_speed_there_is_clonus():
    found = run_seeds("arm_reflex", range(5), settings={"speed_gain": "0 nA*s"})
    assert (np.degrees(measured(found, "unrest")) > 10).all()


def _with_payload(kilograms, jitter_deg=5.0, **fields):
    rest = [d for d in disturbances_of("arm_rhythm") if not isinstance(d, Body | Jitter)]
    payload = [Body(body="hand", payload=kilograms)] if kilograms else []
    return changed("arm_rhythm", [*rest, *payload, Jitter(joints=math.radians(jitter_deg))], **fields)


def _rises(time_s, angle):
    """Moments at which the angle rises through 0, [s]."""
    rises = np.flatnonzero((angle[:-1] < 0) & (angle[1:] >= 0))
    return time_s[rises] - angle[rises] * np.diff(time_s)[rises] / np.diff(angle)[rises]


def _frequency(recording, robot, since_s=10.0):
    late = recording.time_s > since_s
    moments = _rises(recording.time_s[late], recording.channel("elbow")[late, robot])
    return (len(moments) - 1) / (moments[-1] - moments[0])


def _own_frequency(kilograms):
    """Of the arm with its tone alone, released: half periods of the ring-down."""
    found = run_seeds(_with_payload(kilograms, jitter_deg=15.0, duration=4.0), range(6), "open_loop")
    half_periods = []
    for angle in found.channel("elbow").T:
        if abs(angle[0]) > math.radians(5):
            moments = np.sort(
                np.r_[_rises(found.time_s, angle - angle[-1]), _rises(found.time_s, angle[-1] - angle)]
            )
            half_periods.append(np.diff(moments[:4]).mean())
    return 0.5 / np.mean(half_periods)


def test_the_oscillator_alone_keeps_its_rhythm_whatever_the_arm():
    for kilograms in (0.0, 1.0):
        alone = _with_payload(
            kilograms, duration=30.0, silenced=("feedback -> flexor", "feedback -> extensor")
        )
        assert _frequency(run_seeds(alone, [0]), 0) == pytest.approx(1.002, abs=0.002)


def test_with_feedback_it_takes_over_the_frequency_of_the_arm():
    """Hatsopoulos and Warren 1996, of people; Williamson 1998, of a robot's arm."""
    found = []
    for kilograms in PAYLOADS_KG:
        own, fed = _own_frequency(kilograms), run_seeds(_with_payload(kilograms, duration=25.0), range(2))
        found.append([own, np.mean([_frequency(fed, robot) for robot in range(2)])])
    own, fed = np.transpose(found)
    np.testing.assert_allclose(own, [1.62, 1.41, 1.26, 1.07], atol=0.03)
    np.testing.assert_allclose(fed, [1.55, 1.43, 1.32, 1.17], atol=0.02)
    np.testing.assert_allclose(fed / own, 1, atol=0.11)
    assert np.polyfit(own, fed, 1)[0] > 0.6


def test_the_measures_say_the_same():
    found = run_seeds("arm_rhythm", range(5))
    assert measured(found, "frequency") == pytest.approx(1.316, abs=0.03)  # counted over 50 s
    assert np.degrees(measured(found, "amplitude")) == pytest.approx(34.4, abs=1.0)
