"""Step a program: `step` (pure), `run` (many steps in one call) and `Stepper` (in place, for loops)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NoReturn

import numpy as np

from circuitkit.base.errors import DivergedError
from circuitkit.circuit.memory import require_memory
from circuitkit.engine.backends import borrow_kernel, return_kernel
from circuitkit.engine.operations import FloatArray, IndexArray
from circuitkit.engine.program import Program, Trace, as_run_inputs, require_batch, require_step_inputs
from circuitkit.engine.record import select
from circuitkit.engine.state import State, require_state


def step(program: Program, state: State, inputs: FloatArray, out: State | None = None) -> State:
    """Do one control step and return the new state.

    Args:
        program: The compiled circuit.
        state: The state before the step; not changed.
        inputs: Shape (B, n_inputs), [SI].
        out: A state whose arrays take the result; may be `state` itself. None makes new arrays.

    Raises:
        InputError: The shape of the inputs or of a state does not fit, or an input is not finite.
        DivergedError: A number that is not finite came out.
    """
    require_state(state, program.layout, None, "state", finite=False)
    batch = require_batch(state.batch, program.members)
    require_step_inputs(inputs, batch, program.input_names)
    result = program.initial_state(batch) if out is None else out
    if out is not None:
        require_state(out, program.layout, batch, "out", finite=False, writable=True)
    kernel = borrow_kernel(program, batch)
    kernel.load(state)
    kernel.inputs[...] = inputs
    is_finite = kernel.advance()
    kernel.store(result)
    result.seed[...] = state.seed
    return_kernel(program, kernel)
    if not is_finite:
        if result is not state:
            require_state(state, program.layout, batch, "state", finite=True)
        _raise_for(program, inputs, result)
    return result


def run(
    program: Program,
    inputs: FloatArray,
    state: State | None = None,
    *,
    record: Iterable[str] | None = None,
    states: bool = False,
) -> Trace:
    """Do T control steps and record them.

    Args:
        program: The compiled circuit.
        inputs: Shape (T, B, n_inputs), [SI].
        state: The state before the first step; by default the initial one.
        record: Names of neurons, populations, outputs, or states such as `ring[3].v`; by default all neurons
            and all outputs.
        states: Whether to record all states besides.

    Raises:
        InputError: A shape does not fit, an input is not finite (its name and step are named), or there is
            nothing of a name, or the recording needs more memory than the machine has.
        DivergedError: A number that is not finite came out; the step and the neuron are named.
    """
    inputs = as_run_inputs(inputs, program.input_names)
    program.check_inputs(inputs)
    selection = select(program, record, states=states)
    steps, batch, _ = inputs.shape
    before = program.initial_state(batch) if state is None else state
    require_batch(batch, program.members)
    require_state(before, program.layout, batch, "state", finite=True)
    width = len(selection.rows)
    found = f"{steps} steps of {batch} times {width} values"
    require_memory("record", found, 8.0 * steps * batch * width)
    recorded = np.empty((steps, batch, width))
    last = before.copy()
    kernel = borrow_kernel(program, batch)
    kernel.load(before)
    done = kernel.run(np.ascontiguousarray(inputs), selection.rows, recorded)
    kernel.store(last)
    return_kernel(program, kernel)
    if done < steps:
        _raise_for(program, inputs[done], last)
    n, m = len(selection.neurons), len(selection.outputs)
    return Trace(
        activation=recorded[..., :n],
        output=recorded[..., n : 2 * n],
        readout=recorded[..., 2 * n : 2 * n + m],
        states=recorded[..., 2 * n + m :],
        state=last,
        neuron_names=_chosen(program.neuron_names, selection.neurons),
        output_names=_chosen(program.output_names, selection.outputs),
        state_names=_chosen(program.state_names, selection.states),
    )


def _chosen(names: Sequence[str], columns: IndexArray) -> Sequence[str]:
    is_all = np.array_equal(columns, np.arange(len(names)))
    return names if is_all else tuple(names[int(i)] for i in columns)


class Stepper:
    """Steps `B` copies of a circuit in arrays of its own; one thread at a time.

    Either `stepper.step(inputs)`, or write into `stepper.inputs` and call `stepper.step()`.

    Attributes:
        program: The compiled circuit.
        batch: Number of copies B.
        inputs: The inputs of the next step, to be written in place, shape (B, n_inputs), [SI].
        readout: Outputs of the circuit after the last step, a read-only view of shape (B, n_outputs), [SI].
    """

    def __init__(self, program: Program, batch: int | None = None, seed: int = 0) -> None:
        """Begin at the initial state.

        Args:
            program: The compiled circuit.
            batch: Number of copies; by default as many as a sweep has members, else 1.
            seed: Of the noise: copy b has the seed `seed + b`.

        Raises:
            InputError: As `Program.initial_state`.
        """
        state = program.initial_state(batch, seed)
        self._seed = state.seed
        self._kernel = borrow_kernel(program, state.batch)
        self._advance = self._kernel.advance
        self.program = program
        self.batch = state.batch
        self.inputs = self._kernel.inputs
        self.readout = self._kernel.readout
        bind_step = getattr(self._kernel, "bind_step", None)
        bound = None if bind_step is None else bind_step(self._take, self._fail)
        if bound is not None:
            self.step = bound  # type: ignore[method-assign]  # the same in one call
        self._kernel.load(state)

    def step(self, inputs: FloatArray | None = None) -> FloatArray:
        """Do one control step.

        Args:
            inputs: Shape (B, n_inputs), [SI]; None takes what stands in `self.inputs`.

        Returns:
            `self.readout`: a view, which the next step overwrites.

        Raises:
            InputError: The inputs have another shape, or one is not finite; the state is then of no more use.
            DivergedError: A number that is not finite came out.
        """
        if inputs is not None:
            self._take(inputs)
        if not self._advance():
            self._fail()
        return self.readout

    def _take(self, inputs: FloatArray) -> None:
        own = self.inputs
        if getattr(inputs, "shape", None) != own.shape:
            require_step_inputs(inputs, self.batch, self.program.input_names)
        own[...] = inputs

    def _fail(self) -> NoReturn:
        _raise_for(self.program, self.inputs, self.state)

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs after the last step into an array of shape (B, n_neurons)."""
        self._kernel.store_output(output)

    @property
    def state(self) -> State:
        """A copy of the state; assign one to go on from it."""
        state = self.program.initial_state(self.batch)
        self._kernel.store(state)
        state.seed = self._seed.copy()
        return state

    @state.setter
    def state(self, state: State) -> None:
        require_state(state, self.program.layout, self.batch, "state", finite=True)
        self._seed = state.seed.copy()
        self._kernel.load(state)

    def reset(self) -> None:
        """Go back to the initial state, with the seeds as they are."""
        state = self.program.initial_state(self.batch)
        state.seed = self._seed
        self._kernel.load(state)


def _raise_for(program: Program, inputs: FloatArray, state: State) -> NoReturn:
    """Say what is not finite after a step.

    Args:
        program: The compiled circuit.
        inputs: The inputs of the step, shape (B, n_inputs), [SI].
        state: The state after it.

    Raises:
        InputError: It is an input; named with the member of the batch.
        DivergedError: It is something else: the step, the neuron or output, and the member of the batch.
    """
    program.check_inputs(inputs)
    places: tuple[tuple[str, Sequence[str], FloatArray], ...] = (
        ("state", program.state_names, state.states),
        ("activation of", program.neuron_names, state.activation),
        ("output of", program.neuron_names, state.output),
        ("output", program.output_names, state.readout),
    )
    for kind, names, values in places:
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            member, column = (int(i) for i in bad[0])
            message = (
                f"the circuit '{program.name}' diverged: in step {state.time - 1} the {kind} "
                f"{names[column]} of batch member {member} became {values[member, column]}"
            )
            if program.precision == "float32":
                message += "; float32 holds numbers up to 3.4e38, float64 larger ones"
            raise DivergedError(message)
    message = f"the circuit '{program.name}' diverged in step {state.time - 1}"
    raise DivergedError(message)
