"""Numpy backend: a tick is a short list of ufunc calls on preallocated arrays, bound to their operands once.

Arrays are rows by batch, shape (rows, B), so that every block of neurons is contiguous whatever the batch
size. Sums are added term by term in the program's order (docs/decisions/0004), so that a member of a batch
gets the same bits as one alone. Floating-point warnings are off during a tick: NaN and infinity are carried
along the synapses in silence.
"""

from __future__ import annotations

import contextvars
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.engine.backends.numpy_expression import bind_expression
from circuitkit.engine.state import FloatArray, State

if TYPE_CHECKING:
    from circuitkit.engine.layout import Block
    from circuitkit.engine.program import Gather, Program, Readout

Operation: TypeAlias = Callable[[], object]
_MAX_CHAIN = 4


def make_kernel(program: Program, batch: int) -> NumpyKernel:
    """A kernel with a zero state for B = `batch` copies of the circuit."""
    return NumpyKernel(program, batch)


class NumpyKernel:
    """A program bound to arrays of one batch size; see `circuitkit.engine.backends.Kernel`."""

    def __init__(self, program: Program, batch: int) -> None:
        n_inputs, n, m = len(program.input_names), len(program.neuron_of_row), len(program.output_names)
        sources = np.zeros((1 + n_inputs + n + len(program.held), batch))
        self.batch = batch
        self.inputs: FloatArray = sources[1 : 1 + n_inputs].T
        self._activation = np.zeros((n, batch))
        self._output = sources[1 + n_inputs : 1 + n_inputs + n]
        self._readout = np.zeros((m, batch))
        self.readout: FloatArray = self._readout.T
        self.readout.flags.writeable = False
        self._row_of_neuron, self._neuron_of_row = program.row_of_neuron.copy(), program.neuron_of_row.copy()
        self._operations: tuple[Operation, ...] = (
            *_hold(program, self._output, sources[1 + n_inputs + n :]),
            *_neurons(program, sources, self._activation, self._output),
            *_read_out(program.readout, sources, self._readout),
        )
        silent = contextvars.copy_context()  # `np.errstate` would cost as much as five operations
        silent.run(np.seterr, all="ignore")
        self.advance: Operation = partial(silent.run, _do_all, self._operations)

    def load(self, state: State) -> None:
        """Take over a state."""
        np.take(state.activation.T, self._neuron_of_row, 0, out=self._activation)
        np.take(state.output.T, self._neuron_of_row, 0, out=self._output)
        self._readout[...] = state.readout.T

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one."""
        state.activation[...] = self._activation.take(self._row_of_neuron, 0).T
        state.output[...] = self._output.take(self._row_of_neuron, 0).T
        state.readout[...] = self.readout

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs into an array of shape (B, n_neurons)."""
        output[...] = self._output.take(self._row_of_neuron, 0).T


def _do_all(operations: Iterable[Operation]) -> None:
    for operation in operations:
        operation()


def _hold(program: Program, output: FloatArray, held: FloatArray) -> Iterable[Operation]:
    if len(held):
        yield _take(output, program.held, held)


def _neurons(
    program: Program, sources: FloatArray, activation: FloatArray, output: FloatArray
) -> Iterable[Operation]:
    for stage in program.stages:
        bound = [
            _gather(
                gather,
                sources,
                activation[gather.start : gather.stop],
                at_once=not program.outputs_first,
            )
            for gather in stage.gathers
        ]
        read = [operation for fetch, _ in bound for operation in fetch]
        add = [operation for _, total in bound for operation in total]
        functions = [operation for block in stage.blocks for operation in _block(block, activation, output)]
        yield from (*read, *functions, *add) if program.outputs_first else (*read, *add, *functions)


def _gather(
    gather: Gather, sources: FloatArray, total: FloatArray, *, at_once: bool
) -> tuple[list[Operation], list[Operation]]:
    """Two lists of operations: fetch the terms of eq. 11, and add them up into `total`, shape (n, B).

    `at_once` says that nothing changes the sources between the two.
    """
    signs = [_common_sign(weights) for weights in gather.weights]
    if all(signs) and signs[0] > 0:
        return _plain_sum(gather, signs, sources, total, at_once=at_once)
    terms = np.empty((*gather.sources.shape, total.shape[1]))
    weights = _per_member(gather.weights, total.shape[1])
    source_rows = gather.sources.ravel()
    if at_once and _are_neighbours(source_rows):
        block = sources[source_rows[0] : source_rows[-1] + 1].reshape(terms.shape)
        return [partial(np.multiply, block, weights, terms)], _add_products(terms, total)
    fetch: list[Operation] = [_take(sources, gather.sources, terms)]
    if len(terms) == 1:
        return fetch, [partial(np.multiply, terms[0], weights[0], total)]
    return [*fetch, partial(np.multiply, terms, weights, terms)], _add_products(terms, total)


