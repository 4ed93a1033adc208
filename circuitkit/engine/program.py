"""`Program`: a circuit as operations on frozen arrays, names bound to indices once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.engine.checks import input_problem, require_batch, require_inputs, require_seed
from circuitkit.engine.operations import FloatArray, IndexArray, Lowered, Operation, Remember
from circuitkit.engine.state import State

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
        is_finite = np.isfinite(inputs)
        if is_finite.all():
            return
        bad = np.argwhere(~is_finite)
        *step, member, column = (int(i) for i in bad[0])
        place = f"step {step[0]}, batch member {member}" if step else f"batch member {member}"
        found = inputs[tuple(bad[0])]
        message = f"found {found} at {place}; allowed: finite numbers"
        hint = f"{len(bad) - 1} more are not finite" if len(bad) > 1 else ""
        raise InputError(Problem("", 0, 0, f"inputs.{self.input_names[column]}", message, hint))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the kernels, which are bound to memory and are made again."""
        return {**self.__dict__, "idle": {}}
