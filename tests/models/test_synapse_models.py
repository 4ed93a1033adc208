"""Synapse models against closed forms and published steady states."""

from __future__ import annotations

import math

import numpy as np
import pytest

CIRCUIT = """\
circuit: one_synapse
control_step: 1 ms
substeps: {substeps}
timing: ordered
inputs:
  u: {{unit: "1", range: [0, 1]}}
  v: {{unit: "1", range: [0, 1]}}
neurons:
  gate: {{model: identity, role: excitatory}}
  n: {{role: excitatory, {neuron}}}
synapses:
  - {{from: v, to: gate, weight: 1}}
  - {{from: u, to: n, {synapse}}}
outputs:
  y: {{unit: "1", readout: {{n: 1}}}}
"""
LINEAR = "model: leaky_linear, tau: 10 ms"


def one(synapse: str, neuron: str = LINEAR, substeps: int = 1) -> str:
    """A circuit in which the input `u` drives `n` by a synapse, and `v` the neuron `gate`."""
    return CIRCUIT.format(substeps=substeps, neuron=neuron, synapse=synapse)


def inputs(u: np.ndarray, v: float = 0.0) -> np.ndarray:
    return np.column_stack((u, np.full(len(u), v)))


@pytest.mark.parametrize("substeps", [1, 5])
def test_a_first_order_synapse_answers_a_step_exponentially(play, substeps):
    """s = w (1 - exp(-t / tau)), delivered one substep later."""
    played = play(
        one("model: first_order, weight: 3, tau: 40 ms", substeps=substeps), inputs(np.full(100, 0.5))
    )
    expected = 1.5 * (1 - np.exp(-played.time_s / 0.04))
    np.testing.assert_allclose(played.state["u -> n.s"], expected, rtol=1e-12)
    late = 1.5 * (1 - np.exp(-(played.time_s - 1e-3 / substeps) / 0.04))
    np.testing.assert_allclose(played.activation["n"], late, rtol=1e-9, atol=1e-15)


def test_an_exponential_synapse_jumps_and_decays(play):
    spikes = np.zeros(60)
    spikes[[5, 20]] = 1
    played = play(one("model: exponential, weight: 2, tau: 8 ms"), inputs(spikes))
    time_ms = np.arange(60)
    expected = sum(np.where(time_ms >= at, 2 * np.exp(-(time_ms - at) / 8), 0) for at in (5, 20))
    np.testing.assert_allclose(played.activation["n"], expected, rtol=1e-12, atol=1e-15)


def test_an_exponential_conductance_drives_to_its_reversal_potential(play):
    spikes = np.zeros(40)
    spikes[3] = 1
    text = one(
        "model: exponential_conductance, weight: 50 nS, tau: 8 ms, reversal: -80 mV", "model: conductance"
    )
    played = play(text, inputs(spikes))
    time_ms = np.arange(40)
    g = np.where(time_ms >= 3, 50e-9 * np.exp(-(time_ms - 3) / 8), 0)
    before = np.concatenate(([-60e-3], played.state["n.v"][:-1]))
    np.testing.assert_allclose(played.activation["n"], g * (-80e-3 - before), rtol=1e-12, atol=1e-25)
    assert -80e-3 < played.state["n.v"].min() < -60e-3


def test_a_gated_synapse_is_the_product(play):
    text = one("model: gated, gate: gate, weight: 2", "model: identity")
    for u, v in ((0.3, 0.7), (0.3, 0.0), (1.0, 1.0)):
        assert play(text, inputs(np.full(2, u), v)).output["n"][-1] == pytest.approx(2 * u * v)


