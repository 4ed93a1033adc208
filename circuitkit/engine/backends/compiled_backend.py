"""Compiled backend: the program as C, built by the system's compiler; numpy where that is not possible."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.reading import environment
from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Unary
from circuitkit.engine.backends import Kernel
from circuitkit.engine.backends.c import SIMD_WIDTH
from circuitkit.engine.backends.c.build import BuildError, load_program, load_runtime
from circuitkit.engine.backends.c.loops import print_loops
from circuitkit.engine.backends.c.pieces import Arrays, Constants
from circuitkit.engine.backends.c.unrolled import print_unrolled
from circuitkit.engine.backends.numpy_backend import NumpyKernel
from circuitkit.engine.operations import FloatArray, IndexArray, Map, Noise, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program
from circuitkit.engine.state import State

_LOG = logging.getLogger("circuitkit")
_ALIGNMENT = 64
_ALIKE = 64  # rows a multiple of so many numbers apart would share places in the processor's cache
# Work up to which a program is unrolled: beyond, loops are as fast, and a batch would take long to compile.
_MAX_UNROLLED = 250
# Work of a step (terms and expressions, times the batch) from which more threads help, and from which other
# threads of Python may run during a step.
_WORK_FOR_THREADS = 150_000
_WORK_FOR_A_WAIT = 30_000
_WORK_TO_RELEASE = 50_000

AnyArray = npt.NDArray[Any]


def make_kernel(program: Program, batch: int) -> Kernel:
    """Make a kernel for B = `batch` copies of the circuit; numpy's, with a warning, if none can be built."""
    kernel = build_kernel(program, batch)
    if isinstance(kernel, str):
        warn(kernel, program)
        return NumpyKernel(program, batch)
    return kernel


def build_kernel(program: Program, batch: int) -> CompiledKernel | str:
    """Compile a kernel for B = `batch` copies, or find it in the cache; if that is not possible, say why."""
    try:
        return CompiledKernel(program, batch)
    except (CircuitkitError, MemoryError):
        raise
    except Exception as error:
        return _reason(error)


def warn(problem: str, program: Program) -> None:
    """Say that numpy runs a program for which the compiled backend was asked, and why."""
    _LOG.warning("%s; the circuit '%s' is run by the numpy backend", problem, program.name)


def _reason(error: Exception) -> str:
    """Say what went wrong; a mistake in the making of the C must not keep a circuit from running either."""
    if isinstance(error, BuildError):
        return str(error)
    return f"internal error of the compiled backend, {type(error).__name__}: {error}"


