"""Numpy backend: a control step is a list of calls on preallocated arrays, bound to their operands once.

The table is (rows, B), so that neighbouring rows are contiguous whatever the batch size. Sums are added term
by term in the program's order (docs/decisions/0004), so that a member of a batch gets the same bits as one
alone. Floating-point warnings are off during a step: what is not finite is found at its end.
"""

from __future__ import annotations

import contextvars
import math
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import numpy.typing as npt

from circuitkit.engine.backends.numpy_dense import DenseKernel, make_dense_kernel
from circuitkit.engine.backends.numpy_operations import Call, Ring, Workspace, bind_operation
from circuitkit.engine.operations import FloatArray, IndexArray
from circuitkit.engine.program import Program, lasting_rows
from circuitkit.engine.state import State


def make_kernel(program: Program, batch: int) -> NumpyKernel | DenseKernel:
    """Make a kernel for B = `batch` copies of the circuit."""
    dense = None if program.reproducible else make_dense_kernel(program, batch, NumpyKernel)
    return NumpyKernel(program, batch) if dense is None else dense


class NumpyKernel:
    """A program bound to arrays of one batch size; see `circuitkit.engine.backends.Kernel`."""

    def __init__(self, program: Program, batch: int) -> None:
        self.batch = batch
        table = np.zeros((program.n_rows, batch), dtype=program.precision)
        self._table = table
        self._work = Workspace(table)
        for memory in program.memories:
            values = np.zeros((memory.depth, len(memory.sources), batch), dtype=program.precision)
            self._work.rings[memory.memory] = Ring(values, in_substeps=memory in program.substep)
        self._substeps = program.substeps
        self.inputs: FloatArray = table[1 : 1 + len(program.input_names)].T
        self._readout = table[slice(*program.readout_rows)]
        self.readout: FloatArray = self._readout.T
        self.readout.flags.writeable = False
        self._activation_rows = _chosen(program.activation_rows)
        self._output_rows = _chosen(program.output_rows)
        self._state_rows = _chosen(program.state_rows)
        self._lasting = lasting_rows(program)
        self._looked_at = table[: int(np.flatnonzero(self._lasting).max(initial=0)) + 1].reshape(-1)
        silent = contextvars.copy_context()  # `np.errstate` would cost as much as five operations
        silent.run(np.seterr, all="ignore")
        self.advance: Callable[[], bool] = partial(silent.run, self._advance, self._bind(program))

    def _bind(self, program: Program) -> tuple[Call, ...]:
        before, substep, after = (
            [
                call
                for operation in part
                for call in bind_operation(operation, self._work, in_substeps=part is program.substep)
            ]
            for part in (program.before, program.substep, program.after)
        )
        if substep:
            substep.append(self._work.clock.count_substep)
        return (*before, *(substep * program.substeps), *after)

    def _advance(self, calls: Iterable[Call]) -> bool:
        for call in calls:
            call()
        self._work.clock.step += 1
        # The sum of finite numbers may be infinite, and there are rows between that do not last.
        return math.isfinite(np.add.reduce(self._looked_at)) or bool(
            np.isfinite(self._table[self._lasting]).all()
        )

    def load(self, state: State) -> None:
        """Take over a state."""
        self._table[self._activation_rows] = state.activation.T
        self._table[self._output_rows] = state.output.T
        self._table[self._state_rows] = state.states.T
        self._readout[...] = state.readout.T
        clock = self._work.clock
        clock.step, clock.substep = state.time, state.time * self._substeps
        for number, history in enumerate(state.histories):
            ring = self._work.rings[number]
            ring.values[ring.order(clock)] = history.transpose(1, 2, 0)
        for normals in self._work.normals:
            normals.seed(state.seed)

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one; all but the seeds."""
        state.activation[...] = self._table[self._activation_rows].T
        state.output[...] = self._table[self._output_rows].T
        state.states[...] = self._table[self._state_rows].T
        state.readout[...] = self.readout
        state.time = self._work.clock.step
        for number, history in enumerate(state.histories):
            ring = self._work.rings[number]
            history[...] = ring.values[ring.order(self._work.clock)].transpose(2, 0, 1)

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs into an array of shape (B, n_neurons)."""
        output[...] = self._table[self._output_rows].T

    def run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray) -> int:
        """Do T control steps and record rows of the table."""
        own, table, advance, chosen = self.inputs, self._table, self.advance, rows.astype(np.intp)
        for step, (given, taken) in enumerate(zip(inputs, record, strict=True)):
            own[...] = given
            if not advance():
                return step
            taken[...] = table.take(chosen, 0).T
        return len(inputs)


def _chosen(rows: IndexArray) -> slice | npt.NDArray[np.intp]:
    """Find what picks rows of the table: a slice if they are neighbours, which copies nothing."""
    if len(rows) and (np.diff(rows) == 1).all():
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows.astype(np.intp)
