"""The BiNN in Nengo: its own sigmoid neurons, connections without synaptic filter, delays of one step."""

from __future__ import annotations

import numpy as np
import pytest
from peers.pushed import FEEDBACK, STEPS, TIMINGS, binn, inputs, trajectory

# Nengo's `synapse`: no delay within a step, or exactly one step.
NOW, LAST = None, 0


class Net:
    """A circuit as a Nengo network: `arrivals` sum up the activations, `cells` put out what follows."""

    def __init__(self, nengo, graph, values):
        self.nengo, self.graph = nengo, graph
        self.network = nengo.Network()
        self.inputs, self.arrivals, self.cells = {}, {}, {}
        with self.network:
            for column, node in enumerate(graph.inputs):
                series = values[:, column]
                self.inputs[node.name] = nengo.Node(lambda t, series=series: series[round(t / 0.01) - 1])
            for neuron in graph.neurons:
                self.cells[neuron.name] = self.cell(neuron)
            for synapse in graph.synapses:
                self.connect(synapse)
            for output in graph.outputs:
                self.readout = self.output(output)
            self.probes = [nengo.Probe(cell) for cell in self.cells.values()]
            self.probe = nengo.Probe(self.readout)

    def cell(self, neuron):
        """What computes the output of a neuron from its activation."""
        nengo, values = self.nengo, neuron.parameters
        arrival = nengo.Node(size_in=1)
        if neuron.model.name == "sigmoid":
            cells = nengo.Ensemble(
                1,
                1,
                neuron_type=nengo.Sigmoid(tau_ref=1.0),
                gain=[1.0],
                bias=[-values["slope"] * values["shift"]],
            ).neurons
            gain = values["slope"]
        else:
            slope, low, high = values["slope"], values["low"], values["high"]
            cells = nengo.Node(
                lambda _, a: 1 / (1 + np.exp(-slope * (a - low))) / (1 + np.exp(-slope * (high - a))),
                size_in=1,
            )
            gain = 1.0
        # As printed, the output is that of the last step's activation.
        delay = LAST if self.graph.timing == "as_printed" else NOW
        nengo.Connection(arrival, cells, transform=gain, synapse=delay)
        self.arrivals[neuron.name] = arrival
        return cells

    def connect(self, synapse):
        sensorial = synapse.source in self.inputs
        source = (self.inputs if sensorial else self.cells)[synapse.source]
        now = sensorial or (
            self.graph.timing == "ordered" and (synapse.source, synapse.target) not in FEEDBACK
        )
        self.nengo.Connection(
            source, self.arrivals[synapse.target], transform=synapse.weight, synapse=NOW if now else LAST
        )

    def output(self, output):
        limited = self.nengo.Node(lambda _, y: np.clip(y, output.low, output.high), size_in=1)
        for name, weight in output.readout:
            self.nengo.Connection(self.cells[name], limited, transform=weight, synapse=NOW)
        self.nengo.Connection(limited, limited, transform=1 - output.leak, synapse=LAST)
        return limited

    def run(self):
        with self.nengo.Simulator(self.network, dt=0.01, progress_bar=False) as simulator:
            simulator.run_steps(STEPS, progress_bar=False)
        outputs = np.concatenate([simulator.data[probe] for probe in self.probes], axis=1)
        return outputs, simulator.data[self.probe]


@pytest.mark.parametrize("timing", TIMINGS)
def test_the_binn_does_the_same_in_nengo(nengo, timing):
    graph, values = binn(timing), inputs()
    outputs, readout = Net(nengo, graph, values).run()
    our_outputs, our_readout = trajectory(graph, values)
    np.testing.assert_allclose(our_outputs, outputs, rtol=0, atol=1e-9)
    np.testing.assert_allclose(our_readout, readout, rtol=0, atol=1e-9)
    assert np.ptp(our_outputs, axis=0).min() > 0.5  # every neuron wakes and sleeps