class CompiledKernel:
    """A program bound to memory of one batch size; see `circuitkit.engine.backends.Kernel`.

    The table is (n_rows, stride): the batch is filled up to whole vectors with copies of its last member.
    """

    def __init__(self, program: Program, batch: int) -> None:
        """Compile, or find what was compiled.

        Args:
            program: What is to be done.
            batch: Number of copies B.

        Raises:
            BuildError: It cannot be compiled.
        """
        number = np.dtype(program.precision)
        self.batch = batch
        self._program = program
        self._stride = _stride(batch)
        self._table = _aligned((program.n_rows, self._stride), number)
        self._members = self._table[:, :batch]
        self._rings = [_aligned((m.depth, len(m.sources), self._stride), number) for m in program.memories]
        self._seeds = np.zeros(self._stride, dtype=np.uint64)
        self.inputs: FloatArray = self._members[1 : 1 + len(program.input_names)].T
        self._readout = self._members[slice(*program.readout_rows)]
        self.readout: FloatArray = self._readout.T
        self.readout.flags.writeable = False
        self._time = 0
        source = print_program(program, batch)
        self._kernel = self._make(source, number)
        self._in_turn = source.unrolled and batch > SIMD_WIDTH
        self.advance: Callable[[], bool] = self._kernel.advance

    def _make(self, source: Source, number: np.dtype[Any]) -> Any:  # noqa: ANN401  # a type made by the runtime
        shared, own = self._given(source.shared, number), self._given(source.own, number)
        arrays = [self._given(array, number) for array in source.arrays.made()]
        tables = [_addresses(arrays), _addresses(self._rings)]
        work = source.work * self.batch
        return load_runtime().Kernel(
            load_program(source.text),
            self._table.ctypes.data,
            self._stride,
            self.batch,
            shared.ctypes.data,
            own.ctypes.data,
            *(table.ctypes.data for table in tables),
            self._seeds.ctypes.data,
            _threads(work, source.waits),
            work,
            work > _WORK_TO_RELEASE,
            (self._table, self._rings, self._seeds, shared, own, arrays, tables),
        )

    def _given(self, array: AnyArray, number: np.dtype[Any]) -> AnyArray:
        """Make an array as C wants it: contiguous, in the program's precision, filled up to the stride."""
        if array.dtype.kind != "f":
            return np.ascontiguousarray(array)
        if array.ndim > 1 and self.batch > 1:
            array = np.pad(array, ((0, 0), (0, self._stride - self.batch)), mode="edge")
        return np.ascontiguousarray(array, dtype=number)

    def bind_step(
        self, take: Callable[[FloatArray], None], fail: Callable[[], NoReturn]
    ) -> Callable[..., FloatArray] | None:
        """`step(inputs=None)` as one function of C; None if that does not know how arrays look in memory."""
        runtime, example = load_runtime(), np.zeros((self.batch, self.inputs.shape[1]))
        facts = example.dtype, example.ctypes.data, *example.shape, *example.strides
        if not runtime.knows_arrays(example, *facts):
            return None
        is_double = self._table.dtype == np.float64
        step: Callable[..., FloatArray] = runtime.Step(
            self._kernel, self.readout, take, fail, example, is_double
        )
        return step

    def load(self, state: State) -> None:
        """Take over a state."""
        program, members = self._program, self._members
        members[program.activation_rows] = state.activation.T
        members[program.output_rows] = state.output.T
        members[program.state_rows] = state.states.T
        self._readout[...] = state.readout.T
        for ring, history in zip(self._rings, state.histories, strict=True):
            ring[::-1, :, : self.batch] = history.transpose(1, 2, 0)
            ring[:, :, self.batch :] = ring[:, :, self.batch - 1, np.newaxis]
        self._table[:, self.batch :] = self._table[:, self.batch - 1, np.newaxis]
        self._seeds[: self.batch] = state.seed
        self._time = state.time
        self._kernel.begin(state.time, 0)

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one."""
        program, members = self._program, self._members
        state.activation[...] = members.take(program.activation_rows, 0).T
        state.output[...] = members.take(program.output_rows, 0).T
        state.states[...] = members.take(program.state_rows, 0).T
        state.readout[...] = self.readout
        done = self._kernel.done()
        for memory, ring, history in zip(program.memories, self._rings, state.histories, strict=True):
            runs = done * (program.substeps if memory in program.substep else 1)
            newest_first = (runs - 1 - np.arange(memory.depth)) % memory.depth
            history[...] = ring[newest_first, :, : self.batch].transpose(2, 0, 1)
        state.time = self._time + done

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs into an array of shape (B, n_neurons)."""
        output[...] = self._members.take(self._program.output_rows, 0).T

    def run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray) -> int:
        """Do T control steps and record rows of the table."""
        arrays, done = (self._table, *self._rings), self._kernel.done()
        copies = [array.copy() for array in arrays] if self._in_turn else []
        good = self._run(inputs, rows, record, len(inputs))
        if good < len(inputs) and copies:  # some members went further, some not so far
            self._kernel.begin(self._time, done)
            for array, copy in zip(arrays, copies, strict=True):
                array[...] = copy
            self._run(inputs, rows, record, good + 1)
        return good

    def _run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray, steps: int) -> int:
        addresses = inputs.ctypes.data, rows.ctypes.data, len(rows), record.ctypes.data
        good: int = self._kernel.run(steps, *addresses)
        return good


