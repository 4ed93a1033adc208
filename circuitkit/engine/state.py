"""`State`: all that a circuit remembers from step to step; `Trace`: what it did over many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from circuitkit.engine.operations import FloatArray


@dataclass(eq=False)
class State:
    """What `B` independent copies of a circuit remember from step to step; columns in file order.

    Attributes:
        activation: Activation A of every neuron (eq. 11), shape (B, n_neurons), [SI unit of its activation].
        output: Output O of every neuron (eq. 12), shape (B, n_neurons), dimensionless.
        readout: Outputs of the circuit, which integrating ones add to, shape (B, n_outputs), [SI].
        states: States of neurons and synapses, in the order of the program's `state_rows`, shape
            (B, n_states), [SI].
        histories: For every memory the values of the past, the newest first, shape (B, depth, n_slots).
        time: Number of control steps done.
        seed: Seed of the noise of every copy, shape (B,).
    """

    activation: FloatArray
    output: FloatArray
    readout: FloatArray
    states: FloatArray
    histories: tuple[FloatArray, ...]
    time: int
    seed: npt.NDArray[np.uint64]

    @property
    def batch(self) -> int:
        """Number of copies B."""
        return len(self.activation)

    def arrays(self) -> tuple[FloatArray, ...]:
        """Return all arrays of numbers that the circuit computes, each with the batch as its first axis."""
        return (self.activation, self.output, self.readout, self.states, *self.histories)

    def copy(self) -> State:
        """Return the same values in arrays of its own."""
        return State(
            self.activation.copy(),
            self.output.copy(),
            self.readout.copy(),
            self.states.copy(),
            tuple(history.copy() for history in self.histories),
            self.time,
            self.seed.copy(),
        )


@dataclass(frozen=True, eq=False)
class Trace:
    """What a circuit did over T steps; row t is the state after step t, columns in the order of the names.

    Attributes:
        activation: Activations, shape (T, B, k), [SI unit of its activation].
        output: Outputs of the neurons, shape (T, B, k), dimensionless.
        readout: Outputs of the circuit, shape (T, B, m), [SI].
        states: States of neurons and synapses, shape (T, B, s), [SI].
        state: The state after the last step, to go on from.
        neuron_names: The k neurons.
        output_names: The m outputs.
        state_names: The s states.
    """

    activation: FloatArray
    output: FloatArray
    readout: FloatArray
    states: FloatArray
    state: State
    neuron_names: Sequence[str]
    output_names: Sequence[str]
    state_names: Sequence[str]
