"""`State`: all that a circuit remembers from tick to tick; `Trace`: what it did over many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """What `B` independent copies of a circuit remember from tick to tick; columns in file order.

    Attributes:
        activation: Activation A of every neuron (eq. 11), shape (B, n_neurons), [SI unit of its activation].
        output: Output O of every neuron (eq. 12), shape (B, n_neurons), dimensionless.
        readout: Outputs of the circuit, which integrating ones add to, shape (B, n_outputs), [SI].
    """

    activation: FloatArray
    output: FloatArray
    readout: FloatArray

    @property
    def batch(self) -> int:
        """Number of copies B."""
        return len(self.activation)

    @classmethod
    def zeros(cls, *leading: int, neurons: int, outputs: int) -> State:
        """A state that is zero everywhere, with any leading axes, such as (B,) or (T, B)."""
        return cls(
            activation=np.zeros((*leading, neurons)),
            output=np.zeros((*leading, neurons)),
            readout=np.zeros((*leading, outputs)),
        )

    def copy(self) -> State:
        """The same values in arrays of its own."""
        return State(self.activation.copy(), self.output.copy(), self.readout.copy())


@dataclass(frozen=True, eq=False)
class Trace:
    """Everything that a circuit did over T ticks; row t is the state after tick t, columns in file order.

    Attributes:
        activation: Activation of every neuron, shape (T, B, n_neurons), [SI unit of its activation].
        output: Output of every neuron, shape (T, B, n_neurons), dimensionless.
        readout: Outputs of the circuit, shape (T, B, n_outputs), [SI].
        state: The state after the last tick, to go on from.
    """

    activation: FloatArray
    output: FloatArray
    readout: FloatArray
    state: State
