"""A refractory time is a whole number of substeps, in both precisions and by all backends."""

from fractions import Fraction
from math import ceil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.circuit import parse_circuit
from circuitkit.engine import compile_circuit, run

TEXT = """
circuit: pause
control_step: {step} us
timing: ordered
inputs: {{i: {{unit: nA, range: [0 nA, 1000 nA]}}}}
neurons:
  a: {{model: leaky_integrate_and_fire, role: excitatory, refractory: {refractory} us, tau: 0.1 us}}
synapses: [{{from: i, to: a, weight: 1}}]
outputs: {{y: {{unit: "1", readout: {{a: 1}}}}}}
"""


def interval(step, refractory, precision, backend="numpy"):
    """Steps between two spikes of a cell that spikes whenever it may."""
    program = compile_circuit(
        parse_circuit(TEXT.format(step=step, refractory=refractory)), backend, precision
    )
    steps = 3 * (ceil(refractory / step) + 2)
    spikes = np.flatnonzero(run(program, np.full((steps, 1, 1), 1e-6)).output[:, 0, 0])
    return int(spikes[1] - spikes[0])


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("backend", ["numpy", "auto"])
def test_two_milliseconds_are_200_steps(precision, backend):
    assert interval(10, 2000, precision, backend) == 201  # 200 in which it is held, and one to spike again


@settings(max_examples=60, deadline=None)
@given(
    step=st.sampled_from([1, 3, 7, 10, 11, 25, 30, 100, 125, 333, 1000, 10000]),
    count=st.integers(0, 3000),
    part=st.sampled_from([0, 0, 0.25, 0.5, 0.9]),
    precision=st.sampled_from(["float32", "float64"]),
)
def test_refractory_times_are_rounded_up_to_whole_steps(step, count, part, precision):
    refractory = Fraction(step) * (count + Fraction(part))
    assert interval(step, float(refractory), precision) == ceil(refractory / step) + 1
