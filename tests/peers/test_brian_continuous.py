"""Continuous circuits in Brian2: the same numbers with the same method, the same limit with smaller steps."""

from __future__ import annotations

import numpy as np
import pytest
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

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of what Brian2 uses

LEAKY_EQUATIONS = """
dv/dt = (from_cells + gain * u(t) - v) / tau : 1
o = 1 / (1 + exp(-slope * (v - shift))) : 1
from_cells : 1
gain : 1
tau : second
slope : 1
shift : 1
"""


def leaky(brian2, steps, method, substeps=1):
    """The states of the leaky integrators after every control step, shape (steps, 3)."""
    brian2.start_scope()
    ms = brian2.ms
    dt = ms / substeps
    u = brian2.TimedArray(leaky_inputs(steps)[:, 0], dt=ms)
    cells = brian2.NeuronGroup(3, LEAKY_EQUATIONS, method=method, dt=dt, namespace={"u": u})
    cells.tau, cells.slope, cells.shift = LEAKY_TAU * brian2.second, LEAKY_SLOPE, LEAKY_SHIFT
    cells.v, cells.gain = LEAKY_START, [1.5, 0, 0]
    synapses = brian2.Synapses(cells, cells, "w : 1\nfrom_cells_post = w * o_pre : 1 (summed)", dt=dt)
    synapses.connect()
    synapses.w = LEAKY_WEIGHTS.T.ravel()  # by source, then by target
    monitor = brian2.StateMonitor(cells, "v", record=True, dt=dt, when="end")
    brian2.Network(cells, synapses, monitor).run(steps * ms)
    return np.array(monitor.v).T[substeps - 1 :: substeps]


def our_leaky(steps, **options):
    found = states(LEAKY, leaky_inputs(steps), **options)
    return np.stack([found[f"{name}.v"] for name in "abc"], axis=1)


@pytest.mark.parametrize("substeps", [1, 4])
@pytest.mark.parametrize("method", ["euler", "exponential_euler"])
def test_leaky_integrators_do_the_same_in_brian2(brian2, method, substeps):
    theirs = leaky(brian2, 200, method, substeps)
    ours = our_leaky(200, method=method, substeps=substeps)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


# The same as one neuron with three states, which Brian2 can integrate with a method of high order.
TOGETHER = """
dva/dt = (1.2 * oa - 2 * ob + 0.7 * oc + 1.5 * 0.8 - va) / (10 * ms) : 1
dvb/dt = (1.2 * oa + 0.7 * oc - vb) / (20 * ms) : 1
dvc/dt = (1.2 * oa - 2 * ob - vc) / (5 * ms) : 1
oa = 1 / (1 + exp(-3 * (va - 0.2))) : 1
ob = 1 / (1 + exp(-5 * (vb - 0.1))) : 1
oc = 1 / (1 + exp(-2 * (vc + 0.1))) : 1
"""


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("exponential_euler", 1), ("rk4", 4)])
def test_leaky_integrators_approach_those_of_brian2_with_the_order_of_the_method(brian2, method, order):
    brian2.start_scope()
    cells = brian2.NeuronGroup(1, TOGETHER, method="rk4", dt=brian2.ms / 32)
    cells.va, cells.vb, cells.vc = LEAKY_START
    brian2.Network(cells).run(30 * brian2.ms)
    limit = np.array([cells.va[0], cells.vb[0], cells.vc[0]])
    errors = []
    for substeps in (1, 2, 4):
        found = states(LEAKY, np.full((30, 1), 0.8), method=method, substeps=substeps)
        errors.append(max(abs(found[f"{name}.v"][-1] - v) for name, v in zip("abc", limit, strict=True)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, order, atol=0.3)
