"""What inputs reach: a change of them changes it in some step, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from circuitkit.circuit import parse_circuit
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.dependence import dependence

TEXT = """
circuit: c
control_step: 10 ms
timing: ordered
inputs: {{u: {{unit: "1", range: [0, 1]}}, v: {{unit: "1", range: [0, 1]}}}}
neurons:
  a: {{model: leaky_linear, role: excitatory, tau: 20 ms}}
  b: {{model: sigmoid, role: excitatory, slope: 5, shift: 0.5}}
synapses:
  - {{from: u, to: a, weight: 1}}
  - {{from: v, to: b, weight: 1}}
  - {{from: v, to: a, weight: {weight}, {more}}}
outputs: {{x: {{unit: "1", readout: {{a: 1}}}}, y: {{unit: "1", readout: {{b: 1}}}}}}
"""
MODELS = ["model: static", "delay: 30 ms", "model: gated, gate: b"]


def reached(program, n_circuits: int) -> list[bool]:
    """Which outputs `v` changes, by running with it and without."""
    u, v = np.random.default_rng(0).uniform(0, 1, (2, 9, n_circuits))
    outputs = [run(program, np.stack([u, each], axis=-1)).readout for each in (v, 0 * v)]
    return [bool((outputs[0][..., i] != outputs[1][..., i]).any()) for i in range(2)]


@pytest.mark.parametrize("more", MODELS)
@pytest.mark.parametrize("weights", [[0], [0.5], [0, 0], [0, 0.5], [0.5, 0]])
def test_a_weight_of_0_takes_out_what_it_weighs_in_all_circuits(weights, more):
    graphs = [parse_circuit(TEXT.format(weight=each, more=more)) for each in weights]
    program = compile_circuit(graphs if len(graphs) > 1 else graphs[0], "numpy")
    found = dependence(program, np.array([False, True]))
    assert found.outputs.tolist() == reached(program, len(weights)) == [any(weights), True]
    assert dependence(program, np.array([True, False])).outputs.tolist() == [True, False]
    # The activations of a and b are the first array of a state.
    assert found.state[0].tolist() == [any(weights), True]
