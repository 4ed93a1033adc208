"""Which rows of the table `run` records, by the names that a user gives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from circuitkit.base.errors import UnknownNameError
from circuitkit.engine.operations import IndexArray
from circuitkit.engine.program import Program


@dataclass(frozen=True, eq=False)
class Selection:
    """Columns of a recording.

    Attributes:
        neurons: Columns of neurons, shape (k,).
        outputs: Columns of outputs of the circuit, shape (m,).
        states: Columns of states, shape (s,).
        rows: Rows of the table: k activations, k outputs, m outputs of the circuit, s states.
    """

    neurons: IndexArray
    outputs: IndexArray
    states: IndexArray
    rows: IndexArray


def select(program: Program, names: Iterable[str] | None, *, states: bool) -> Selection:
    """Find what to record.

    Args:
        program: The compiled circuit.
        names: Names of neurons, populations, outputs of the circuit, or states such as `ring[3].v`; None for
            all neurons and outputs. What is named twice is recorded once.
        states: Whether to record all states besides.

    Raises:
        UnknownNameError: There is nothing of a name.
    """
    n, m, s = len(program.activation_rows), len(program.output_names), len(program.state_rows)
    neurons: Sequence[int] = range(n)
    outputs: Sequence[int] = range(m)
    chosen: Sequence[int] = range(s if states else 0)
    if names is not None:
        neurons, outputs, found = _find(program, names)
        chosen = range(s) if states else found
    cells, readouts, variables = (_once(each) for each in (neurons, outputs, chosen))
    rows = [
        program.activation_rows[cells],
        program.output_rows[cells],
        readouts + np.int32(program.readout_rows[0]),
        program.state_rows[variables],
    ]
    return Selection(cells, readouts, variables, np.concatenate(rows).astype(np.int32))


def _once(columns: Iterable[int]) -> IndexArray:
    """Return each column where it is named first: members may be named alone and with their population."""
    return np.array(list(dict.fromkeys(columns)), dtype=np.int32)


def _find(program: Program, names: Iterable[str]) -> tuple[list[int], list[int], list[int]]:
    neurons: list[int] = []
    outputs: list[int] = []
    states: list[int] = []
    state_index: dict[str, int] | None = None
    for name in names:
        if name in program.neuron_names:
            neurons.append(program.neuron_names.index(name))
        elif name in program.population_columns:
            neurons.extend(program.population_columns[name])
        elif name in program.output_names:
            outputs.append(program.output_names.index(name))
        else:
            if state_index is None:
                state_index = {state: i for i, state in enumerate(program.state_names)}
            if name not in state_index:
                kind = "neuron, output or state"
                populations = program.population_columns
                raise UnknownNameError(
                    kind, name, (*program.output_names, *populations, *program.neuron_names)
                )
            states.append(state_index[name])
    return neurons, outputs, states
