"""A compiled circuit: operations on frozen arrays, names bound to indices once.

`Program` is the circuit, `Trace` what it did over many steps; `State`, what it remembers, is in `state`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.engine.operations import FloatArray, IndexArray, Lowered, Operation, Remember
from circuitkit.engine.state import Layout, State

_STEP_AXES = 2
_RUN_AXES = 3
_LARGEST_SEED = 2**64 - 1


Precision = Literal["float64", "float32"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Program(Lowered):
    """A compiled circuit. Names and columns that a user meets are in file order; rows are an inner matter.

    A control step: write the inputs into rows 1 ... n_inputs; do `before`; `substeps` times `substep`;
    `after`.

    Attributes (beside those of `Lowered`):
        name: Name of the circuit.
        step_s: Control step, [s].
        substeps: How often `substep` is done in a control step.
        input_names: In file order.
        neuron_names: In file order; formatted when they are asked for if there are populations.
        output_names: In file order.
        members: Number B of circuits in a sweep, which all differ in constants; 0 for one circuit.
        backend: Name of the backend.
        precision: In which all is computed.
        reproducible: Whether a member of a batch gets the same bits whatever the size of the batch.
        note: Which backend runs it, and why that one; empty if there was no choice.
        idle: Kernels between two calls of `step` or `run`, by batch size; they go when the program does.
    """

    name: str
    step_s: float
    substeps: int
    input_names: Sequence[str]
    neuron_names: Sequence[str]
    output_names: Sequence[str]
    members: int = 0
    backend: str = "numpy"
    precision: Precision = "float64"
    reproducible: bool = True
    note: str = ""
    idle: dict[int, list[Any]] = field(default_factory=dict, init=False, repr=False)

    @property
    def operations(self) -> tuple[Operation, ...]:
        """All of them."""
        return (*self.before, *self.substep, *self.after)

    @property
    def memories(self) -> tuple[Remember, ...]:
        """What fills each memory, by its number."""
        found = [operation for operation in self.operations if isinstance(operation, Remember)]
        return tuple(sorted(found, key=lambda operation: operation.memory))

    @cached_property
    def layout(self) -> Layout:
        """What stands in the columns of its states."""
        return Layout(self.neuron_names, self.output_names, self.state_names, self.memories)

    @cached_property
    def input_index(self) -> Mapping[str, int]:
        """Column of each input."""
        return {name: i for i, name in enumerate(self.input_names)}

    @cached_property
    def neuron_index(self) -> Mapping[str, int]:
        """Column of each neuron."""
        return {name: i for i, name in enumerate(self.neuron_names)}

    @cached_property
    def output_index(self) -> Mapping[str, int]:
        """Column of each output of the circuit."""
        return {name: i for i, name in enumerate(self.output_names)}

    def initial_state(self, batch: int | None = None, seed: int = 0) -> State:
        """Return the state before the first step.

        Args:
            batch: Number of copies B; by default as many as a sweep has members, else 1.
            seed: Of the noise: copy b has the seed `seed + b`.

        Raises:
            InputError: `batch` is not at least 1, or not the number of members of a sweep, or the seed is
                negative or has more than 64 bits.
        """
        size = require_batch(batch, self.members)
        require_seed(seed)
        first = self.initial if self.initial.ndim > 1 else self.initial[:, np.newaxis]

        def begin(rows: IndexArray | slice) -> FloatArray:
            values = first[rows].T
            copies = np.empty((size, values.shape[1]))
            copies[...] = values
            return copies

        def past(memory: Remember) -> FloatArray:
            return np.repeat(begin(memory.sources)[:, np.newaxis], memory.depth, axis=1)

        return State(
            activation=begin(self.activation_rows),
            output=begin(self.output_rows),
            readout=begin(slice(*self.readout_rows)),
            states=begin(self.state_rows),
            histories=tuple(past(memory) for memory in self.memories),
            time=0,
            seed=np.uint64(seed) + np.arange(size, dtype=np.uint64),
            layout=self.layout,
        )

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
        """Find values that are not finite, which no step accepts.

        Args:
            inputs: Shape (B, n_inputs) or (T, B, n_inputs), [SI].

        Raises:
            InputError: A wrong shape, or a NaN or infinity; names the input, the step and the member of the
                batch.
        """
        require_inputs(inputs, self.input_names)
        with np.errstate(over="ignore"):
            is_finite = np.isfinite(np.asarray(inputs).astype(self.precision, copy=False))
        if is_finite.all():
            return
        bad = np.argwhere(~is_finite)
        *step, member, column = (int(i) for i in bad[0])
        place = f"step {step[0]}, batch member {member}" if step else f"batch member {member}"
        found = inputs[tuple(bad[0])]
        largest = "" if self.precision == "float64" else ", up to 3.4e38 in float32"
        message = f"found {found} at {place}; allowed: finite numbers{largest}"
        hint = f"{len(bad) - 1} more are not finite" if len(bad) > 1 else ""
        raise InputError(Problem("", 0, 0, f"inputs.{self.input_names[column]}", message, hint))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the kernels, which are bound to memory, and what is made again."""
        return {name: value for name, value in self.__dict__.items() if name != "layout"} | {"idle": {}}


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


