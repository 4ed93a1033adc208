"""Rate neurons with states against closed forms, Matsuoka's conditions, and an independent integrator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp


@pytest.mark.parametrize("substeps", [1, 7])
def test_a_leaky_integrator_answers_a_step_exponentially(play, alone, substeps):
    """Whatever the substep: v = A (1 - exp(-t / tau)), output 1 / (1 + exp(-slope (v - shift)))."""
    text = alone("model: leaky_integrator, tau: 30 ms, slope: 2 /mm, shift: 1 mm", "mm", "10 ms", substeps)
    played = play(text, np.full(20, 0.003))
    v = 0.003 * (1 - np.exp(-played.time_s / 0.03))
    np.testing.assert_allclose(played.state["n.v"], v, rtol=1e-12)
    np.testing.assert_allclose(played.output["n"], 1 / (1 + np.exp(-2000 * (v - 0.001))), rtol=1e-12)


def test_a_leaky_linear_neuron_answers_a_step_exponentially_above_its_threshold(play, alone):
    played = play(
        alone("model: leaky_linear, tau: 50 ms, slope: 0.5 /deg, shift: 2 deg", "deg"), np.full(300, 0.1)
    )
    v = 0.1 * (1 - np.exp(-played.time_s / 0.05))
    slope, shift = 0.5 * 180 / math.pi, math.radians(2)
    np.testing.assert_allclose(played.output["n"], np.maximum(0, slope * (v - shift)), rtol=1e-12)


CTRNN = """\
circuit: ctrnn
control_step: 10 ms
substeps: {substeps}
timing: ordered
inputs:
  u: {{unit: "1", range: [0, 1]}}
neurons:
  a: {{model: leaky_integrator, role: excitatory, tau: 40 ms, shift: 2.5}}
  b: {{model: leaky_integrator, role: inhibitory, tau: 100 ms, shift: 3}}
synapses:
  - {{from: u, to: a, weight: 1}}
  - {{from: a, to: a, weight: 6}}
  - {{from: a, to: b, weight: 6}}
  - {{from: b, to: a, weight: -6}}
outputs:
  y: {{unit: "1", readout: {{a: 1}}}}
"""


def test_a_recurrent_network_converges_to_beers_equations(play):
    """tau dy/dt = -y + sum w sigmoid(y - shift) + I (Beer 1995); the error halves with the substep."""

    def slope(_: float, y: list[float]) -> list[float]:
        a, b = 1 / (1 + math.exp(2.5 - y[0])), 1 / (1 + math.exp(3 - y[1]))
        return [(-y[0] + 6 * a - 6 * b + 1) / 0.04, (-y[1] + 6 * a) / 0.1]

    exact = solve_ivp(slope, (0, 0.5), [0, 0], rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for substeps in (10, 20, 40):
        played = play(CTRNN.format(substeps=substeps), np.ones(50))
        errors.append(np.abs([played.state["a.v"][-1], played.state["b.v"][-1]] - exact).max())
    assert errors[2] < 0.01
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.1)


def half_centre(
    a: float, b: float, first: float = 0.2, seconds: float = 6.0, tau_s: float = 0.05
) -> tuple[str, int]:
    """Matsuoka's pair with T_a = 4 T_r and tonic drive 1, and its number of control steps."""
    taus = f"tau: {tau_s} s, tau_adaptation: {4 * tau_s} s"
    neuron = f"model: matsuoka, role: inhibitory, {taus}, beta: {b}, drive: 1"
    text = f"""\
circuit: half_centre
control_step: 5 ms
timing: ordered
neurons:
  left: {{{neuron}, initial: {{v: {first}}}}}
  right: {{{neuron}}}
synapses:
  - {{from: left, to: right, weight: {-a}}}
  - {{from: right, to: left, weight: {-a}}}
outputs:
  y: {{unit: "1", readout: {{left: 1, right: -1}}}}
"""
    return text, round(seconds / 0.005)


def test_a_half_centre_rests_below_matsuokas_condition(play):
    """a < 1 + T_r/T_a: both come to rest at x = s / (1 + a + b)."""
    text, steps = half_centre(a=1.0, b=2.0)
    played = play(text, np.empty((steps, 0)))
    for side in ("left", "right"):
        assert played.output[side][-1] == pytest.approx(1 / (1 + 1.0 + 2.0), rel=1e-3)


def test_one_side_of_a_half_centre_wins_above_matsuokas_condition(play):
    """a > 1 + b: the winner rests at x = s / (1 + b), the other one is silent."""
    text, steps = half_centre(a=4.0, b=2.0)
    played = play(text, np.empty((steps, 0)))
    assert played.output["left"][-1] == pytest.approx(1 / (1 + 2.0), rel=1e-3)
    assert played.output["right"][-1] == 0.0


def frequency_hz(signal: np.ndarray, step_s: float) -> float:
    """From the upward crossings of zero, interpolated."""
    before, after = signal[:-1], signal[1:]
    at = np.flatnonzero((before < 0) & (after >= 0))
    times = (at - before[at] / (after[at] - before[at])) * step_s
    return float(1 / np.mean(np.diff(times)))


@pytest.mark.parametrize(("a", "b"), [(1.5, 2.5), (2.0, 3.0), (2.5, 2.5)])
def test_a_half_centre_oscillates_between_the_conditions(play, a, b):
    """1 + T_r/T_a < a < 1 + b; about omega = sqrt(((T_r + T_a) b - T_r a) / (T_r a)) / T_a, Matsuoka 2011."""
    text, steps = half_centre(a, b)
    played = play(text, np.empty((steps, 0)))
    second_half = (played.output["left"] - played.output["right"])[steps // 2 :]
    assert second_half.max() > 0.2
    assert second_half.min() < -0.2
    omega = math.sqrt(((0.05 + 0.2) * b - 0.05 * a) / (0.05 * a)) / 0.2
    assert frequency_hz(second_half, 0.005) == pytest.approx(omega / (2 * math.pi), rel=0.15)


def test_at_the_onset_the_frequency_is_that_of_the_linear_pair(play):
    """a = 1 + T_r/T_a: the difference is a harmonic oscillator of omega^2 = (b - T_r/T_a) / (T_r T_a)."""
    rest = 1 / (1 + 1.25 + 2.5)
    text, steps = half_centre(a=1.25, b=2.5, first=rest)
    for side, v in (("left", rest + 0.01), ("right", rest - 0.01)):
        text = text.replace(f"  {side}: {{", f"  {side}: {{initial: {{v: {v}, adaptation: {rest}}}, ", 1)
    text = text.replace(f", initial: {{v: {rest}}}", "")
    played = play(text, np.empty((steps, 0)))
    difference = played.output["left"] - played.output["right"]
    omega = math.sqrt((2.5 - 0.25) / (0.05 * 0.2))
    assert frequency_hz(difference, 0.005) == pytest.approx(omega / (2 * math.pi), rel=1e-3)
    # Neither growing nor fading, up to the fourth-order error of the method.
    assert np.abs(difference[-200:]).max() == pytest.approx(np.abs(difference[:200]).max(), rel=2e-2)
