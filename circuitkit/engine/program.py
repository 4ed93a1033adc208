"""`Program`: a circuit as frozen arrays, names bound to indices once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.engine.backends import Kernel, load_backend
from circuitkit.engine.checks import input_problem, require_batch, require_inputs
from circuitkit.engine.layout import Block
from circuitkit.engine.state import FloatArray, State
from circuitkit.errors import InputError, Problem, UnknownNameError

if TYPE_CHECKING:
    from circuitkit.engine.run import Stepper

IndexArray: TypeAlias = npt.NDArray[np.intp]
_MAX_IDLE_SIZES = 8


@dataclass(frozen=True, eq=False)
class Gather:
    """Weighted sums: row `start + i` gets terms `weights[j, i] * row[sources[j, i]]`, added in order of j.

    Attributes:
        start: First row that is summed.
        stop: The row after the last one.
        sources: Rows of the source table, shape (k, stop - start); short sums are filled up with row 0, which
            is zero.
        weights: Weights, shape (k, stop - start), [SI].
    """

    start: int
    stop: int
    sources: IndexArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Stage:
    """Neurons that are evaluated together: the sums of eq. 11, then the functions of eq. 12."""

    gathers: tuple[Gather, ...]
    blocks: tuple[Block, ...]


@dataclass(frozen=True, eq=False)
class Readout:
    """Outputs of the circuit: `y' = clip(keep * y + r, low, high)`; no first term if they do not integrate.

    Attributes:
        gathers: The weighted sums r, over rows in file order of the outputs.
        integrating: Ranges (start, stop) of rows that integrate.
        keep: `1 - leak`, shape (n_outputs,), dimensionless; 0 where nothing is integrated.
        low: Lower limits, shape (n_outputs,), [SI].
        high: Upper limits, shape (n_outputs,), [SI].
    """

    gathers: tuple[Gather, ...]
    integrating: tuple[tuple[int, int], ...]
    keep: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, eq=False)
class Program:
    """A compiled circuit. Names and indices that a user meets are in file order; rows are an inner matter.

    The source table, of which gathers speak, has the rows: zero, inputs, neurons (by stage and equation, see
    `circuitkit.engine.layout`), held outputs.

    Attributes:
        name: Name of the circuit.
        step_s: Control step, [s].
        input_names: In file order.
        neuron_names: In file order.
        output_names: In file order.
        stages: What is done in a tick, in order.
        readout: The outputs.
        neuron_of_row: Neuron of each of the neurons' rows, shape (n_rows,); at least one for each.
        row_of_neuron: First row of each neuron among the neurons' rows, shape (n_neurons,).
        held: Rows among the neurons' rows whose last output is kept during a tick, shape (n_held,).
        outputs_first: Whether an output follows from the last activation (timing `as_printed`).
        backend: Name of the backend.
    """

    name: str
    step_s: float
    input_names: tuple[str, ...]
    neuron_names: tuple[str, ...]
    output_names: tuple[str, ...]
    stages: tuple[Stage, ...]
    readout: Readout
    neuron_of_row: IndexArray
    row_of_neuron: IndexArray
    held: IndexArray
    outputs_first: bool
    backend: str
    _idle: dict[int, list[Kernel]] = field(default_factory=dict, init=False, repr=False)

    @property
    def input_index(self) -> Mapping[str, int]:
        """Column of each input."""
        return {name: i for i, name in enumerate(self.input_names)}

    @property
    def neuron_index(self) -> Mapping[str, int]:
        """Column of each neuron."""
        return {name: i for i, name in enumerate(self.neuron_names)}

    @property
    def output_index(self) -> Mapping[str, int]:
        """Column of each output of the circuit."""
        return {name: i for i, name in enumerate(self.output_names)}

    def initial_state(self, batch: int = 1) -> State:
        """The state before the first tick: activations, outputs and integrators all 0.

        Raises:
            InputError: `batch` is not at least 1.
        """
        require_batch(batch)
        return State.zeros(batch, neurons=len(self.neuron_names), outputs=len(self.output_names))

    def stepper(self, batch: int = 1) -> Stepper:
        """An object with arrays of its own that steps in place, for loops that count microseconds.

        Raises:
            InputError: `batch` is not at least 1.
        """
        from circuitkit.engine.run import Stepper

        require_batch(batch)
        return Stepper(self, batch)

    def pack_inputs(self, values: Mapping[str, npt.ArrayLike]) -> FloatArray:
        """Put inputs given by name side by side, in the order that `step` and `run` want.

        Args:
            values: A number or an array for every input, [SI]; arrays of different shapes are broadcast.

        Returns:
            Shape (1, n_inputs) from numbers, else (..., n_inputs).

        Raises:
            UnknownNameError: There is no input of that name.
            InputError: An input is missing, or shapes do not fit.
        """
        for name in values:
            if name not in self.input_names:
                kind = "input"
                raise UnknownNameError(kind, name, self.input_names)
        missing = [name for name in self.input_names if name not in values]
        if missing:
            message = f"found no value for {', '.join(missing)}; allowed: a value for every input"
            raise input_problem(message)
        columns = [np.asarray(values[name], dtype=np.float64) for name in self.input_names]
        try:
            shape = np.broadcast_shapes((1,), *(column.shape for column in columns))
        except ValueError:
            found = ", ".join(f"{n} {c.shape}" for n, c in zip(self.input_names, columns, strict=True))
            message = f"found shapes {found}; allowed: shapes that broadcast"
            raise input_problem(message) from None
        packed = np.empty((*shape, len(columns)))
        for i, column in enumerate(columns):
            packed[..., i] = column
        return packed

    def check_inputs(self, inputs: FloatArray) -> None:
        """Find values that are not finite, which `step` would carry through to every neuron they reach.

        Args:
            inputs: Shape (B, n_inputs) or (T, B, n_inputs), [SI].

        Raises:
            InputError: A wrong shape, or a NaN or infinity; names the input, the step and the member of the
                batch.
        """
        require_inputs(inputs, self.input_names)
        bad = np.argwhere(~np.isfinite(inputs))
        if not len(bad):
            return
        *step, member, column = (int(i) for i in bad[0])
        place = f"step {step[0]}, batch member {member}" if step else f"batch member {member}"
        found = inputs[tuple(bad[0])]
        message = f"found {found} at {place}; allowed: finite numbers"
        hint = f"{len(bad) - 1} more are not finite" if len(bad) > 1 else ""
        raise InputError(Problem("", 0, 0, f"inputs.{self.input_names[column]}", message, hint))

    def borrow_kernel(self, batch: int) -> Kernel:
        """A kernel that nobody else uses until it comes back by `return_kernel`; its state is undefined."""
        try:
            return self._idle.setdefault(batch, []).pop()
        except IndexError:
            return self.new_kernel(batch)

    def return_kernel(self, kernel: Kernel) -> None:
        """Keep a kernel for the next caller with the same batch size."""
        if len(self._idle) > _MAX_IDLE_SIZES:
            self._idle.clear()
        self._idle.setdefault(kernel.batch, []).append(kernel)

    def new_kernel(self, batch: int) -> Kernel:
        """A kernel of the program's backend with a zero state."""
        return load_backend(self.backend)(self, batch)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the kernels, which are bound to memory and are made again."""
        return {**self.__dict__, "_idle": {}}