def _stride(batch: int) -> int:
    if batch == 1:
        return 1
    stride = -(-batch // SIMD_WIDTH) * SIMD_WIDTH
    return stride + SIMD_WIDTH if stride % _ALIKE == 0 else stride


def _aligned(shape: Sequence[int], number: np.dtype[Any]) -> AnyArray:
    """Return zeros that begin at a line of the cache."""
    size = int(np.prod(shape)) * number.itemsize
    memory = np.zeros(size + _ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size].view(number).reshape(shape)


def _addresses(arrays: Sequence[AnyArray]) -> npt.NDArray[np.uint64]:
    return np.array([*(array.ctypes.data for array in arrays), 0], dtype=np.uint64)


@cache  # so that it warns once
def _chosen_threads(text: str) -> int:
    """Return the number of threads that a text says; 0 if it says none, with a warning if it is not empty."""
    if text.isdecimal() and int(text) > 0:
        return int(text)
    if text:
        _LOG.warning("CIRCUITKIT_THREADS is passed over: found '%s'; allowed: whole numbers from 1", text)
    return 0


def _threads(work: int, waits: int) -> int:
    """Find how many threads share the work: what `CIRCUITKIT_THREADS` says, else one if there is little."""
    if chosen := _chosen_threads(environment("CIRCUITKIT_THREADS")):
        return chosen
    if work < _WORK_FOR_THREADS or work < _WORK_FOR_A_WAIT * waits:
        return 1
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on macOS
        return os.cpu_count() or 1


@dataclass(frozen=True, eq=False)
class Source:
    """C source for one batch size, or for all above one.

    Attributes:
        text: The source.
        shared: Numbers that the source refers to, shape (n,).
        own: Rows of numbers of every member of the batch, shape (n, B).
        arrays: Long constants and indices.
        work: Roughly how many terms and expressions a step has.
        waits: How often workers wait for each other in a step.
        unrolled: Whether members run one after the other through many steps.
    """

    text: str
    shared: FloatArray
    own: FloatArray
    arrays: Arrays
    work: int
    waits: int
    unrolled: bool


def print_program(program: Program, batch: int) -> Source:
    """Print the source of a program for a batch size.

    Args:
        program: What is to be done.
        batch: Number of copies B.
    """
    alone = batch == 1
    work = sum(_cost(operation) for operation in program.operations)
    single = ["#define CK_SINGLE"] if program.precision == "float32" else []
    head = [*single, '#include "context.h"', '#include "arithmetic.h"', '#include "noise.h"']
    constants, arrays = Constants(), Arrays()
    unrolled = work <= _MAX_UNROLLED
    if unrolled:
        body = [print_unrolled(program, constants, alone=alone), '#include "unrolled.h"']
    else:
        body = [
            '#include "loops.h"',
            '#include "active.h"',
            print_loops(program, arrays, alone=alone),
            '#include "steps.h"',
        ]
    return Source(
        "\n".join([*head, *body, ""]),
        constants.shared_numbers(),
        constants.own_rows(batch),
        arrays,
        work,
        0 if unrolled else len(program.operations),
        unrolled,
    )


def _cost(operation: Operation) -> int:
    match operation:
        case Sum(start=start, stop=stop, sources=sources):
            return len(sources) + stop - start
        case Map(count=count, results=results):
            return count * sum(_size(expression) for _, expression in results)
        case Noise(streams=streams):
            return 10 * len(streams)
        case Recall(slots=slots):
            return len(slots)
        case Remember(sources=sources):
            return len(sources)


def _size(expression: Expression) -> int:
    """Number of operations of an expression."""
    match expression:
        case Unary(operand=operand):
            return _size(operand)
        case Binary(left=left, right=right):
            return 1 + _size(left) + _size(right)
        case Call(arguments=arguments):
            return 4 + sum(_size(argument) for argument in arguments)
    return 1
