"""What to say when a step gave something that is not finite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from circuitkit.base.errors import DivergedError
from circuitkit.engine.operations import FloatArray
from circuitkit.engine.program import Program
from circuitkit.engine.state import State


def raise_for(program: Program, inputs: FloatArray, state: State) -> NoReturn:
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
            raise DivergedError(message)
    message = f"the circuit '{program.name}' diverged in step {state.time - 1}"
    raise DivergedError(message)