@pytest.mark.parametrize(
    ("use", "depression_s", "facilitation_s"), [(0.5, 0.8, 0.001), (0.1, 0.1, 1.0), (0.3, 0.2, 0.2)]
)
def test_a_regular_train_brings_the_steady_state_of_tsodyks_and_markram(
    play, use, depression_s, facilitation_s
):
    """u = U / (1 - (1 - U) f), x = (1 - d) / (1 - (1 - u) d), with f and d = exp(-T/tau), spikes every T."""
    train = np.zeros(4000)
    train[::50] = 1
    synapse = (
        f"model: depressing_facilitating, weight: 1, use: {use}, tau_depression: {depression_s} s, "
        f"tau_facilitation: {facilitation_s} s, tau: 2 ms"
    )
    delivered = play(one(synapse), inputs(train)).activation["n"]
    f, d = math.exp(-0.05 / facilitation_s), math.exp(-0.05 / depression_s)
    u = use / (1 - (1 - use) * f)
    x = (1 - d) / (1 - (1 - u) * d)
    rest_of_the_last = math.exp(-25)
    assert delivered[0] == pytest.approx(use, rel=1e-12)
    assert delivered[3950] == pytest.approx(u * x, rel=1e-5)
    second = use + use * (1 - use) * f
    assert delivered[50] == pytest.approx(second * (1 - use * d) + use * rest_of_the_last, rel=1e-9)


def test_the_mean_of_many_trains_has_the_same_steady_state(play):
    """u = U (1 + r tau_f) / (1 + U r tau_f), x = 1 / (1 + u r tau_d) at rate r."""
    synapse = (
        "model: depressing_facilitating_rate, weight: 2, use: 0.2, tau_depression: 150 ms, "
        "tau_facilitation: 400 ms, rate: 40 Hz"
    )
    played = play(one(synapse), inputs(np.full(3000, 0.5)))
    u = 0.2 * (1 + 20 * 0.4) / (1 + 0.2 * 20 * 0.4)
    x = 1 / (1 + u * 20 * 0.15)
    assert played.activation["n"][-1] == pytest.approx(2 * u * x * 0.5, rel=1e-6)


def test_a_hebbian_weight_grows_with_the_product_and_stops_at_its_bound(play):
    """w grows by rate * pre * post in a step, here post = 0.5 w pre: by a factor of 1 + 0.02 * 0.5."""
    text = one("model: hebbian, weight: 0.1, rate: 0.02, low: 0, high: 0.6", "model: identity, gain: 0.5")
    w = play(text, inputs(np.ones(300))).state["u -> n.w"]
    np.testing.assert_allclose(w[:100], 0.1 * 1.01 ** np.arange(1, 101), rtol=1e-12)
    assert w.max() == w[-1] == 0.6


def test_a_hebbian_weight_is_forgotten(play):
    text = one("model: hebbian, weight: 0.8, rate: 0.02, decay: 1 %, low: 0, high: 1", "model: identity")
    w = play(text, inputs(np.zeros(100))).state["u -> n.w"]
    np.testing.assert_allclose(w, 0.8 * 0.99 ** np.arange(1, 101), rtol=1e-12)


LEARNING = "weight: 0.1 /mm, rate: 0.02, scale: 1 /mm^2, low: -2 /mm, high: 2 /mm"
OJA = f"""\
circuit: oja
control_step: 10 ms
timing: ordered
inputs:
  u: {{unit: mm, range: [-10 mm, 10 mm]}}
  v: {{unit: mm, range: [-10 mm, 10 mm]}}
neurons:
  n: {{model: identity, role: excitatory}}
synapses:
  - {{from: u, to: n, model: oja, {LEARNING}}}
  - {{from: v, to: n, model: oja, {LEARNING}}}
outputs:
  y: {{unit: "1", readout: {{n: 1}}}}
"""


def test_ojas_weights_become_the_principal_component(play):
    """They converge to the eigenvector of the covariance with the largest eigenvalue, of length one."""
    angle = math.radians(25)
    axes = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    samples = np.random.default_rng(1).normal(size=(3000, 2)) * [1.0, 0.2] @ axes.T
    played = play(OJA, samples * 1e-3)
    w = np.array([played.state["u -> n.w"][-500:].mean(), played.state["v -> n.w"][-500:].mean()]) / 1e3
    _, vectors = np.linalg.eigh(np.cov(samples.T))
    principal = vectors[:, -1] * np.sign(vectors[0, -1])
    assert np.linalg.norm(w) == pytest.approx(1, abs=0.02)
    np.testing.assert_allclose(w, principal, atol=0.03)
