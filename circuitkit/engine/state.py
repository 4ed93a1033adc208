"""`State`: what copies of a circuit remember from step to step, and whether a state belongs to a program."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import InputError, Problem
from circuitkit.engine.operations import FloatArray, Remember

Form: TypeAlias = tuple[tuple[int, ...], np.dtype[Any]]  # of an array: shape and type
_NUMBER, _SEED = np.dtype(np.float64), np.dtype(np.uint64)
_VERSION = 1  # of what a state holds: one that was kept by a circuitkit with another number does not fit


@dataclass(frozen=True, eq=False)
class Layout:
    """What stands in the columns of a program's states; a state keeps the layout that it was made for.

    Attributes:
        neurons: Names of the neurons.
        outputs: Names of the outputs of the circuit.
        states: Names of the states of neurons and synapses.
        memories: What fills the memories of delayed values.
    """

    neurons: Sequence[str]
    outputs: Sequence[str]
    states: Sequence[str]
    memories: tuple[Remember, ...]
    _forms: dict[int, dict[str, Form]] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def marks(self) -> dict[str, str]:
        """A hash for every part; what is pickled, for names may be many, and what two layouts agree in."""
        delays = (f"{memory.depth} {memory.sources.tolist()}" for memory in self.memories)
        parts = {
            "neurons": self.neurons,
            "outputs": self.outputs,
            "states": self.states,
            "delays": delays,
            "version": [str(_VERSION)],
        }
        return {part: hashlib.sha256("\n".join(names).encode()).hexdigest() for part, names in parts.items()}

    def forms(self, batch: int) -> dict[str, Form]:
        """Return the shape and type of every array in a state of B = `batch` copies, seeds last."""
        if batch not in self._forms:
            n = len(self.neurons)
            widths = {"activation": n, "output": n, "readout": len(self.outputs), "states": len(self.states)}
            shapes: dict[str, tuple[int, ...]] = {name: (batch, width) for name, width in widths.items()}
            for number, memory in enumerate(self.memories):
                shapes[f"histories[{number}]"] = (batch, memory.depth, len(memory.sources))
            self._forms[batch] = {name: (shape, _NUMBER) for name, shape in shapes.items()}
            self._forms[batch]["seed"] = (batch,), _SEED
        return self._forms[batch]

    def __reduce__(self) -> tuple[Any, ...]:
        return _Marked, (self.marks,)


@dataclass(frozen=True, eq=False)
class _Marked:
    """A layout that comes from a pickle."""

    marks: dict[str, str]


@dataclass(eq=False)
class State:
    """What `B` independent copies of a circuit remember from step to step; columns in file order.

    Attributes:
        activation: Activation A of every neuron (eq. 11), shape (B, n_neurons), [SI unit of its activation].
        output: Output O of every neuron (eq. 12), shape (B, n_neurons), dimensionless.
        readout: Outputs of the circuit, which integrating ones add to, shape (B, n_outputs), [SI].
        states: States of neurons and synapses, in the order of the program's `state_rows`, shape
            (B, n_states), [SI].
        histories: For every memory the values of the past, the newest first, shape (B, depth, n_slots).
        time: Number of control steps done.
        seed: Seed of the noise of every copy, shape (B,).
        layout: What the columns are; None if it is not known, as of arrays that somebody put together.
    """

    activation: FloatArray
    output: FloatArray
    readout: FloatArray
    states: FloatArray
    histories: tuple[FloatArray, ...]
    time: int
    seed: npt.NDArray[np.uint64]
    layout: Layout | _Marked | None = field(default=None, repr=False)

    @property
    def batch(self) -> int:
        """Number of copies B."""
        return len(self.activation)

    def arrays(self) -> tuple[FloatArray, ...]:
        """Return all arrays of numbers that the circuit computes, each with the batch as its first axis."""
        return (self.activation, self.output, self.readout, self.states, *self.histories)

    def copy(self) -> State:
        """Return the same values in arrays of its own."""
        return State(
            self.activation.copy(),
            self.output.copy(),
            self.readout.copy(),
            self.states.copy(),
            tuple(history.copy() for history in self.histories),
            self.time,
            self.seed.copy(),
            self.layout,
        )


def require_state(
    state: State, layout: Layout, batch: int | None, where: str, *, finite: bool, writable: bool = False
) -> None:
    """Require a state that belongs to a program, as a whole.

    Args:
        state: The state.
        layout: That of the program.
        batch: Number of copies; None for any.
        where: What the state is called in the message.
        finite: Whether its numbers must be finite.
        writable: Whether its arrays must be such that they can be written.

    Raises:
        InputError: It is none, or an array, the time or a seed does not fit; the first thing is named.
    """
    complaint = next(_complaints(state, layout, batch, finite=finite, writable=writable), "")
    if complaint:
        raise InputError(Problem("", 0, 0, where, complaint, "a state fits the circuit that it was made for"))


def _complaints(
    state: State, layout: Layout, batch: int | None, *, finite: bool, writable: bool
) -> Iterator[str]:
    if not isinstance(state, State):
        yield f"found {type(state).__name__}; allowed: a State, such as Program.initial_state gives"
        return
    size = batch if batch is not None else next(iter(getattr(state.activation, "shape", ())), 0)
    wanted = layout.forms(size)
    yield from _misfits(state, wanted)
    if writable and not all(array.flags.writeable for array in (*state.arrays(), state.seed)):
        yield "found arrays that cannot be written; allowed: arrays to write to"
    if not isinstance(state.time, int | np.integer) or state.time < 0:
        yield f"found time {state.time!r}; allowed: a whole number of control steps from 0"
    if state.layout is not None and state.layout is not layout:
        own = state.layout.marks
        for part, mark in layout.marks.items():
            if own.get(part) != mark:
                yield f"found a state with other {part} than the circuit's; allowed: the same"
    for name, array in zip(wanted, state.arrays(), strict=False) if finite else ():
        yield from _not_finite(name, array, layout)


def _misfits(state: State, wanted: Mapping[str, Form]) -> Iterator[str]:
    """Say which arrays are of another shape or type."""
    found = (*state.arrays(), state.seed)
    if [(getattr(array, "shape", ()), getattr(array, "dtype", None)) for array in found] == [
        *wanted.values()
    ]:
        return
    if len(found) != len(wanted):
        number, allowed = len(state.histories), len(wanted) + len(state.histories) - len(found)
        yield f"found delayed values of {number} memories; allowed: {allowed}, as many as the circuit has"
    for (name, (shape, number_type)), array in zip(wanted.items(), found, strict=True):
        if not isinstance(array, np.ndarray):
            yield f"found {name} of the type {type(array).__name__}; allowed: an array of shape {shape}"
        elif array.shape != shape:
            yield f"found {name} of shape {array.shape}; allowed: {shape}"
        elif array.dtype != number_type:
            yield f"found {name} of {array.dtype}; allowed: {number_type}"


def _not_finite(name: str, array: FloatArray, layout: Layout) -> Iterator[str]:
    if np.isfinite(array).all():
        return
    place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
    columns = {"readout": layout.outputs, "states": layout.states}.get(name, layout.neurons)
    of = "" if name.startswith("histories") else f" of {columns[place[-1]]}"
    yield f"found {array[place]} as {name}{of} of batch member {place[0]}; allowed: finite numbers"
