"""What a kernel is: a program bound to arrays, which does the program's arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from circuitkit.engine.operations import FloatArray, IndexArray
from circuitkit.engine.program import Program
from circuitkit.engine.state import State


class Kernel(Protocol):
    """A program bound to arrays for one batch size; not to be shared between threads.

    Attributes:
        batch: Number of copies B of the circuit.
        inputs: Where the inputs of the next step are written, shape (B, n_inputs), [SI].
        readout: Outputs of the circuit after the last step, a read-only view of shape (B, n_outputs), [SI].
        bind_step: May be there: `bind_step(take, fail)` gives one function `step(inputs=None)` that does all
            that `Stepper.step` does, or None; `take` puts inputs in their place, `fail` raises.
        advance: Does one control step with what stands in `inputs`; says whether all is finite: the inputs,
            and all rows that survive the step.
    """

    batch: int
    inputs: FloatArray
    readout: FloatArray
    advance: Callable[[], bool]

    def load(self, state: State) -> None:
        """Take over a state."""

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one."""

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs alone into an array of shape (B, n_neurons)."""

    def run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray) -> int:
        """Do T control steps and record rows of the table.

        Args:
            inputs: Shape (T, B, n_inputs), contiguous, [SI].
            rows: Which rows to record: activations, outputs, outputs of the circuit or states, shape (R,).
            record: Takes them as they are after each step, shape (T, B, R), contiguous.

        Returns:
            T, or the first step, from 0, after which something was not finite; the kernel is then left as it
            was after that step.
        """


class KernelMaker(Protocol):
    """Makes kernels; what a backend module must have under the name `make_kernel`."""

    def __call__(self, program: Program, batch: int) -> Kernel:
        """Return a kernel, whose state is yet to be loaded, for B = `batch` copies."""
