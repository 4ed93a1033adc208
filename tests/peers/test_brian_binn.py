"""The BiNN in Brian2: activations as summed variables of its synapses, outputs as operations of a step."""

from __future__ import annotations

import numpy as np
import pytest
from peers.pushed import FEEDBACK, STEPS, TIMINGS, binn, inputs, trajectory

pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),  # of what Brian2 uses
    pytest.mark.filterwarnings(
        "ignore:overflow encountered in exp"
    ),  # whose reciprocal is 0, as it should be
]

EQUATIONS = """
A : 1
inflow : 1
from_now : 1   # arrives from neurons that have done this step
from_last : 1  # arrives as the last step left it
slope : 1
low : 1
high : 1
window : 1
o : 1
"""
ACTIVATION = "A = inflow + from_now + from_last"
OUTPUT = "o = 1 / (1 + exp(-slope * (A - low))) * (1 - window + window / (1 + exp(-slope * (high - A))))"
# One after the other if the timing is `ordered`: which feet carry, beyond which edge, who silences, who acts.
LAYERS = [("lf", "bf", "rf"), ("q1", "q2", "q3", "q4"), ("h1", "h2"), ("p1", "p2")]


def simulated(brian2, graph, values):
    """Outputs of the neurons and of the circuit, each of shape (STEPS, n)."""
    brian2.start_scope()
    step = graph.step_s * brian2.second
    brian2.defaultclock.dt = step
    names = [neuron.name for neuron in graph.neurons]
    group = brian2.NeuronGroup(len(names), EQUATIONS, method="euler")
    group.slope = [neuron.parameters["slope"] for neuron in graph.neurons]
    group.window = [float(neuron.model.name == "window") for neuron in graph.neurons]
    group.low = [neuron.parameters.get("low", neuron.parameters.get("shift")) for neuron in graph.neurons]
    group.high = [neuron.parameters.get("high", 0.0) for neuron in graph.neurons]

    def sensors(t):
        column = {node.name: values[round(t / step), i] for i, node in enumerate(graph.inputs)}
        arriving = np.zeros(len(names))
        for synapse in graph.synapses:
            if synapse.source in column:
                arriving[names.index(synapse.target)] += synapse.weight * column[synapse.source]
        group.inflow = arriving

    objects = [group, brian2.NetworkOperation(sensors, dt=step, when="start")]
    layers = LAYERS if graph.timing == "ordered" else [names]
    for order, layer in enumerate(layers):
        first, last = names.index(layer[0]), names.index(layer[-1])
        part = group[first : last + 1]
        objects += connections(brian2, graph, group, part, order, names)
        # As printed, the output is that of the last step's activation.
        code = (OUTPUT, ACTIVATION) if graph.timing == "as_printed" else (ACTIVATION, OUTPUT)
        objects.append(part.run_regularly("\n".join(code), dt=step, when="groups", order=10 * order + 5))
    monitor = brian2.StateMonitor(group, "o", record=True, dt=step, when="end")
    network = brian2.Network(*objects, monitor)
    network.run(STEPS * step)
    return np.array(monitor.o).T


def connections(brian2, graph, group, part, order, names):
    """Summed inflow of a layer, done just before its outputs."""
    found = []
    for variable, last in (("from_now", False), ("from_last", True)):
        pairs = [
            (names.index(each.source), names.index(each.target) - part.start, each.weight)
            for each in graph.synapses
            if each.source in names
            and part.start <= names.index(each.target) < part.stop
            and last == (graph.timing != "ordered" or (each.source, each.target) in FEEDBACK)
        ]
        if not pairs:
            continue
        sources, targets, weights = map(list, zip(*pairs, strict=True))
        model = f"w : 1\n{variable}_post = w * o_pre : 1 (summed)"
        synapses = brian2.Synapses(group, part, model)
        synapses.connect(i=sources, j=targets)
        synapses.w = weights
        for updater in synapses.summed_updaters.values():
            updater.when, updater.order = "groups", 10 * order
        found.append(synapses)
    return found


@pytest.mark.parametrize("timing", TIMINGS)
def test_the_binn_does_the_same_in_brian2(brian2, timing):
    graph, values = binn(timing), inputs()
    outputs = simulated(brian2, graph, values)
    ours, _ = trajectory(graph, values)
    np.testing.assert_allclose(ours, outputs, rtol=0, atol=1e-9)
