"""Spiking neurons in Brian2: the same potentials with the same method, the same limit with smaller steps."""

from __future__ import annotations

import numpy as np
import pytest
from peers.continuous import states

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of what Brian2 uses

STEPS = 400  # control steps of 1 ms
SUBSTEPS = 10
MILLI, NANO = 1e-3, 1e-9

# One cell drives the other one after a delay and is inhibited by it, by currents that decay.
LIF = """
circuit: pair
control_step: 1 ms
substeps: 10
timing: synchronous
inputs:
  u: {unit: nA, range: [0 nA, 3 nA]}
neurons:
  a: {model: leaky_integrate_and_fire, role: excitatory}
  b: {model: leaky_integrate_and_fire, role: inhibitory, tau: 20 ms, drive: 1.4 nA}
synapses:
  - {from: u, to: a, weight: 1}
  - {from: a, to: b, model: exponential, tau: 5 ms, weight: 0.8 nA, delay: 3 ms}
  - {from: b, to: a, model: exponential, tau: 10 ms, weight: -1.5 nA}
outputs:
  y: {unit: "1", readout: {a: 1, b: 1}}
"""
LIF_EQUATIONS = """
dv/dt = (-65 * mV - v + 10 * Mohm * (u(t) * fed + s + drive)) / tau : volt (unless refractory)
ds/dt = -s / tau_s : amp
tau : second
tau_s : second
fed : 1
drive : amp
"""
# One neuron of a model with its own parameters, and a current.
SINGLE = """
circuit: single
control_step: 1 ms
substeps: 10
timing: synchronous
inputs:
  u: {unit: nA, range: [0 nA, 3 nA]}
neurons:
  a: {model: MODEL, role: excitatory}
synapses:
  - {from: u, to: a, weight: 1}
outputs:
  y: {unit: "1", readout: {a: 1}}
"""
MODELS = {
    "izhikevich": (
        """
        dv/dt = (0.7 * nS / mV * (v + 60 * mV) * (v + 40 * mV) - w + u(t)) / (100 * pF) : volt
        dw/dt = 0.03 / ms * (-2 * nS * (v + 60 * mV) - w) : amp
        """,
        {"threshold": "v >= 35 * mV", "reset": "v = -50 * mV; w += 100 * pA"},
        {"v": "a.v", "w": "a.u"},
        -60 * MILLI,
    ),
    "adaptive_exponential": (
        """
        dv/dt = (30 * nS * (-70.6 * mV - v + upstroke) - w + u(t)) / (281 * pF) : volt
        upstroke = 2 * mV * exp((v + 50.4 * mV) / (2 * mV)) : volt
        dw/dt = (4 * nS * (v + 70.6 * mV) - w) / (144 * ms) : amp
        """,
        {"threshold": "v >= 20 * mV", "reset": "v = -70.6 * mV; w += 0.0805 * nA"},
        {"v": "a.v", "w": "a.w"},
        -70.6 * MILLI,
    ),
}  # fmt: skip


def currents(low, high):
    """A current that steps up and down, shape (STEPS, 1), [A]."""
    return np.where(np.arange(STEPS) // 60 % 2, low, high)[:, np.newaxis] * NANO


def test_two_spiking_neurons_do_the_same_in_brian2(brian2):
    brian2.start_scope()
    values = currents(1.3, 2.4)
    u = brian2.TimedArray(values[:, 0] * brian2.amp, dt=brian2.ms)
    dt = brian2.ms / SUBSTEPS
    cells = brian2.NeuronGroup(
        2,
        LIF_EQUATIONS,
        threshold="v >= -50 * mV",
        reset="v = -65 * mV",
        refractory=2 * brian2.ms + dt,  # it counts the step of the spike as the first one
        method="exponential_euler",
        dt=dt,
        namespace={"u": u},
    )
    cells.v, cells.fed = -65 * brian2.mV, [1, 0]
    cells.tau, cells.tau_s = [10, 20] * brian2.ms, [10, 5] * brian2.ms
    cells.drive = [0, 1.4] * brian2.nA
    synapses = brian2.Synapses(cells, cells, "jump : amp", on_pre="s_post += jump", dt=dt)
    synapses.connect(i=[0, 1], j=[1, 0])
    synapses.jump, synapses.delay = [0.8, -1.5] * brian2.nA, [3, 0] * brian2.ms
    monitor = brian2.StateMonitor(cells, "v", record=True, dt=dt, when="end")
    spikes = brian2.SpikeMonitor(cells)
    brian2.Network(cells, synapses, monitor, spikes).run(STEPS * brian2.ms)
    theirs = np.array(monitor.v)[:, SUBSTEPS - 1 :: SUBSTEPS]
    ours = states(LIF, values)
    assert min(spikes.count) > 5
    np.testing.assert_allclose([ours["a.v"], ours["b.v"]], theirs, rtol=0, atol=1e-9 * 15 * MILLI)


def simulated(brian2, model, values, method, dt, steps=STEPS):
    """Monitors of the states at the ends of control steps."""
    brian2.start_scope()
    equations, spiking, names, start = MODELS[model]
    u = brian2.TimedArray(values[:, 0] * brian2.amp, dt=brian2.ms)
    cell = brian2.NeuronGroup(1, equations, method=method, dt=dt, namespace={"u": u}, **spiking)
    cell.v = start * brian2.volt
    monitor = brian2.StateMonitor(cell, list(names), record=True, dt=dt, when="end")
    spikes = brian2.SpikeMonitor(cell)
    brian2.Network(cell, monitor, spikes).run(steps * brian2.ms)
    each = round(brian2.ms / dt)
    found = {ours: np.array(getattr(monitor, name))[0, each - 1 :: each] for name, ours in names.items()}
    return found, spikes.num_spikes


@pytest.mark.parametrize(("model", "current"), [("izhikevich", 0.2), ("adaptive_exponential", 1.0)])
def test_a_spiking_neuron_does_the_same_in_brian2(brian2, model, current):
    values = currents(0.0, current)
    theirs, spikes = simulated(brian2, model, values, "euler", brian2.ms / SUBSTEPS)
    ours = states(SINGLE.replace("MODEL", model), values, method="euler")
    assert spikes > 5
    for name, series in theirs.items():
        np.testing.assert_allclose(ours[name], series, rtol=0, atol=1e-9 * np.ptp(series))


@pytest.mark.parametrize(("model", "current"), [("izhikevich", 0.04), ("adaptive_exponential", 0.5)])
@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("exponential_euler", 1), ("rk4", 4)])
def test_below_the_threshold_it_approaches_brian2_with_the_order_of_the_method(
    brian2, model, current, method, order
):
    values = np.full((20, 1), current * NANO)
    theirs, spikes = simulated(brian2, model, values, "rk4", brian2.ms / 64, steps=20)
    assert spikes == 0
    errors = []
    for substeps in (1, 2, 4):
        ours = states(SINGLE.replace("MODEL", model), values, method=method, substeps=substeps)
        errors.append(abs(ours["a.v"] - theirs["a.v"])[-1])
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, order, atol=0.35)
