"""Asks what the lateral network answers to a ZMP that stands still, for each way of standing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit import CircuitGraph
from circuitkit.engine import compile_circuit, run

Array = NDArray[np.float64]

LOADS: Mapping[str, float] = {"left foot": 1.0, "both feet": 0.0, "right foot": -1.0}
FORCES, ZMP = "force_difference", "zmp_y"
_SETTLED = 60  # steps, after which a network without memory but its loop of p and h changes no more


@dataclass(frozen=True)
class Answers:
    """Outputs of all neurons.

    Attributes:
        zmp_m: The ZMP; shape (k,).
        names: Of the neurons.
        outputs: What each neuron sends at last, by way of standing; shape (k, n), between 0 and 1.
    """

    zmp_m: Array
    names: tuple[str, ...]
    outputs: Mapping[str, Array]

    def of(self, neuron: str, standing: str) -> Array:
        """Outputs of one neuron; shape (k,)."""
        return np.asarray(self.outputs[standing][:, self.names.index(neuron)])


def settled_answers(graph: CircuitGraph, zmp_m: Array) -> Answers:
    """Hold the inputs until the network has settled.

    Args:
        graph: A network with the inputs `force_difference` and `zmp_y`.
        zmp_m: Places of the ZMP; shape (k,).
    """
    program = compile_circuit(graph)
    columns = [list(program.input_names).index(name) for name in (FORCES, ZMP)]
    outputs = {}
    for standing, load in LOADS.items():
        inputs = np.zeros((_SETTLED, len(zmp_m), len(program.input_names)))
        inputs[..., columns[0]] = load
        inputs[..., columns[1]] = zmp_m
        outputs[standing] = run(program, inputs).output[-1]
    return Answers(zmp_m, tuple(program.neuron_names), outputs)
