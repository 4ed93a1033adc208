"""Sigmoid neurons as a C++ program made by Brian2: a script of its own, for Brian2 allows one a process.

    python brian_standalone.py CIRCUIT.npz FOLDER

CIRCUIT.npz has the arrays `sources`, `targets` and `weights` of the synapses; `slope`, `shift` and `drive` of
the neurons, the last being what the inputs add to the activation; and `steps`. FOLDER then holds `main`.
"""

from __future__ import annotations

import sys

import brian2
import numpy as np

_NEURONS = "A : 1\nslope : 1 (constant)\nshift : 1 (constant)\ndrive : 1 (constant)\no : 1"


def build(circuit: str, folder: str) -> None:
    """Write the program and compile it."""
    given = np.load(circuit)
    brian2.set_device("cpp_standalone", directory=folder, build_on_run=False)
    brian2.defaultclock.dt = brian2.ms
    cells = brian2.NeuronGroup(len(given["slope"]), _NEURONS)
    cells.slope, cells.shift, cells.drive = given["slope"], given["shift"], given["drive"]
    synapses = brian2.Synapses(cells, cells, "w : 1 (constant)\nA_post = w * o_pre : 1 (summed)")
    synapses.connect(i=given["sources"], j=given["targets"])
    synapses.w = given["weights"]
    step = cells.run_regularly("o = 1 / (1 + exp(-slope * (A + drive - shift)))", dt=brian2.ms)
    brian2.Network(cells, synapses, step).run(int(given["steps"]) * brian2.ms)
    brian2.device.build(directory=folder, compile=True, run=False)


if __name__ == "__main__":
    build(*sys.argv[1:])
