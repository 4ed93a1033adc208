"""Membranes against closed forms, published relations and an independent integrator."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp


def spike_times(
    slope: Callable[[float, np.ndarray], list[float]],
    start: list[float],
    peak: float,
    reset: Callable[[np.ndarray], list[float]],
    end: float,
) -> np.ndarray:
    """Times at which the first variable reaches the peak; it is then reset. Runge-Kutta of scipy, to 1e-9."""

    def reaches(_: float, state: np.ndarray) -> float:
        return state[0] - peak

    reaches.terminal, reaches.direction = True, 1
    times, now, state = [], 0.0, np.array(start)
    while now < end:
        found = solve_ivp(slope, (now, end), state, events=reaches, rtol=1e-9, atol=1e-12)
        if found.t_events[0].size == 0:
            break
        now = float(found.t_events[0][0])
        times.append(now)
        state = np.array(reset(found.y_events[0][0]))
    return np.array(times)


@pytest.mark.parametrize("current_na", [1.6, 2.0, 5.0])
@pytest.mark.parametrize(("refractory_ms", "reset_mv"), [(0, -65), (2, -65), (3.5, -70)])
def test_the_rate_of_the_leaky_integrate_and_fire_neuron(play, alone, current_na, refractory_ms, reset_mv):
    """T = t_ref + tau log((rest + R I - reset) / (rest + R I - threshold)); the spike on the next substep."""
    neuron = f"model: leaky_integrate_and_fire, refractory: {refractory_ms} ms, reset: {reset_mv} mV"
    played = play(alone(neuron, "nA", "0.1 ms"), np.full(3000, current_na * 1e-9))
    driven = -65 + 10 * current_na
    charging_ms = 10 * math.log((driven - reset_mv) / (driven + 50))
    expected_ms = refractory_ms + math.ceil(charging_ms / 0.1) * 0.1
    intervals = np.diff(played.spike_times_s("n")) * 1e3
    assert len(intervals) > 5
    np.testing.assert_allclose(intervals, expected_ms, rtol=1e-9)


def test_below_its_rheobase_the_leaky_integrate_and_fire_neuron_rests(play, alone):
    """At I = (threshold - rest) / R = 1.5 nA the threshold is just not reached."""
    played = play(alone("model: leaky_integrate_and_fire", "nA"), np.full(300, 1.499e-9))
    assert played.spike_times_s("n").size == 0
    potential = -65e-3 + 1e7 * 1.499e-9 * (1 - np.exp(-played.time_s / 0.01))
    np.testing.assert_allclose(played.state["n.v"], potential, rtol=1e-12)


def test_the_number_of_spikes_in_a_control_step_is_its_output(play, alone):
    neuron = "model: leaky_integrate_and_fire, refractory: 0 ms"
    fine = play(alone(neuron, "nA", "0.1 ms"), np.full(1000, 5e-9))
    coarse = play(alone(neuron, "nA", "10 ms", 100), np.full(10, 5e-9))
    np.testing.assert_array_equal(coarse.output["n"], fine.output["n"].reshape(10, 100).sum(axis=1))


@pytest.mark.parametrize("current_na", [0.8, 1.0])
def test_the_adaptive_exponential_neuron_of_brette_and_gerstner(play, alone, current_na):
    """Spike times of the published parameters, from an integration by scipy."""
    c, g, e, vt, dt, tw, a, b = 281e-12, 30e-9, -70.6e-3, -50.4e-3, 2e-3, 0.144, 4e-9, 0.0805e-9
    current = current_na * 1e-9

    def slope(_: float, y: np.ndarray) -> list[float]:
        v, w = y
        upstroke = g * dt * math.exp((v - vt) / dt)
        return [(-g * (v - e) + upstroke - w + current) / c, (a * (v - e) - w) / tw]

    # From -10 mV the upstroke to 20 mV takes less than a nanosecond, too steep for the integrator.
    expected = spike_times(slope, [e, 0], -10e-3, lambda y: [e, y[1] + b], 0.2)
    text = alone("model: adaptive_exponential", "nA", "0.1 ms", 4)
    found = play(text, np.full(2000, current)).spike_times_s("n")
    assert len(expected) > 2
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, atol=len(expected) * 0.2e-3)
    assert np.diff(found)[-1] > 1.5 * np.diff(found)[0]  # it adapts


@pytest.mark.parametrize(("part", "fires"), [(0.99, False), (1.02, True)])
def test_the_rheobase_of_the_exponential_neuron(play, alone, part, fires):
    """Without adaptation I = g_L (V_T - E_L - Delta_T), where the resting point vanishes."""
    rheobase = 30e-9 * (-50.4e-3 + 70.6e-3 - 2e-3)
    text = alone("model: adaptive_exponential, coupling: 0 nS, jump: 0 nA", "nA")
    spikes = play(text, np.full(600, part * rheobase)).spike_times_s("n")
    assert (spikes.size > 0) == fires


def test_the_regular_spiking_neuron_of_izhikevich(play, alone):
    """Spike times at 100 pA of the parameters of chapter 8, from an integration by scipy."""

    def slope(_: float, y: np.ndarray) -> list[float]:  # in ms, mV, pA
        v, u = y
        return [(0.7 * (v + 60) * (v + 40) - u + 100) / 100, 0.03 * (-2 * (v + 60) - u)]

    expected = spike_times(slope, [-60, 0], 35, lambda y: [-50, y[1] + 100], 600)
    found = (
        play(alone("model: izhikevich", "pA", "0.5 ms", 5), np.full(1200, 100e-12)).spike_times_s("n") * 1e3
    )
    assert len(expected) > 5
    assert len(found) == len(expected)
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=1.0)


@pytest.mark.parametrize(("part", "fires"), [(0.98, False), (1.04, True)])
def test_the_rheobase_of_the_regular_spiking_neuron(play, alone, part, fires):
    """I = (b + k (v_t - v_r))^2 / (4 k) = 51.4 pA, where the resting point vanishes."""
    rheobase = (-2 + 0.7 * 20) ** 2 / (4 * 0.7) * 1e-12
    spikes = play(alone("model: izhikevich", "pA", "1 ms", 4), np.full(800, part * rheobase)).spike_times_s(
        "n"
    )
    assert (spikes.size > 0) == fires


def test_the_model_with_units_contains_the_one_of_2003(play, alone):
    """v' = 0.04 v^2 + 5 v + 140 - u + I, u' = a (b v - u), the regular spiking cell of Izhikevich 2003."""

    def slope(_: float, y: np.ndarray) -> list[float]:
        v, u = y
        return [0.04 * v * v + 5 * v + 140 - u + 10, 0.02 * (0.2 * v - u)]

    low, high = ((-5 - math.sqrt(2.6)) / 0.08, (-5 + math.sqrt(2.6)) / 0.08)  # roots of 0.04 v^2 + 5 v + 140
    expected = spike_times(slope, [low, 0.2 * low], 30, lambda y: [-65, y[1] + 8], 400)
    neuron = (
        f"model: izhikevich, capacitance: 1 pF, gain: 0.04 nS/mV, rest: {low} mV, threshold: {high} mV, "
        "peak: 30 mV, reset: -65 mV, rate: 0.02 /ms, coupling: 0.2 nS, jump: 8 pA"
    )
    played = play(alone(neuron, "pA", "0.5 ms", 8), np.full(800, (10 - 0.2 * low) * 1e-12))
    found = played.spike_times_s("n")[: len(expected)] * 1e3
    assert len(found) == len(expected) > 8
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=1.0)


def test_a_conductance_membrane_answers_a_step_exponentially(play, alone):
    """v = rest + I / G (1 - exp(-t G / C)); the output is linear between low and high, and stops there."""
    text = alone("model: conductance, capacitance: 20 nF, drive: 2 nA", "nA")
    played = play(text, np.full(60, 23e-9))
    v = -60e-3 + 25e-3 * (1 - np.exp(-played.time_s / 20e-3))
    np.testing.assert_allclose(played.state["n.v"], v, rtol=1e-12)
    np.testing.assert_allclose(played.output["n"], np.clip((v + 60e-3) / 20e-3, 0, 1), rtol=1e-9)
    assert played.output["n"][-1] == 1.0


SNS = """\
circuit: sns
control_step: 1 ms
timing: ordered
inputs:
  u: {{unit: nA, range: [0 nA, 40 nA]}}
