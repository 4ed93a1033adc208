"""A NAO that only stands is pushed: what the page says of it."""

from __future__ import annotations

import numpy as np
import pytest
from seeds import changed, measured

from circuitkit.biped.sensing import BipedView
from circuitkit.control import load_controller
from circuitkit.simulation import RunSpec, load_scenario, make_plan, simulate
from circuitkit.simulation.loop import run_loop
from circuitkit.simulation.scenario import parse_push, with_push


@pytest.mark.parametrize(
    ("force", "circuit", "stands"),
    [
        ("18N", "binn_lateral_tuned", 6),
        ("20N", "binn_lateral_capture_tuned", 6),
        ("24N", "binn_lateral_capture_tuned", 0),
    ],
)
def test_what_the_table_says_of_pushes_for_200_ms(force, circuit, stands):
    shipped = load_scenario("nao_stands")
    pushed = with_push(shipped, parse_push(f"{force},200ms,left", shipped))
    plan = make_plan(changed("nao_stands", pushed, duration=6.0), circuit)
    specs = [RunSpec(seed, plan.scenario.befalling) for seed in range(6)]
    recording = run_loop(plan.setup(plan.controller("circuit"), specs))
    assert measured(recording, "survived").sum() == stands


def test_unpushed_it_stands_still_with_the_zmp_between_the_feet():
    result = simulate("nao_stands", controller="open_loop", push="0.001N,100ms,left")
    pressure = BipedView(result.recording).centre_of_pressure_m[300:, 0]
    assert np.abs(pressure[:, 1]).max() < 0.002
    np.testing.assert_allclose(pressure[:, 0].mean(), 0.0257, atol=0.001)
    assert np.abs(result.recording.channel("gyro_x")[400:]).max() < 0.02


def test_what_the_page_says_of_trembling():
    """The PD trembles before the push and after a weak one; half its gain, open loop and networks do not."""

    def unrest(controller, force):
        push, circuit = f"{force},200ms,left", "binn_lateral_capture_tuned"
        found = simulate("nao_stands", controller=controller, circuit=circuit, push=push).measures
        return tuple(np.degrees(found[name]) for name in ("unrest_before", "unrest"))

    assert unrest("dcm_ankle", "20N") == pytest.approx((2.4, 0.04), rel=0.1)
    assert unrest("dcm_ankle", "5N") == pytest.approx((2.4, 1.15), rel=0.1)
    assert max(unrest("circuit", "20N")) < 0.05
    half = load_controller("dcm_ankle", {"lateral.proportional": "6 rad/m"})
    assert max(unrest(half, "5N")) < 0.05


@pytest.mark.parametrize("controller", ["circuit", "dcm_ankle", "mpc_full"])
def test_after_a_push_it_comes_to_rest_and_stays_at_rest_to_the_end(controller):
    """The last second is as quiet as the one before; a body that falls turns by 45 deg/s and more."""
    result = simulate(
        "nao_stands", controller=controller, circuit="binn_lateral_capture_tuned", push="10N,200ms,left"
    )
    turning = np.degrees(result.recording.channel("gyro_x")[:, 0])
    assert np.abs(turning[700:]).max() < np.abs(turning[600:700]).max() + 0.1
    assert np.abs(turning[700:]).max() < 1.0
