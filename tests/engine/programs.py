"""Programs made of operations, without a circuit."""

from __future__ import annotations

import numpy as np

from circuitkit.engine.program import Program


def program_of(operations, n_rows, *, n_inputs=1, lasting=(), substeps=1, substep=(), after=(), **more):
    """A program made by hand; the rows that last are states."""
    rows = np.array(lasting, dtype=np.int32)
    return Program(
        name="by hand",
        step_s=0.01,
        substeps=substeps,
        input_names=tuple(f"u{i}" for i in range(n_inputs)),
        neuron_names=(),
        output_names=(),
        n_rows=n_rows,
        before=tuple(operations),
        substep=tuple(substep),
        after=tuple(after),
        initial=more.pop("initial", np.zeros(n_rows)),
        activation_rows=np.zeros(0, np.int32),
        output_rows=np.zeros(0, np.int32),
        readout_rows=(n_rows, n_rows),
        state_rows=rows,
        state_names=tuple(map(str, lasting)),
        **more,
    )
