"""Runs circuits written as text and records outputs and states by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from circuitkit.circuit import parse_circuit
from circuitkit.engine import Stepper, compile_circuit

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Played:
    """What happened: one value at the end of every control step.

    Attributes:
        time_s: Time at the end of every step, [s].
        output: By neuron.
        activation: By neuron, [SI].
        state: By name such as `n.v`, [SI].
    """

    time_s: Array
    output: Mapping[str, Array]
    activation: Mapping[str, Array]
    state: Mapping[str, Array]

    def spike_times_s(self, neuron: str) -> Array:
        """Ends of the control steps in which the neuron spiked, [s]."""
        return self.time_s[self.output[neuron] > 0]


def play_circuit(text: str, inputs: npt.ArrayLike) -> Played:
    """Run a circuit.

    Args:
        text: The circuit file.
        inputs: Shape (T,) or (T, n_inputs), [SI].
    """
    graph = parse_circuit(text)
    program = compile_circuit(graph, backend="numpy")
    values = np.asarray(inputs, dtype=np.float64).reshape(len(inputs), 1, -1)
    stepper = Stepper(program)
    outputs, activations, states = [], [], []
    for row in values:
        stepper.step(row)
        state = stepper.state
        outputs.append(state.output[0])
        activations.append(state.activation[0])
        states.append(state.states[0])
    return Played(
        np.arange(1, len(values) + 1) * graph.step_s,
        dict(zip(program.neuron_names, np.transpose(outputs), strict=True)),
        dict(zip(program.neuron_names, np.transpose(activations), strict=True)),
        dict(zip(program.state_names, np.transpose(states), strict=True)) if program.state_names else {},
    )


@pytest.fixture(scope="session")
def play() -> Callable[[str, npt.ArrayLike], Played]:
    """Runs a circuit; see `play_circuit`."""
    return play_circuit


def one_neuron(neuron: str, unit: str, control_step: str = "1 ms", substeps: int = 1) -> str:
    """A circuit of one neuron `n` that the input `u` drives."""
    return f"""\
circuit: one
control_step: {control_step}
substeps: {substeps}
timing: ordered
inputs:
  u: {{unit: {unit}, range: [-1 {unit}, 1 {unit}]}}
neurons:
  n: {{role: excitatory, {neuron}}}
synapses:
  - {{from: u, to: n, weight: 1}}
outputs:
  y: {{unit: "1", readout: {{n: 1}}}}
"""


@pytest.fixture(scope="session")
def alone() -> Callable[..., str]:
    """Text of a circuit of one neuron; see `one_neuron`."""
    return one_neuron
