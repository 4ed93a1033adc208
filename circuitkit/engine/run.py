"""Step a program: `step` (pure), `run` (many ticks in one call) and `Stepper` (in place, for loops)."""

from __future__ import annotations

from circuitkit.engine.checks import as_run_inputs, require_step_inputs
from circuitkit.engine.program import Program
from circuitkit.engine.state import FloatArray, State, Trace
from circuitkit.errors import InputError, Problem


def step(program: Program, state: State, inputs: FloatArray, out: State | None = None) -> State:
    """Do one tick (eqs. 11 and 12, in the timing of the circuit) and return the new state.

    NaN and infinity are not looked for: they pass, without a warning, along the synapses to every neuron they
    reach. `program.check_inputs` finds them.

    Args:
        program: The compiled circuit.
        state: The state before the tick; not changed.
        inputs: Shape (B, n_inputs), [SI].
        out: A state whose arrays take the result; may be `state` itself. None makes new arrays.

    Raises:
        InputError: The shape of the inputs or of a state does not fit.
    """
    batch = state.batch
    _require_state(program, state, batch, "state")
    require_step_inputs(inputs, batch, program.input_names)
    result = program.initial_state(batch) if out is None else out
    if out is not None:
        _require_state(program, out, batch, "out")
    kernel = program.borrow_kernel(batch)
    kernel.load(state)
    kernel.inputs[...] = inputs
    kernel.advance()
    kernel.store(result)
    program.return_kernel(kernel)
    return result


def run(program: Program, inputs: FloatArray, state: State | None = None, *, check: bool = True) -> Trace:
    """Do T ticks and record everything.

    Args:
        program: The compiled circuit.
        inputs: Shape (T, B, n_inputs), [SI].
        state: The state before the first tick; by default the initial one.
        check: Refuse inputs that are not finite, instead of carrying them through.

    Raises:
        InputError: A shape does not fit, or `check` finds a NaN or an infinity (its input and step are
            named).
    """
    inputs = as_run_inputs(inputs, program.input_names)
    if check:
        program.check_inputs(inputs)
    ticks, batch, _ = inputs.shape
    before = program.initial_state(batch) if state is None else state
    _require_state(program, before, batch, "state")
    n, m = len(program.neuron_names), len(program.output_names)
    record = State.zeros(ticks, batch, neurons=n, outputs=m)
    last = before.copy()
    kernel = program.borrow_kernel(batch)
    kernel.load(before)
    for u, a, o, y in zip(inputs, record.activation, record.output, record.readout, strict=True):
        kernel.inputs[...] = u
        kernel.advance()
        kernel.store(State(a, o, y))
    kernel.store(last)
    program.return_kernel(kernel)
    return Trace(record.activation, record.output, record.readout, last)


class Stepper:
    """Steps `B` copies of a circuit in arrays of its own; starts at the initial state, one thread at a time.

    Either `stepper.step(inputs)`, or write into `stepper.inputs` and call `stepper.step()`.

    Attributes:
        program: The compiled circuit.
        batch: Number of copies B.
        inputs: The inputs of the next tick, to be written in place, shape (B, n_inputs), [SI].
        readout: Outputs of the circuit after the last tick, a read-only view of shape (B, n_outputs), [SI].
    """

    def __init__(self, program: Program, batch: int) -> None:
        self._kernel = program.new_kernel(batch)
        self._advance = self._kernel.advance
        self.program = program
        self.batch = batch
        self.inputs = self._kernel.inputs
        self.readout = self._kernel.readout

    def step(self, inputs: FloatArray | None = None) -> FloatArray:
        """Do one tick.

        NaN and infinity are not looked for; see `circuitkit.engine.step`.

        Args:
            inputs: Shape (B, n_inputs), [SI]; None takes what stands in `self.inputs`.

        Returns:
            `self.readout`: a view, which the next step overwrites.

        Raises:
            InputError: The inputs have another shape.
        """
        if inputs is not None:
            own = self.inputs
            if getattr(inputs, "shape", None) != own.shape:
                require_step_inputs(inputs, self.batch, self.program.input_names)
            own[...] = inputs
        self._advance()
        return self.readout

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs after the last tick into an array of shape (B, n_neurons)."""
        self._kernel.store_output(output)

    @property
    def state(self) -> State:
        """A copy of the state; assign one to go on from it."""
        state = self.program.initial_state(self.batch)
        self._kernel.store(state)
        return state

    @state.setter
    def state(self, state: State) -> None:
        _require_state(self.program, state, self.batch, "state")
        self._kernel.load(state)

    def reset(self) -> None:
        """Go back to the initial state."""
        self._kernel.load(self.program.initial_state(self.batch))


def _require_state(program: Program, state: State, batch: int, where: str) -> None:
    n, m = len(program.neuron_names), len(program.output_names)
    found = (state.activation.shape, state.output.shape, state.readout.shape)
    wanted = ((batch, n), (batch, n), (batch, m))
    if found != wanted:
        message = f"found arrays of shapes {found}; allowed: {wanted}, for the circuit '{program.name}'"
        raise InputError(Problem("", 0, 0, where, message))
