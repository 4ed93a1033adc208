"""The BiNN's step against the same equations in plain numpy, written by hand for one circuit, one robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import numpy as np

from circuitkit.circuit.graph import CircuitGraph, Timing
from circuitkit.circuit.load import load_circuit
from circuitkit.circuit.resolve import resolve
from circuitkit.engine import compile_circuit
from circuitkit.study.bench import Case, Work

_AGAINST = "W @ o; 1 / (1 + exp(-m (a - s))) in numpy, one robot"
_BATCH = 64


def cases() -> tuple[Case, ...]:
    """One robot in each timing, and a batch."""
    return (
        *(Case(f"engine_step_{timing}", _AGAINST, _prepare(timing, 1)) for timing in get_args(Timing)),
        Case(f"engine_step_batch_{_BATCH}", _AGAINST, _prepare("ordered", _BATCH)),
    )


def _prepare(timing: Timing, batch: int) -> Callable[[], tuple[Work, Work]]:
    def prepare() -> tuple[Work, Work]:
        graph = replace(resolve(load_circuit("binn_lateral")), timing=timing)
        stepper = compile_circuit(graph).stepper(batch)
        inputs = np.tile([0.9, 0.03], (batch, 1))
        return lambda: stepper.step(inputs), _by_hand(graph)

    return prepare


def _by_hand(graph: CircuitGraph) -> Work:
    """One matrix over all sources, one sigmoid for every neuron: what one would write in a notebook."""
    names = [*(node.name for node in graph.inputs), *(neuron.name for neuron in graph.neurons)]
    n, n_inputs = len(graph.neurons), len(graph.inputs)
    weights = np.zeros((n, len(names)))
    for synapse in graph.synapses:
        weights[names.index(synapse.target) - n_inputs, names.index(synapse.source)] = synapse.weight
    slope = np.array([neuron.parameters["slope"] for neuron in graph.neurons])
    shift = np.array([neuron.parameters.get("shift", 0.0) for neuron in graph.neurons])
    sources = np.zeros(len(names))

    def step() -> None:
        sources[:n_inputs] = 0.9, 0.03
        sources[n_inputs:] = 1 / (1 + np.exp(-slope * (weights @ sources - shift)))

    return step
