"""Dense kernel of the numpy backend: a matrix product for every stage, its order of additions left open.

It serves numbers far from infinity, for which that order decides about rounding alone. A step that begins
with others is done term by term, by a kernel that is kept for this.
"""

from __future__ import annotations

import contextvars
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn, Protocol

import numpy as np
from scipy.special import expit

from circuitkit.engine.backends.dense_bounds import accumulates, largest_start
from circuitkit.engine.backends.dense_code import Code, one_by_one, quicker_one_by_one, read_out
from circuitkit.engine.backends.dense_plan import (
    IDENTITY,
    Layout,
    Stage,
    dense_stages,
    make_layout,
    make_readout,
    matrices,
    moved,
)
from circuitkit.engine.backends.dense_state import Activations, Block
from circuitkit.engine.backends.numpy_operations import Workspace, bind_operation
from circuitkit.engine.operations import FloatArray, IndexArray
from circuitkit.engine.program import Program
from circuitkit.engine.state import State

Take = Callable[[FloatArray], object]
Fail = Callable[[], NoReturn]
_BLOCK = 4096  # members of a batch that are computed together, so that they stay in the processor's cache
_SINGLE = 8  # members from which numpy's vectorised exp is faster than scipy's expit


def make_dense_kernel(
    program: Program, batch: int, make_careful: Callable[[Program, int], Careful]
) -> DenseKernel | None:
    """Make a kernel for a program that is a few matrix products; None for any other.

    Args:
        program: The compiled circuit.
        batch: Number of copies B.
        make_careful: Makes the kernel for steps that begin with large numbers.
    """
    with np.errstate(all="ignore"):  # what overflows here has no limit, and is left to others
        stages = dense_stages(program)
        if stages is None:
            return None
        layout = make_layout(program, stages)
        limit = largest_start(program, stages, layout)
    return DenseKernel(program, batch, stages, layout, limit, make_careful) if limit else None


