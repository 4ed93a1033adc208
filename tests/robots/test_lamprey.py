"""The lamprey: its oscillators against the published equations, and what it does in the water."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from circuitkit import compile_circuit, load_circuit, run, simulate
from circuitkit.circuit import check
from circuitkit.control import CircuitController

JOINTS = 10


def published(drive, theta, duration_s):
    """Phases of left and right, and the amplitude, by the equations of Ijspeert et al. 2007 and scipy."""
    lag, weight, a = 2 * math.pi / JOINTS, 10.0, 20.0
    rate, goal = 2 * math.pi * (0.2 * drive + 0.3), 0.065 * drive + 0.196

    def change(_, state):
        phase, (r, growth) = state[:-2].reshape(2, JOINTS), state[-2:]
        turn = np.full_like(phase, rate)
        turn[:, 1:] += weight * np.sin(phase[:, :-1] - phase[:, 1:] - lag)
        turn[:, :-1] += weight * np.sin(phase[:, 1:] - phase[:, :-1] + lag)
        turn += weight * np.sin(phase[::-1] - phase - math.pi)
        return [*turn.ravel(), growth, a * (a / 4 * (goal - r) - growth)]

    start = [*theta, 0.0, 0.0]
    return solve_ivp(change, (0, duration_s), start, rtol=1e-9, atol=1e-9, dense_output=True).sol


def phases(program, states):
    """Of left and right in a row; shape (20,)."""
    rows = [
        program.state_names.index(f"{side}[{i}].theta") for side in ("left", "right") for i in range(JOINTS)
    ]
    return states[..., rows]


@pytest.mark.parametrize("name", ["lamprey", "lamprey_stretch"])
def test_there_are_no_errors_and_no_warnings(name):
    assert check(name) == ((), ())


@pytest.mark.parametrize("drive", [1, 3, 5])
def test_the_oscillators_follow_the_published_equations(drive):
    program = compile_circuit(load_circuit("lamprey", {"drive": drive, "substeps": 50}))
    trace = run(program, np.zeros((500, 1, 0)), states=True)
    theta = phases(program, program.initial_state(1).states[0])
    solution = published(drive, theta, 5.0)((np.arange(500) + 1) * program.step_s)
    np.testing.assert_allclose(phases(program, trace.states[:, 0]), solution[:-2].T, atol=0.02)
    amplitude = trace.output[:, 0, program.neuron_index["amplitude_left"]]
    np.testing.assert_allclose(amplitude, solution[-2], atol=0.01)


def test_from_any_start_one_wave_lies_along_the_body_and_the_sides_alternate():
    for seed in range(5):
        program = compile_circuit(load_circuit("lamprey", {"seed": seed}))
        trace = run(program, np.zeros((1000, 1, 0)), states=True)
        theta = phases(program, trace.states[-1, 0]).reshape(2, JOINTS) / (2 * math.pi)
        np.testing.assert_allclose((theta[:, :-1] - theta[:, 1:] + 0.5) % 1 - 0.5, 0.1, atol=1e-3)
        np.testing.assert_allclose((theta[0] - theta[1]) % 1, 0.5, atol=1e-3)


@pytest.mark.parametrize("drive", [0.9, 5.1])
def test_outside_the_drives_of_swimming_it_lies_still(drive):
    program = compile_circuit(load_circuit("lamprey", {"drive": drive}))
    assert not run(program, np.zeros((300, 1, 0))).readout[-1].any()


def test_speed_and_frequency_rise_with_the_drive_and_the_lag_stays():
    measured = [simulate("lamprey_swims", settings={"drive": str(drive)}).measures for drive in (1, 3, 5)]
    speeds = [each["speed"] for each in measured]
    np.testing.assert_allclose(speeds, [0.081, 0.187, 0.277], rtol=0.03)
    np.testing.assert_allclose([each["frequency"] for each in measured], [0.5, 0.9, 1.3], rtol=0.03)
    np.testing.assert_allclose([each["phase_lag"] for each in measured], 0.1, rtol=0.03)


def test_without_a_wave_it_is_slower():
    silenced = ("left -> left", "right -> right")
    alone = simulate("lamprey_swims", controller=CircuitController("lamprey", silenced=silenced))
    assert alone.measures["speed"] < 0.1  # 0.187 m/s with the wave


@pytest.mark.parametrize("seed", [0, 1])
def test_it_holds_its_course_in_a_current(seed):
    measures = simulate("lamprey_current", seed=seed).measures
    assert measures["drift"] < 0.3
    assert abs(measures["carried"]) < 0.01
    assert measures["ahead"] > 6


def test_without_stretch_or_without_steering_it_is_carried_away():
    """Seed 0; over 20 seeds 0.21 m with all, 0.97 m with the eye alone, 3.6 m without steering."""
    blind = simulate("lamprey_current", controller=CircuitController("lamprey"))
    eye = CircuitController("lamprey_stretch", silenced=("stretch", "turning"))
    swinging = simulate("lamprey_current", controller=eye)
    assert blind.measures["drift"] > 2
    assert 0.5 < swinging.measures["drift"] < 1.5
