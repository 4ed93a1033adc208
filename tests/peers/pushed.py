"""The BiNN under test: its graph in each timing, and inputs that awake every one of its neurons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circuitkit.circuit import load_circuit
from circuitkit.engine import compile_circuit, run

TIMINGS = ("as_printed", "synchronous", "ordered")
STEPS = 400
# Synapses that close the circle of p and h: each h sees the p of the last step; see the file of the circuit.
FEEDBACK = {("p1", "h1"), ("p2", "h2")}


def binn(timing):
    return replace(load_circuit("binn_lateral"), timing=timing)


def inputs():
    """Loads of the feet and ZMP in every step, shape (STEPS, 2): a walk with noise."""
    phase = np.linspace(0, 8 * np.pi, STEPS)
    noise = np.random.default_rng(5).normal(size=(2, STEPS))
    force_difference = np.clip(1.3 * np.sin(phase) + 0.05 * noise[0], -1, 1)
    zmp_y = 0.1 * np.sin(3.3 * phase) + 0.01 * noise[1]
    return np.stack([force_difference, zmp_y], axis=1)


def trajectory(graph, values):
    """Outputs of the neurons and of the circuit, each of shape (STEPS, n)."""
    trace = run(compile_circuit(graph), values[:, np.newaxis])
    return trace.output[:, 0], trace.readout[:, 0]