class Careful(Protocol):
    """What does a step term by term; see `circuitkit.engine.backends.Kernel`."""

    inputs: FloatArray
    advance: Callable[[], bool]

    def load(self, state: State) -> None:
        """Take over a state."""

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one."""


class DenseKernel:
    """A program bound to arrays of one batch size; see `circuitkit.engine.backends.Kernel`.

    Activations are not kept: they are worked out from x = gain A + constant when somebody asks for them.
    """

    def __init__(
        self,
        program: Program,
        batch: int,
        stages: Sequence[Stage],
        layout: Layout,
        limit: float,
        make_careful: Callable[[Program, int], Careful],
    ) -> None:
        number = np.dtype(program.precision)
        self.batch = batch
        self._layout, self._stages, self._program = layout, stages, program
        self._limit, self._make_careful = limit, make_careful
        self._careful: Careful | None = None
        self._grows = not layout.is_bounded or accumulates(program, limit)
        self._mirrored = batch > _SINGLE
        sign = -1.0 if self._mirrored else 1.0
        self._matrices = [matrix.astype(number) for matrix in matrices(stages, layout, sign)]
        self._blocks = [
            Block(
                slice(start, min(start + _BLOCK, batch)),
                layout,
                self._matrices,
                number,
                outputs_first=stages[0].outputs_first,
            )
            for start in range(0, batch, _BLOCK)
        ]
        self._inputs = self._whole(slice(1, 1 + len(program.input_names)))
        self._readout = self._whole(slice(*layout.readouts))
        self.inputs: FloatArray = self._inputs.T
        self.readout: FloatArray = self._readout.T
        self.readout.flags.writeable = False
        self._output_places = np.array([layout.place[row] for row in program.output_rows.tolist()], np.intp)
        self._activations = Activations(program, layout, sign)
        self._given = np.zeros((batch, len(program.activation_rows)))
        self._time = self._loaded = 0
        self._code: Code | None = None
        if batch == 1 and program.precision == "float64":  # as Python's numbers are
            self._code = self._straight()
            self.advance: Callable[[], bool] = self._quiet(
                self._code.function(
                    "advance()", self._code.reads(), ["return step_carefully()"], ["return True"]
                )
            )
        else:
            self.advance = _silently(self._blocked())

    def _whole(self, places: slice) -> FloatArray:
        """Numbers at places for the whole batch: those of the only block, or an array beside the blocks."""
        if len(self._blocks) == 1:
            return self._blocks[0].numbers[places]
        return np.zeros((places.stop - places.start, self.batch), dtype=self._blocks[0].numbers.dtype)

    # --- one circuit --------------------------------------------------------------------------------------

    def bind_step(self, take: Take, fail: Fail) -> Callable[..., FloatArray] | None:
        """Bind the step of one circuit as one function, to spare calls; None for a batch.

        Args:
            take: Puts inputs in their place.
            fail: Raises what there is to say if something is not finite.
        """
        if self._code is None:
            return None
        self._code.names |= {"take": take, "fail": fail, "readout": self.readout}
        otherwise = ["if not step_carefully():", "    fail()", "return readout"]
        return self._quiet(
            self._code.function("step(inputs=None)", self._code.takes(), otherwise, ["return readout"])
        )

    def _quiet(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function, without numpy's warnings; Python's numbers have none."""
        return function if self._by_number else _silently(function)

    def _straight(self) -> Code:
        """Return the step as straight code."""
        numbers = self._blocks[0].numbers.reshape(-1)
        code = Code(numbers.data, len(self._program.input_names))
        code.names |= {"time": 0, "step_carefully": self._step_carefully}
        outputs_first = self._stages[0].outputs_first
        self._by_number = not outputs_first and quicker_one_by_one(self._stages, self._layout)
        if self._by_number:
            self._print_numbers(code)
        else:
            self._print_arrays(code, numbers)
        if not read_out(code, self._program.after, self._layout):
            self._push_first(code)
            work = Workspace(self._blocks[0].numbers)
            for operation in self._program.after:
                for call in bind_operation(moved(operation, self._layout), work, in_substeps=False):
                    code.call(call)
        code.guard = self._guard(code, numbers)
        return code

    def _guard(self, code: Code, numbers: FloatArray) -> str:
        """Return the condition that no number at the beginning of a step is large, or not a number."""
        squares = [f"{name} * {name}" for name in code.inputs]
        if self._grows and self._by_number:
            outputs = [name for name in code.values.values() if name.startswith("o")]
            readouts = [f"m[{place}]" for place in range(*self._layout.readouts)]
            squares += [f"{name} * {name}" for name in (*outputs, *readouts)]
        elif self._grows:
            squares = [f"{code.bind(numbers.dot)}({code.bind(numbers)})"]
        return f"{' + '.join(squares)} < {self._limit * self._limit!r}" if squares else ""

    def _step_carefully(self) -> bool:
        """Do a step term by term, and say whether all is finite."""
        if self._careful is None:
            self._careful = self._make_careful(self._program, self.batch)
        state, careful = self._program.initial_state(self.batch), self._careful
        self.store(state)
        careful.load(state)
        careful.inputs[...] = self.inputs
        is_finite = careful.advance()
        careful.store(state)
        self.load(state)
        return is_finite

    def _print_numbers(self, code: Code) -> None:
        for parts, joints in zip(self._layout.parts, self._layout.joints, strict=True):
            places = [place for _, start, stop in parts for place in range(start, stop)]
            for place in [*places, *(target for target, _, _, _ in joints)]:
                code.values[place] = f"o{place}"
        for number, stage in enumerate(self._stages):
            one_by_one(code, stage, self._layout, number)

    def _print_arrays(self, code: Code, numbers: FloatArray) -> None:
        parts = zip(self._stages, self._matrices, self._blocks[0].arguments, self._layout.parts, strict=True)
        for number, (stage, matrix, arguments, functions) in enumerate(parts):
            x = arguments.reshape(-1)
            for source, target in stage.copies:
                code.lines.append(f"m[{self._layout.place[target]}] = m[{self._layout.place[source]}]")
            product = self._blocks[0].products[number].reshape(-1)
            code.call(matrix.dot, numbers[: matrix.shape[1]], product)
            start = 0
            for function, begin, end in functions:
                given, result = x[start : start + end - begin], numbers[begin:end]
                start += end - begin
                called, its_arguments = _function_call(function, given, result)
                code.call(called, *its_arguments)
            if self._stages[0].outputs_first:
                code.call(np.positive, product, x)
            for target, joint, first, second in self._layout.joints[number]:
                code.lines.append(f"m[{target}] = m[{first}] {joint} m[{second}]")

    def _push_first(self, code: Code) -> None:
        """Let the arrays have the outputs before calls read them."""
        if self._by_number:
            for place, name in code.values.items():
                code.lines.append(f"m[{place}] = {name}")

    def _pull(self) -> None:
        """Put what straight code keeps to itself into the arrays."""
        if self._code is None:
            return
        names = self._code.names
        self._time = names["time"]
        if self._by_number:
            for place, name in self._code.values.items():
                if name.startswith("o"):
                    self._blocks[0].numbers[place] = names[name]
            for number, x in enumerate(self._blocks[0].arguments):
                n = len(self._layout.elements[number])
                x[:n, 0] = [names[f"x{number}_{i}"] for i in range(n)]

    def _push(self) -> None:
        """Let straight code begin with what stands in the arrays."""
        if self._code is None:
            return
        names = self._code.names
        names["time"] = self._time
        for name in self._code.written:
            if name[0] in "oy":
                names[name] = float(self._blocks[0].numbers[int(name[1:]), 0])

    # --- a batch ------------------------------------------------------------------------------------------

    def _blocked(self) -> Callable[[], bool]:
        """Return the step of a batch, block after block."""
        calls: list[Callable[[], object]] = []
        guarded: list[FloatArray] = [self._inputs]
        for block in self._blocks:
            inputs, readout = slice(1, 1 + len(self._inputs)), slice(*self._layout.readouts)
            if len(self._blocks) > 1:
                calls.append(partial(np.copyto, block.numbers[inputs], self._inputs[:, block.members]))
            calls += self._stage_calls(block)
            calls += self._read_out(block.numbers)
            if len(self._blocks) > 1:
                calls.append(partial(np.copyto, self._readout[:, block.members], block.numbers[readout]))
            guarded += [block.numbers] if self._grows else []
        flat = [each.reshape(-1) for each in guarded if each.size]
        squares, largest = [partial(each.dot, each) for each in flat], self._limit * self._limit

        def advance() -> bool:
            if not all(each() < largest for each in squares):
                return self._step_carefully()
            for call in calls:
                call()
            self._time += 1
            return True

        return advance

    def _stage_calls(self, block: Block) -> list[Callable[[], object]]:
        calls: list[Callable[[], object]] = []
        layout, numbers = self._layout, block.numbers
        arguments = zip(self._matrices, block.products, block.arguments, strict=True)
        parts = zip(self._stages, arguments, layout.parts, layout.joints, strict=True)
        for stage, (matrix, product, x), functions, joints in parts:
            for source, target in stage.copies:
                calls.append(partial(np.copyto, numbers[layout.place[target]], numbers[layout.place[source]]))
            calls.append(partial(matrix.dot, numbers[: matrix.shape[1]], product))
            start = 0
            for function, begin, end in functions:
                given, result = x[start : start + end - begin].reshape(-1), numbers[begin:end].reshape(-1)
                start += end - begin
                calls += _function_calls(function, given, result, mirrored=self._mirrored)
            if product is not x:
                calls.append(partial(np.positive, product.reshape(-1), x.reshape(-1)))
            for target, joint, first, second in joints:
                ufunc = {"*": np.multiply, "+": np.add, "-": np.subtract}[joint]
                calls.append(partial(ufunc, numbers[first], numbers[second], numbers[target]))
        return calls

    def _read_out(self, numbers: FloatArray) -> list[Callable[[], object]]:
        readout = make_readout(self._program.after, self._layout)
        if readout is None:
            work = Workspace(numbers)
            operations = [moved(operation, self._layout) for operation in self._program.after]
            return [call for each in operations for call in bind_operation(each, work, in_substeps=False)]
        if not len(readout.matrix):
            return []
        number = numbers.dtype
        summed = np.empty((len(readout.matrix), numbers.shape[1]), dtype=number)
        matrix = readout.matrix.astype(number)
        product = partial(matrix.dot, numbers[readout.first : readout.first + matrix.shape[1]], summed)
        low, high = (
            np.array(np.broadcast_to(limit, summed.shape), dtype=number)
            for limit in (readout.low, readout.high)
        )
        return [
            product,
            partial(np.maximum, summed, low, out=summed),
            partial(np.minimum, summed, high, out=numbers[slice(*self._layout.readouts)]),
        ]

    # --- states -------------------------------------------------------------------------------------------

    def load(self, state: State) -> None:
        """Take over a state."""
        for block in self._blocks:
            block.numbers[self._output_places] = state.output[block.members].T
            self._activations.load(block.arguments, state.activation[block.members])
            block.numbers[slice(*self._layout.readouts)] = state.readout[block.members].T
        self._readout[...] = state.readout.T
        self._given[...] = state.activation
        self._loaded = self._time = state.time
        self._push()

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one; all but the seeds."""
        self.store_output(state.output)
        self._store_activation(state.activation)
        state.readout[...] = self.readout
        state.time = self._time

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs into an array of shape (B, n_neurons)."""
        self._pull()
        for block in self._blocks:
            output[block.members] = block.numbers.take(self._output_places, 0).T

    def _store_activation(self, activation: FloatArray) -> None:
        if self._time == self._loaded:
            activation[...] = self._given
            return
        for block in self._blocks:
            self._activations.store(block.arguments, activation[block.members])

    def run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray) -> int:
        """Do T control steps and record rows of the table."""
        program, batch = self._program, self.batch
        n, m = len(program.activation_rows), len(program.output_names)
        first = (program.activation_rows, program.output_rows, np.arange(*program.readout_rows))
        column = {row: i for i, row in enumerate(np.concatenate(first).tolist())}
        columns = np.array([column[row] for row in rows.tolist()], dtype=np.intp)
        everything = np.empty((batch, 2 * n + m))
        own, advance = self.inputs, self.advance
        for step, (given, taken) in enumerate(zip(inputs, record, strict=True)):
            own[...] = given
            if not advance():
                return step
            self.store_output(everything[:, n : 2 * n])
            self._store_activation(everything[:, :n])
            everything[:, 2 * n :] = self.readout
            everything.take(columns, 1, taken, "clip")
        return len(inputs)


