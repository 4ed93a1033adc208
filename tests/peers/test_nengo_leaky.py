"""Leaky integrators in Nengo: its Lowpass synapse is the leak, exact for an input that is held for a step."""

from __future__ import annotations

import numpy as np
from peers.continuous import (
    LEAKY,
    LEAKY_SHIFT,
    LEAKY_SLOPE,
    LEAKY_START,
    LEAKY_TAU,
    LEAKY_WEIGHTS,
    leaky_inputs,
    states,
)

STEPS = 300


def test_leaky_integrators_do_the_same_in_nengo(nengo):
    values = leaky_inputs(STEPS)
    with nengo.Network() as network:
        u = nengo.Node(lambda t: values[round(t / 1e-3) - 1])
        cells = nengo.Node(size_in=3)
        outputs = nengo.Node(lambda _, v: 1 / (1 + np.exp(-LEAKY_SLOPE * (v - LEAKY_SHIFT))), size_in=3)
        activations = nengo.Node(size_in=3)
        # What is left of the start decays beside what arrives. Nengo's first step shows the start.
        start = nengo.Node(lambda t: LEAKY_START * np.exp(-(t - 1e-3) / LEAKY_TAU))
        nengo.Connection(start, cells, synapse=None)
        nengo.Connection(cells, outputs, synapse=None)
        nengo.Connection(outputs, activations, transform=LEAKY_WEIGHTS, synapse=None)
        nengo.Connection(u, activations[0], transform=1.5, synapse=None)
        for i, tau in enumerate(LEAKY_TAU):
            nengo.Connection(activations[i], cells[i], synapse=nengo.Lowpass(tau))
        probe = nengo.Probe(cells)
    with nengo.Simulator(network, dt=1e-3, progress_bar=False) as simulator:
        simulator.run_steps(STEPS, progress_bar=False)
    ours = states(LEAKY, values)
    found = np.stack([ours[f"{name}.v"] for name in "abc"], axis=1)
    np.testing.assert_allclose(found[:-1], simulator.data[probe][1:], rtol=0, atol=1e-9)
    assert np.ptp(found, axis=0).min() > 0.3
