"""The circuit alone, from table to table: inputs by name or from CSV, results to CSV or NetCDF, a row a step.

In the tables every value has the unit that the circuit file declares for it; inside, all is SI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.files import replacing
from circuitkit.base.netcdf import write_netcdf
from circuitkit.base.tables import csv_lines
from circuitkit.base.units import DIMENSIONLESS, Unit, format_quantity
from circuitkit.circuit.graph import CircuitGraph, Neuron, Population
from circuitkit.circuit.memory import require_memory
from circuitkit.circuit.names import node_of
from circuitkit.circuit.resolving.nodes import shown_unit
from circuitkit.engine.compile import compile_circuit
from circuitkit.engine.input_table import TIME, constant_inputs, read_inputs
from circuitkit.engine.operations import FloatArray
from circuitkit.engine.program import Precision, Program, Trace
from circuitkit.engine.record import select
from circuitkit.engine.run import run

FORMATS = (".csv", ".nc")
_CHUNK = 4096  # steps between two reports of progress

MOST_NEURONS = 1000  # that are recorded unasked
Role = Literal["input", "neuron", "output", "state"]


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a run.

    Attributes:
        name: Name of the input, neuron, output or state.
        role: Which of these it is.
        unit: Unit of the values.
        values: One a step, shape (T,), [`unit`].
    """

    name: str
    role: Role
    unit: Unit
    values: FloatArray


@dataclass(frozen=True, eq=False)
class RunTable:
    """What a circuit did over T steps.

    Attributes:
        circuit: Name of the circuit.
        step_s: Control step, [s].
        columns: Inputs, neurons (their outputs) and outputs, in file order, then states.
        notes: What a reader should know, such as inputs that left their range.
        backend: Which backend ran it, and why that one.
    """

    circuit: str
    step_s: float
    columns: tuple[Column, ...]
    notes: tuple[str, ...]
    backend: str = ""

    @property
    def steps(self) -> int:
        """Number of steps T."""
        return len(self.columns[0].values) if self.columns else 0

    def time_s(self) -> FloatArray:
        """Time of every row, shape (T,), [s]; the first step is at 0."""
        return np.arange(self.steps, dtype=np.float64) * self.step_s

    def last(self) -> dict[str, float]:
        """Return the last row by name, in the columns' units."""
        return {column.name: float(column.values[-1]) for column in self.columns}


def run_table(
    graph: CircuitGraph,
    *,
    values: Mapping[str, str] | None = None,
    table: Path | None = None,
    steps: int | None = None,
    record: Sequence[str] = (),
    backend: str = "numpy",
    precision: Precision = "float64",
    seed: int = 0,
    progress: Callable[[int, int], object] | None = None,
) -> RunTable:
    """Run one circuit with inputs that are constant, or come from a table, or both.

    Args:
        graph: The circuit.
        values: Constant inputs by name, such as `{"zmp_y": "70 mm"}`.
        table: A CSV file with a column for each of its inputs and one row a step.
        steps: Number of steps; by default as many as the table has rows.
        record: Names of neurons, populations, outputs or states such as `q1.v`, to have only these. By
            default all neurons and outputs, or of a circuit of more than 1000 neurons the outputs.
        backend: As for `compile_circuit`.
        precision: As for `compile_circuit`.
        seed: Of the noise.
        progress: Called now and then with the number of steps done and of all steps.

    Returns:
        One row a step. Inputs that are given nowhere are held at 0, with a note.

    Raises:
        InputError: An unknown input, a wrong unit, a table that cannot be read; lists all problems. More
            steps than fit into memory.
        UnknownNameError: There is nothing of a name in `record`, or no such backend.
        DivergedError: A number that is not finite came out.
    """
    constants, given, count = _given(graph, values or {}, table, steps)
    program = compile_circuit(graph, backend, precision)
    names = tuple(dict.fromkeys(record)) or None
    notes = [*_absent(graph, {*constants, *given})]
    if names is None and len(program.neuron_names) > MOST_NEURONS:
        names = tuple(program.output_names)
        hidden = f"the {len(program.neuron_names)} neurons are not recorded"
        notes.append(f"{hidden}; name those that are wanted with --record")
    _require_memory(program, names, count)
    inputs = _input_array(graph, constants, given, count)
    notes.extend(_range_notes(graph, inputs[:, 0]))
    columns = _run(program, graph, inputs, names, seed, progress)
    return RunTable(
        circuit=graph.name,
        step_s=graph.step_s,
        columns=(
            *_columns("input", [(node.name, node.unit) for node in graph.inputs], inputs[:, 0]),
            *columns,
        ),
        notes=tuple(notes),
        backend=program.note or f"backend {program.backend}",
    )


def given_inputs(
    graph: CircuitGraph, values: Mapping[str, str], table: Path | None, steps: int | None
) -> tuple[FloatArray, set[str]]:
    """Return the inputs of every step, shape (T, 1, n_inputs), [SI], and the names of those that were given.

    Raises:
        InputError: As `run_table` does.
    """
    constants, columns, count = _given(graph, values, table, steps)
    return _input_array(graph, constants, columns, count), {*constants, *columns}


def _given(
    graph: CircuitGraph, values: Mapping[str, str], table: Path | None, steps: int | None
) -> tuple[dict[str, float], dict[str, FloatArray], int]:
    """Constant inputs, inputs of a table, and the number of steps."""
    constants = constant_inputs(graph, values)
    columns = read_inputs(graph, table) if table is not None else {}
    _refuse_doubles(constants, columns)
    return constants, columns, _number_of_steps(columns, steps, table)