neurons:
  source: {{model: conductance, role: excitatory}}
  target: {{model: conductance, role: excitatory}}
synapses:
  - {{from: u, to: source, weight: 1}}
  - {{from: source, to: target, model: conductance, weight: {weight} nS, reversal: {reversal} mV}}
outputs:
  y: {{unit: "1", readout: {{target: 1}}}}
"""


@pytest.mark.parametrize("gain", [0.2, 0.8, 1.0])
def test_a_transmission_synapse_designed_for_a_gain_has_it(play, gain):
    """g = k R / (E - k R): the source R above rest brings the target k R above rest (R 20 mV, E 194 mV)."""
    weight_ns = 1000 * gain * 20 / (194 - gain * 20)
    played = play(SNS.format(weight=weight_ns, reversal=-60 + 194), np.full(200, 20e-9))
    assert played.state["source.v"][-1] == pytest.approx(-40e-3, abs=1e-9)
    assert played.state["target.v"][-1] == pytest.approx(-60e-3 + gain * 20e-3, abs=1e-7)


def test_the_steady_state_is_the_mean_of_potentials_weighted_by_conductances(play):
    """v = (G E_rest + g E_s + I) / (G + g), also while the source's output is one half."""
    for current_na, opened in ((10, 0.5), (40, 1.0)):
        played = play(SNS.format(weight=400, reversal=-100), np.full(200, current_na * 1e-9))
        expected = (1e-6 * -60e-3 + opened * 0.4e-6 * -100e-3) / (1e-6 + opened * 0.4e-6)
        assert played.state["target.v"][-1] == pytest.approx(expected, rel=1e-9)