def lasting_rows(program: Program) -> npt.NDArray[np.bool_]:
    """Find which rows are inputs or survive a control step, shape (n_rows,)."""
    lasting = np.zeros(program.n_rows, dtype=np.bool_)
    lasting[1 : 1 + len(program.input_names)] = True
    lasting[slice(*program.readout_rows)] = True
    for rows in (program.activation_rows, program.output_rows, program.state_rows):
        lasting[rows] = True
    return lasting


def input_problem(message: str) -> InputError:
    """Return the error for inputs that do not fit."""
    return InputError(Problem("", 0, 0, "inputs", message))


def require_batch(batch: int | None, members: int) -> int:
    """Return the size of a batch: at least 1, and in a sweep the number of its members.

    Raises:
        InputError: It is another one.
    """
    size = members or 1 if batch is None else batch
    if size < 1 or members not in {0, size}:
        allowed = f"{members}, the number of circuits of the sweep" if members else "whole numbers from 1"
        raise InputError(Problem("", 0, 0, "batch", f"found {size}; allowed: {allowed}"))
    return size


def require_seed(seed: int) -> None:
    """Require a whole number of 64 bits without a sign.

    Raises:
        InputError: It is another one.
    """
    if not (isinstance(seed, int | np.integer) and 0 <= seed <= _LARGEST_SEED):
        message = f"found {seed}; allowed: whole numbers from 0 to {_LARGEST_SEED}"
        raise InputError(Problem("", 0, 0, "seed", message))


def require_inputs(inputs: FloatArray, names: Sequence[str]) -> None:
    """Require an array of shape (B, n_inputs) or (T, B, n_inputs).

    Raises:
        InputError: It is none, or the shape is another one.
    """
    found: tuple[int, ...] = getattr(inputs, "shape", ())
    if len(found) not in {_STEP_AXES, _RUN_AXES} or found[-1] != len(names):
        message = f"found {_shown(inputs)}; allowed: {_wanted('B', names)} or {_wanted('T, B', names)}"
        raise input_problem(message)


def require_step_inputs(inputs: FloatArray, batch: int, names: Sequence[str]) -> None:
    """Require an array of shape (B, n_inputs) with the batch size B of the state.

    Raises:
        InputError: It is none, or the shape is another one.
    """
    if getattr(inputs, "shape", ()) != (batch, len(names)):
        message = f"found {_shown(inputs)}; allowed: {_wanted(str(batch), names)}"
        raise input_problem(message)


def as_run_inputs(inputs: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return the inputs as an array of shape (T, B, n_inputs).

    Raises:
        InputError: The shape is another one.
    """
    array = np.asarray(inputs, dtype=np.float64)
    if array.ndim != _RUN_AXES or array.shape[-1] != len(names):
        message = f"found {_shown(array)}; allowed: {_wanted('T, B', names)}"
        raise input_problem(message)
    return array


def _shown(inputs: object) -> str:
    shape = getattr(inputs, "shape", None)
    return f"{type(inputs).__name__}" if shape is None else f"shape {shape}"


def _wanted(leading: str, names: Sequence[str]) -> str:
    columns = f" with the columns {', '.join(names)}" if names else ""
    return f"an array of shape ({leading}, {len(names)}){columns}"