def _input_array(
    graph: CircuitGraph, constants: Mapping[str, float], columns: Mapping[str, FloatArray], count: int
) -> FloatArray:
    inputs = np.zeros((count, 1, len(graph.inputs)))
    for i, node in enumerate(graph.inputs):
        if node.name in columns:
            inputs[:, 0, i] = columns[node.name][:count]
        else:
            inputs[:, 0, i] = constants.get(node.name, 0.0)
    return inputs


def _require_memory(program: Program, names: Sequence[str] | None, steps: int) -> None:
    """Refuse more steps than fit into memory: inputs in SI and in their units, what is recorded thrice."""
    width = 2 * len(program.input_names) + 3 * len(select(program, names, states=False).rows) + 1
    require_memory("steps", f"{steps} steps", 8.0 * width * steps)


def _run(
    program: Program,
    graph: CircuitGraph,
    inputs: FloatArray,
    names: Sequence[str] | None,
    seed: int,
    progress: Callable[[int, int], object] | None,
) -> list[Column]:
    """Return the columns of neurons, outputs and states."""
    state = program.initial_state(seed=seed)
    parts: list[Trace] = []
    for start in range(0, len(inputs), _CHUNK):
        parts.append(run(program, inputs[start : start + _CHUNK], state, record=names))
        state = parts[-1].state
        if progress is not None:
            progress(min(start + _CHUNK, len(inputs)), len(inputs))
    first = parts[0]
    output, readout, states = (
        np.concatenate([getattr(part, what)[:, 0] for part in parts])
        for what in ("output", "readout", "states")
    )
    units = {node.name: node.unit for node in graph.outputs}
    return [
        *_columns("neuron", [(name, DIMENSIONLESS) for name in first.neuron_names], output),
        *_columns("output", [(name, units[name]) for name in first.output_names], readout),
        *_columns("state", [(name, _state_unit(graph, name)) for name in first.state_names], states),
    ]


def _state_unit(graph: CircuitGraph, name: str) -> Unit:
    """Find the unit of a state such as `q1.v`; a synapse's is shown in SI, without a name."""
    owner, _, state = name.rpartition(".")
    nodes: tuple[Neuron | Population, ...] = (*graph.neurons, *graph.populations)
    for node in nodes:
        if node.name == node_of(owner):
            found = next(each for each in node.model.states if each.name == state)
            unit = node.activation_unit
            return shown_unit(found, found.unit_rule.dimension(unit.dimension), unit)
    return DIMENSIONLESS


def _columns(role: Role, names: Sequence[tuple[str, Unit]], values_si: FloatArray) -> list[Column]:
    return [Column(name, role, unit, values_si[:, i] / unit.scale) for i, (name, unit) in enumerate(names)]


def _refuse_doubles(constants: Mapping[str, float], columns: Mapping[str, FloatArray]) -> None:
    twice = [name for name in constants if name in columns]
    if twice:
        message = "given twice, as a value and as a column of the table; allowed: one of them"
        raise InputError(*(Problem("", 0, 0, f"inputs.{name}", message) for name in twice))


def _number_of_steps(columns: Mapping[str, FloatArray], steps: int | None, table: Path | None) -> int:
    rows = min((len(values) for values in columns.values()), default=None)
    if steps is None and rows is None:
        message = "found no number of steps; allowed: a whole number from 1, or a table with one row a step"
        raise InputError(Problem("", 0, 0, "steps", message))
    if steps is not None and (steps < 1 or (rows is not None and steps > rows)):
        limit = f"1 to {rows}, the rows of '{table}'" if rows is not None else "whole numbers from 1"
        raise InputError(Problem("", 0, 0, "steps", f"found {steps}; allowed: {limit}"))
    return steps if steps is not None else rows or 0


def _absent(graph: CircuitGraph, given: set[str]) -> Iterator[str]:
    absent = [node.name for node in graph.inputs if node.name not in given]
    if absent:
        yield f"held at 0, for no value was given: {', '.join(absent)}"


def _range_notes(graph: CircuitGraph, inputs: FloatArray) -> Iterator[str]:
    for node, values in zip(graph.inputs, inputs.T, strict=True):
        outside = (values < node.low) | (values > node.high)
        if outside.any():
            limits = f"{format_quantity(node.low, node.unit)} to {format_quantity(node.high, node.unit)}"
            yield f"{node.name} leaves its range, {limits}, in {outside.sum()} of {len(values)} steps"


def require_format(path: Path) -> None:
    """Refuse a file name by which no format can be chosen.

    Raises:
        InputError: The suffix is not one of `FORMATS`.
    """
    if path.suffix.lower() not in FORMATS:
        message = f"found the suffix '{path.suffix}'; allowed: {listing(FORMATS)}"
        raise InputError(Problem("", 0, 0, str(path), message, suggest(path.suffix, FORMATS)))


def write_run(result: RunTable, path: Path) -> None:
    """Write a run as CSV or as NetCDF, by the suffix.

    CSV: the columns `time_s`, then inputs, neurons and outputs by name. NetCDF: a variable of the dimension
    `time_s` for each of them, with the attributes `units` and `role`.

    Raises:
        InputError: The suffix is neither `.csv` nor `.nc`.
        OutputError: The file cannot be written.
    """
    require_format(path)
    if path.suffix.lower() == ".nc":
        columns = {
            each.name: (each.values, {"units": each.unit.symbol, "role": each.role})
            for each in result.columns
        }
        write_netcdf(path, {"circuit": result.circuit}, {TIME: (result.time_s(), {"units": "s"}), **columns})
        return
    with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        file.writelines(run_lines(result))


def run_lines(result: RunTable) -> Iterator[str]:
    """Yield the lines of the CSV table, several at a time."""
    return csv_lines({TIME: result.time_s(), **{column.name: column.values for column in result.columns}})