def _function_call(
    function: str, x: FloatArray, result: FloatArray
) -> tuple[Callable[..., object], tuple[FloatArray, ...]]:
    """Return a call that does a function, and its arguments."""
    match function:
        case "sigmoid":
            return expit, (x, result)
        case "tanh":
            return np.tanh, (x, result)
        case "heaviside":
            return np.heaviside, (x, np.ones_like(x), result)
        case str() as name if name == IDENTITY:
            return np.positive, (x, result)
    return partial(np.maximum, out=result), (x, np.zeros_like(x))


def _function_calls(
    function: str, x: FloatArray, result: FloatArray, *, mirrored: bool
) -> list[Callable[[], object]]:
    """Yield calls of a function for a batch; if x is mirrored, 1 / (1 + exp(x)) by numpy's exp."""
    if function == "sigmoid" and mirrored:
        one = np.ones((), dtype=x.dtype)
        return [
            partial(np.exp, x, result),
            partial(np.add, result, one, result),
            partial(np.divide, one, result, result),
        ]
    call, arguments = _function_call(function, x, result)
    return [partial(call, *arguments)]


def _silently(function: Callable[[], bool]) -> Callable[[], bool]:
    """Silence a function's warnings once; `np.errstate` would cost as much as five operations."""
    silent = contextvars.copy_context()
    silent.run(np.seterr, all="ignore")
    return partial(silent.run, function)
