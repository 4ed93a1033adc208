"""The engine against the slow reference, which knows nothing of it, on random circuits of all kinds."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_circuits import any_circuits
from reference import Reference

from circuitkit.engine import compile_circuit, run


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(graph=any_circuits(), seed=st.integers(0, 2**31))
def test_random_circuits_do_what_the_reference_does(graph, seed):
    program = compile_circuit(graph, backend="numpy")
    inputs = np.random.default_rng(seed).normal(size=(6, 1, len(graph.inputs)))
    trace = run(program, inputs, program.initial_state(seed=seed))
    reference = Reference(graph, seed)
    for t, row in enumerate(inputs[:, 0].tolist()):
        names = (node.name for node in graph.inputs)
        activation, output, readout = reference.tick(dict(zip(names, row, strict=True)))
        np.testing.assert_allclose(trace.activation[t, 0], activation, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(trace.output[t, 0], output, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(trace.readout[t, 0], readout, rtol=1e-11, atol=1e-11)