def _plain_sum(
    gather: Gather, signs: Sequence[int], sources: FloatArray, total: FloatArray, *, at_once: bool
) -> tuple[list[Operation], list[Operation]]:
    """As `_gather`, for weights of +1 and -1: no products, and no copies of rows that are neighbours already.

    An addition or a subtraction gives every bit that adding the product would.
    """
    if at_once and len(signs) == 1:
        return [], [_take(sources, gather.sources[0], total)]
    views = {j: rows for j, rows in enumerate(gather.sources) if at_once and _are_neighbours(rows)}
    others = [j for j in range(len(signs)) if j not in views]
    taken = np.empty((len(others), *total.shape))
    terms = {j: sources[rows[0] : rows[-1] + 1] for j, rows in views.items()}
    terms |= dict(zip(others, taken, strict=True))
    fetch: list[Operation] = [_take(sources, gather.sources[others], taken)] if others else []
    return fetch, _add_in_order([terms[j] for j in range(len(signs))], signs, total)


def _take(sources: FloatArray, rows: npt.NDArray[np.intp], target: FloatArray) -> Operation:
    return partial(
        sources.take, rows.copy(), 0, target, "clip"
    )  # a read-only index would be copied each time


def _common_sign(weights: FloatArray) -> int:
    """1 or -1 if all weights are just that, else 0."""
    return int(weights[0]) if weights[0] in {1.0, -1.0} and (weights == weights[0]).all() else 0


def _are_neighbours(rows: npt.NDArray[np.intp]) -> bool:
    return bool((np.diff(rows) == 1).all())


def _add_products(terms: FloatArray, total: FloatArray) -> list[Operation]:
    """Add terms of shape (k, n, B) along the first axis, one after the other.

    `np.add.reduce` does this along an axis that is not the fastest one in memory; with n B = 1 the first axis
    is the fastest, and numpy would add in another order.
    """
    if len(terms) > _MAX_CHAIN and total.size > 1:
        return [partial(np.add.reduce, terms, 0, None, total)]
    return _add_in_order(list(terms), [1] * len(terms), total)


def _add_in_order(terms: Sequence[FloatArray], signs: Sequence[int], total: FloatArray) -> list[Operation]:
    """Add (sign 1) or subtract (sign -1) terms of shape (n, B), one after the other."""
    first, *others = terms
    if not others:
        return [partial(np.copyto, total, first)]
    # Sums stand in turn in two arrays: numpy is slow where an array of one element is operand and result.
    places = [total if (len(others) - i) % 2 else np.empty_like(total) for i in range(len(others))]
    before = [first, *places]
    return [
        partial(np.add if sign > 0 else np.subtract, summed, term, place)
        for sign, summed, term, place in zip(signs[1:], before, others, places, strict=False)
    ]


def _block(block: Block, activation: FloatArray, output: FloatArray) -> list[Operation]:
    count = block.stop - block.start
    rows = slice(block.start, block.stop)
    batch = activation.shape[1]
    variables = {name: output[start : start + count] for name, start in block.reads_output.items()}
    if block.reads_activation:
        variables[block.reads_activation] = activation[rows]
    constants = {name: _per_member(value, batch) for name, value in block.constants.items()}
    return bind_expression(block.equation, constants, variables, output[rows])


def _read_out(readout: Readout, sources: FloatArray, result: FloatArray) -> Iterable[Operation]:
    total = np.empty_like(result)
    batch = result.shape[1]
    for gather in readout.gathers:
        fetch, add = _gather(gather, sources, total[gather.start : gather.stop], at_once=True)
        yield from (*fetch, *add)
    keep = _per_member(readout.keep, batch)
    for start, stop in readout.integrating:
        rows = slice(start, stop)
        kept, summed = np.empty_like(total[rows]), np.empty_like(total[rows])
        yield partial(np.multiply, result[rows], keep[rows], kept)
        if (start, stop) == (0, len(total)):
            yield partial(np.add, kept, total, summed)
            total = summed
        else:
            yield partial(np.add, kept, total[rows], total[rows])
    if len(result):
        low, high = _per_member(readout.low, batch), _per_member(readout.high, batch)
        yield partial(total.clip, low, high, result)


def _per_member(values: FloatArray, batch: int) -> FloatArray:
    """Values of shape (...,) repeated for each member, shape (..., B): numpy is slower when it broadcasts."""
    repeated: npt.NDArray[np.float64] = np.repeat(values[..., np.newaxis], batch, axis=-1)
    return repeated
