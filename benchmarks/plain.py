"""What everything is compared with: the BiNN in numpy as one would write it by hand, and its circuits.

    a = W o,  o' = 1 / (1 + exp(-m (a - s)))        (eqs. 11, 12)

with the inputs in the first places of o. This is the timing `synchronous`. `bf` has a window; by hand it has
only its falling side, which is the same for the inputs that are used here.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import repeat

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.graph import CircuitGraph, Neuron, Timing
from circuitkit.circuit.load import load_circuit
from circuitkit.engine import Program, Stepper, compile_circuit
from circuitkit.study.bench import Loop
from circuitkit.study.processes import environment

FloatArray = npt.NDArray[np.float64]

AGAINST = "plain numpy"
INPUTS = np.array([0.9, 0.03])  # the left foot carries, the ZMP is 30 mm to the left
_SETTLED = 20  # steps, after which nothing changes any more


def binn(timing: Timing = "synchronous") -> CircuitGraph:
    """The shipped BiNN."""
    return replace(load_circuit("binn_lateral"), timing=timing)


def varied(number: int) -> CircuitGraph:
    """The BiNN with weights of its own."""
    graph = binn()
    factors = np.random.default_rng(number).uniform(0.8, 1.2, len(graph.synapses))
    synapses = (
        replace(synapse, weight=synapse.weight * factor)
        for synapse, factor in zip(graph.synapses, factors.tolist(), strict=True)
    )
    return replace(graph, synapses=tuple(synapses))


class PlainBinn:
    """The BiNN by hand, for one robot or with the batch as the second axis.

    Attributes:
        values: Inputs, then outputs of the neurons, shape (2 + 11,) or (2 + 11, B).
    """

    def __init__(self, graph: CircuitGraph, batch: int | None = None) -> None:
        names = [*(node.name for node in graph.inputs), *(neuron.name for neuron in graph.neurons)]
        n_inputs, shape = len(graph.inputs), () if batch is None else (batch,)
        self.weights = np.zeros((len(graph.neurons), len(names)))
        for synapse in graph.synapses:
            self.weights[names.index(synapse.target) - n_inputs, names.index(synapse.source)] = synapse.weight
        slope, shift = np.array([_curve(neuron) for neuron in graph.neurons]).T
        column = (len(graph.neurons), *(1 for _ in shape))
        self.minus_slope, self.shift = -slope.reshape(column), shift.reshape(column)
        self.values = np.zeros((len(names), *shape))
        self.values.T[..., :n_inputs] = INPUTS
        self.outputs = self.values[n_inputs:]

    def steps(self, times: int) -> None:
        """Do some steps."""
        weights, values, outputs = self.weights, self.values, self.outputs
        minus_slope, shift, exp = self.minus_slope, self.shift, np.exp
        for _ in repeat(None, times):
            outputs[...] = 1 / (1 + exp(minus_slope * (weights @ values - shift)))


def _curve(neuron: Neuron) -> tuple[float, float]:
    """Slope and shift; of a window those of its falling side."""
    values = neuron.parameters
    if "high" in values:
        return -values["slope"], values["high"]
    return values["slope"], values["shift"]


def require_equal(program: Program, plain: PlainBinn, batch: int) -> None:
    """Compare what both compute, before anybody measures how fast."""
    stepper = Stepper(program, batch)
    for _ in range(_SETTLED):
        stepper.step(np.tile(INPUTS, (batch, 1)))
    plain.steps(_SETTLED)
    expected = plain.outputs.T if plain.outputs.ndim > 1 else plain.outputs[np.newaxis]
    np.testing.assert_allclose(stepper.state.output, expected, rtol=0, atol=1e-12)


def compiled_binn(
    backend: str, timing: Timing = "synchronous", *, batch: int = 1, reproducible: bool = False
) -> Program:
    """The BiNN compiled; first checked against the one by hand."""
    plain = PlainBinn(binn(), batch if batch > 1 else None)
    require_equal(compile_circuit(binn(), backend=backend, reproducible=reproducible), plain, batch)
    return compile_circuit(binn(timing), backend=backend, reproducible=reproducible)


def steps_of(program: Program, batch: int) -> Loop:
    """Steps of a program, each a call from Python that hands over the inputs."""
    stepper = Stepper(program, batch)
    inputs = np.tile(INPUTS, (batch, 1))

    def times(n: int) -> None:
        step = stepper.step
        for _ in repeat(None, n):
            step(inputs)

    return Loop(times)


def loop(step: Callable[[], object]) -> Loop:
    """A loop around a step."""

    def times(n: int) -> None:
        for _ in repeat(None, n):
            step()

    return Loop(times)


def threads(n: int) -> AbstractContextManager[None]:
    """Let kernels that are made meanwhile use n threads."""
    return environment(CIRCUITKIT_THREADS=str(n))
