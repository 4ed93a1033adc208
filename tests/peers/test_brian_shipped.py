"""Shipped circuits, written once more in Brian2 from their comments: the same numbers with the same steps."""

from __future__ import annotations

import numpy as np
import pytest

from circuitkit.circuit import load_circuit
from circuitkit.engine import Stepper, compile_circuit

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of what Brian2 uses

# Both neurons as one with four states, so that Brian2's method takes them together as ours does.
HALF_CENTRE = """
dx/dt = (1 - 2 * yb - x - 2.5 * p) / (132 * ms) : 1
dp/dt = (ya - p) / (264 * ms) : 1
dz/dt = (1 - 2 * ya - z - 2.5 * q) / (132 * ms) : 1
dq/dt = (yb - q) / (264 * ms) : 1
ya = clip(x, 0, inf) : 1
yb = clip(z, 0, inf) : 1
"""
RING = """
dv/dt = (around + cue(t) * cos(2 * pi * i / 64) - 6 * y - v) / (20 * ms) : 1
x = clip(v + 1, 0, inf) : 1
around : 1
y : 1 (linked)
"""
GLOBAL = """
dv/dt = (mean - v) / (2 * ms) : 1
y = clip(v, 0, inf) : 1
mean : 1
"""
BALANCED = """
dv/dt = (-70 * mV - v + 10 * Mohm * (s + 3 * nA)) / (20 * ms) : volt (unless refractory)
ds/dt = -s / (2 * ms) : amp
"""


def trajectory(graph, values):
    """States by name after every control step; `values` are the inputs, shape (steps, n_inputs)."""
    program = compile_circuit(graph)
    stepper = Stepper(program, 1)
    rows = []
    for row in values:
        stepper.step(row[np.newaxis])
        rows.append(stepper.state.states[0])
    return dict(zip(program.state_names, np.array(rows).T, strict=True))


def test_the_half_centre_swings_alike(brian2):
    brian2.start_scope()
    pair = brian2.NeuronGroup(1, HALF_CENTRE, method="rk4", dt=5 * brian2.ms)
    pair.x = 0.1
    monitor = brian2.StateMonitor(pair, ["x", "p", "z", "q"], record=True, dt=5 * brian2.ms, when="end")
    brian2.Network(pair, monitor).run(3 * brian2.second)
    found = trajectory(load_circuit("matsuoka_half_centre"), np.zeros((300, 1)))
    names = {"x": "flexor.v", "p": "flexor.adaptation", "z": "extensor.v", "q": "extensor.adaptation"}
    for theirs, ours in names.items():
        np.testing.assert_allclose(found[ours], getattr(monitor, theirs)[0][1::2], rtol=0, atol=1e-9)
    assert np.sum(np.diff(np.sign(found["flexor.v"])) != 0) >= 4  # it swings


def test_the_ring_remembers_alike(brian2):
    brian2.start_scope()
    values = np.zeros((40, 2))
    values[:15, 0] = 1
    cue = brian2.TimedArray(values[:, 0], dt=10 * brian2.ms)
    dt = brian2.ms
    ring = brian2.NeuronGroup(64, RING, method="exponential_euler", dt=dt, namespace={"cue": cue})
    inhibition = brian2.NeuronGroup(1, GLOBAL, method="exponential_euler", dt=dt)
    ring.y = brian2.linked_var(inhibition, "y")
    around = brian2.Synapses(
        ring, ring, "around_post = 4.0 / 64 * (1 + cos(2 * pi * (i - j) / 64)) * x_pre : 1 (summed)", dt=dt
    )
    around.connect()
    mean = brian2.Synapses(ring, inhibition, "mean_post = x_pre / 64 : 1 (summed)", dt=dt)
    mean.connect()
    # Both advance from what the other one was, so both sums come first, and what links them is held.
    monitor = brian2.StateMonitor(ring, "v", record=True, dt=dt, when="end")
    network = brian2.Network(ring, inhibition, around, mean, monitor)
    ring.state_updater.order, inhibition.state_updater.order = 0, 1
    network.run(400 * brian2.ms)
    found = trajectory(load_circuit("ring_attractor"), values)
    ours = np.stack([found[f"ring[{i}].v"] for i in range(64)])
    np.testing.assert_allclose(ours, monitor.v[:, 9::10], rtol=0, atol=1e-9)
    assert ours[:, -1].argmax() == 0  # where the cue was
    assert ours[:, -1].max() > 0.5


def test_the_balanced_network_fires_alike(brian2):
    """A smaller one, for as long as rounding has not yet made other spikes."""
    sizes = {"excitatory.size": 800, "inhibitory.size": 200}
    graph = load_circuit("balanced_network", sizes)
    brian2.start_scope()
    dt = 0.5 * brian2.ms
    cells = brian2.NeuronGroup(
        1000,
        BALANCED,
        threshold="v >= -50 * mV",
        reset="v = -60 * mV",
        refractory=2 * brian2.ms + dt,  # it counts the step of the spike as the first one
        method="exponential_euler",
        dt=dt,
    )
    cells.v = np.concatenate([each.initial["v"] for each in graph.populations]) * brian2.volt
    first = {"excitatory": 0, "inhibitory": 800}
    objects = [cells]
    for projection in graph.projections:
        synapses = brian2.Synapses(
            cells,
            cells,
            on_pre="s_post += weight",
            delay=1.5 * brian2.ms,
            dt=dt,
            namespace={"weight": {"excitatory": 0.8, "inhibitory": -6.4}[projection.source] * brian2.nA},
        )
        targets = np.repeat(np.arange(len(projection.indptr) - 1), np.diff(projection.indptr))
        synapses.connect(
            i=first[projection.source] + projection.sources, j=first[projection.target] + targets
        )
        objects.append(synapses)
    monitor = brian2.StateMonitor(cells, "v", record=True, dt=dt, when="end")
    spikes = brian2.SpikeMonitor(cells)
    brian2.Network(*objects, monitor, spikes).run(60 * brian2.ms)
    found = trajectory(graph, np.zeros((6, 0)))
    names = [f"{each.name}[{i}].v" for each in graph.populations for i in range(each.size)]
    ours = np.stack([found[name] for name in names])
    assert spikes.num_spikes > 300
    np.testing.assert_allclose(ours, np.array(monitor.v)[:, 19::20], rtol=0, atol=1e-9 * 10e-3)  # of 10 mV
