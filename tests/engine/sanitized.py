"""Random circuits by the compiled backend; `test_sanitizers.py` starts it under the sanitizers of gcc."""

import sys

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from random_circuits import any_circuits

from circuitkit.engine import Stepper, compile_circuit, run
from circuitkit.engine.backends import compiled_backend, new_kernel
from circuitkit.engine.backends.c import fusion
from circuitkit.engine.backends.compiled_backend import CompiledKernel


@settings(
    max_examples=int(sys.argv[1]),
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],
    derandomize=True,
    database=None,
)
@given(
    graph=any_circuits(),
    unrolled=st.sampled_from([10**6, -1]),
    precision=st.sampled_from(["float64", "float32"]),
    batch=st.sampled_from([1, 2, 7, 8, 9, 25]),
)
def step_and_run(graph, unrolled, precision, batch):
    compiled_backend._MAX_UNROLLED = unrolled
    program = compile_circuit(graph, "compiled", precision)
    assert isinstance(new_kernel(program, batch), CompiledKernel)
    inputs = np.random.default_rng(0).normal(size=(5, batch, len(graph.inputs)))
    run(program, inputs, states=True)
    run(program, inputs[:0])
    stepper = Stepper(program, batch)
    for row in inputs:
        stepper.step(row)
    stepper.state = stepper.state


fusion._MANY_ROWS = 1
step_and_run()
sys.stdout.write("clean\n")
