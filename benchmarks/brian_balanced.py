"""The balanced network as a C++ program made by Brian2: a script of its own, see `brian_standalone`.

    python brian_balanced.py CIRCUIT.npz FOLDER

CIRCUIT.npz has `excitatory` and `inhibitory`, each the sources and targets of synapses, shape (2, n); the
`weights` of both, [A]; the potentials at the start, `v`, [V]; and `substeps`, of 0.5 ms. All other numbers
are those of the file of the circuit.
"""

from __future__ import annotations

import sys

import brian2
import numpy as np

_NEURONS = """
dv/dt = (-70 * mV - v + 10 * Mohm * (s + 3 * nA)) / (20 * ms) : volt (unless refractory)
ds/dt = -s / (2 * ms) : amp
spikes : 1
"""


def build(circuit: str, folder: str) -> None:
    """Write the program and compile it."""
    given = np.load(circuit)
    brian2.set_device("cpp_standalone", directory=folder, build_on_run=False)
    step = 0.5 * brian2.ms
    brian2.defaultclock.dt = step
    cells = brian2.NeuronGroup(
        len(given["v"]),
        _NEURONS,
        threshold="v >= -50 * mV",
        reset="v = -60 * mV; spikes += 1",
        refractory=2 * brian2.ms + step,  # it counts the step of the spike as the first one
        method="exponential_euler",
    )
    cells.v = given["v"] * brian2.volt
    network = brian2.Network(cells)
    for name, weight in zip(("excitatory", "inhibitory"), given["weights"], strict=True):
        synapses = brian2.Synapses(
            cells,
            cells,
            on_pre="s_post += weight",
            delay=1.5 * brian2.ms,
            namespace={"weight": weight * brian2.amp},
        )
        synapses.connect(i=given[name][0], j=given[name][1])
        network.add(synapses)
    network.run(int(given["substeps"]) * step)
    brian2.device.build(directory=folder, compile=True, run=False)


if __name__ == "__main__":
    build(*sys.argv[1:])
