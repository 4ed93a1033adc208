"""Continuous circuits as text, and what we compute for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circuitkit.circuit import parse_circuit
from circuitkit.engine import Stepper, compile_circuit

# Three neurons with continuous time, all connected; strong enough to leave the linear part of their sigmoids.
LEAKY = """
circuit: leaky
control_step: 1 ms
timing: synchronous
inputs:
  u: {unit: "1", range: [-1, 1]}
neurons:
  a: {model: leaky_integrator, role: excitatory, tau: 10 ms, slope: 3, shift: 0.2, initial: {v: 0.3}}
  b: {model: leaky_integrator, role: inhibitory, tau: 20 ms, slope: 5, shift: 0.1}
  c: {model: leaky_integrator, role: excitatory, tau: 5 ms, slope: 2, shift: -0.1, initial: {v: -0.5}}
synapses:
  - {from: u, to: a, weight: 1.5}
  - {from: a, to: [a, b, c], weight: 1.2}
  - {from: b, to: [a, c], weight: -2}
  - {from: c, to: [a, b], weight: 0.7}
outputs:
  y: {unit: "1", readout: {a: 1, b: 1, c: 1}}
"""
LEAKY_WEIGHTS = np.array([[1.2, -2, 0.7], [1.2, 0, 0.7], [1.2, -2, 0]])  # to a, b, c from a, b, c
LEAKY_TAU = np.array([0.01, 0.02, 0.005])
LEAKY_SLOPE = np.array([3.0, 5, 2])
LEAKY_SHIFT = np.array([0.2, 0.1, -0.1])
LEAKY_START = np.array([0.3, 0, -0.5])


def leaky_inputs(steps):
    """The input in every control step, shape (steps, 1)."""
    return np.sin(np.arange(steps)[:, np.newaxis] * 2 * np.pi / 50)


def states(text, values, method=None, **overrides):
    """States after every control step, by name such as `a.v`, each of shape (steps,).

    Args:
        text: The circuit.
        values: Inputs, shape (steps, n_inputs), [SI].
        method: Takes the place of the method of the neurons' models.
        overrides: Other values for the circuit, such as substeps.
    """
    graph = parse_circuit(text, settings=overrides)
    if method is not None:
        neurons = (replace(each, model=replace(each.model, method=method)) for each in graph.neurons)
        graph = replace(graph, neurons=tuple(neurons))
    program = compile_circuit(graph)
    stepper = Stepper(program, 1)
    rows = []
    for row in values:
        stepper.step(row[np.newaxis])
        rows.append(stepper.state.states[0])
    return dict(zip(program.state_names, np.array(rows).T, strict=True))
