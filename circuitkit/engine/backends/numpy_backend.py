"""Numpy backend: a control step is a short list of calls on preallocated arrays, bound to their operands once.

The table is (rows, B), so that neighbouring rows are contiguous whatever the batch size. Sums are added term by
term in the program's order (docs/decisions/0004), so that a member of a batch gets the same bits as one alone.
Floating-point warnings are off during a step: what is not finite is found at its end.
"""

from __future__ import annotations

import contextvars
import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from circuitkit.engine.backends.numpy_operations import bind_operation
from circuitkit.engine.state import FloatArray, State

if TYPE_CHECKING:
    from circuitkit.engine.operations import IndexArray
    from circuitkit.engine.program import Program

Call: TypeAlias = Callable[[], object]


def make_kernel(program: Program, batch: int) -> NumpyKernel:
    """A kernel in the initial state for B = `batch` copies of the circuit."""
    return NumpyKernel(program, batch)


class NumpyKernel:
    """A program bound to arrays of one batch size; see `circuitkit.engine.backends.Kernel`."""

    def __init__(self, program: Program, batch: int) -> None:
        self.batch = batch
        self._time = 0
        table = np.zeros((program.n_rows, batch), dtype=program.precision)
        self._table = table
        self.inputs: FloatArray = table[1 : 1 + len(program.input_names)].T
        self._readout = table[slice(*program.readout_rows)]
        self.readout: FloatArray = self._readout.T
        self.readout.flags.writeable = False
        self._activation_rows = program.activation_rows.copy()
        self._output_rows = program.output_rows.copy()
        self._state_rows = program.state_rows.copy()
        self._lasting = table[: _lasting(program)].reshape(-1)
        before, substep, after = (
            [call for operation in part for call in bind_operation(operation, table)]
            for part in (program.before, program.substep, program.after)
        )
        calls = (*before, *(substep * program.substeps), *after)
        silent = contextvars.copy_context()  # `np.errstate` would cost as much as five operations
        silent.run(np.seterr, all="ignore")
        self.advance: Callable[[], bool] = partial(silent.run, self._advance, calls)

    def _advance(self, calls: Iterable[Call]) -> bool:
        for call in calls:
            call()
        self._time += 1
        return math.isfinite(np.add.reduce(self._lasting)) or bool(np.isfinite(self._lasting).all())

    def load(self, state: State) -> None:
        """Take over a state."""
        self._table[self._activation_rows] = state.activation.T
        self._table[self._output_rows] = state.output.T
        self._table[self._state_rows] = state.states.T
        self._readout[...] = state.readout.T
        self._time, self._seed = state.time, state.seed

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one."""
        state.activation[...] = self._table.take(self._activation_rows, 0).T
        state.output[...] = self._table.take(self._output_rows, 0).T
        state.states[...] = self._table.take(self._state_rows, 0).T
        state.readout[...] = self.readout
        state.time = self._time

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs into an array of shape (B, n_neurons)."""
        output[...] = self._table.take(self._output_rows, 0).T

    def run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray) -> int:
        """Do T control steps and record rows of the table."""
        own, table, advance, chosen = self.inputs, self._table, self.advance, rows.astype(np.intp)
        for step, (given, taken) in enumerate(zip(inputs, record, strict=True)):
            own[...] = given
            if not advance():
                return step
            taken[...] = table.take(chosen, 0).T
        return len(inputs)


def _lasting(program: Program) -> int:
    """How many rows, from the first, must be finite after a step."""
    last = (program.readout_rows[1] - 1, *program.state_rows[-1:], *program.output_rows[-1:])
    return 1 + max(*map(int, last), len(program.input_names))
