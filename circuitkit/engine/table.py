"""The circuit alone, from table to table: inputs by name or from CSV, results to CSV or NetCDF, a row a step.

In the tables every value has the unit that the circuit file declares for it; inside, all is SI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine.compile import compile_circuit
from circuitkit.engine.input_table import TIME, constant_inputs, read_inputs
from circuitkit.engine.program import Program
from circuitkit.engine.run import run
from circuitkit.engine.state import FloatArray
from circuitkit.errors import InputError, Problem, listing, suggest
from circuitkit.files import OutputError, replacing
from circuitkit.units import DIMENSIONLESS, Unit, format_quantity

FORMATS = (".csv", ".nc")
_CHUNK = 4096  # steps between two reports of progress

Role = Literal["input", "neuron", "output"]


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a run.

    Attributes:
        name: Name of the input, neuron or output.
        role: Which of the three it is.
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
        columns: Inputs, neurons (their outputs) and outputs, in file order.
        notes: What a reader should know, such as inputs that left their range.
    """

    circuit: str
    step_s: float
    columns: tuple[Column, ...]
    notes: tuple[str, ...]

    @property
    def steps(self) -> int:
        """Number of steps T."""
        return len(self.columns[0].values) if self.columns else 0

    def time_s(self) -> FloatArray:
        """Time of every row, shape (T,), [s]; the first step is at 0."""
        return np.arange(self.steps, dtype=np.float64) * self.step_s

    def last(self) -> dict[str, float]:
        """The last row by name, in the columns' units."""
        return {column.name: float(column.values[-1]) for column in self.columns}


def run_table(
    graph: CircuitGraph,
    *,
    values: Mapping[str, str] | None = None,
    table: Path | None = None,
    steps: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RunTable:
    """Run one circuit with inputs that are constant, or come from a table, or both.

    Args:
        graph: The circuit.
        values: Constant inputs by name, such as `{"zmp_y": "70 mm"}`.
        table: A CSV file with a column for each of its inputs and one row a step.
        steps: Number of steps; by default as many as the table has rows.
        progress: Called now and then with the number of steps done and of all steps.

    Returns:
        One row a step. Inputs that are given nowhere are held at 0, with a note.

    Raises:
        InputError: An unknown input, a wrong unit, a table that cannot be read; lists all problems.
    """
    constants = constant_inputs(graph, values or {})
    columns = read_inputs(graph, table) if table is not None else {}
    _refuse_doubles(constants, columns)
    count = _number_of_steps(columns, steps, table)
    inputs = np.zeros((count, 1, len(graph.inputs)))
    for i, node in enumerate(graph.inputs):
        if node.name in columns:
            inputs[:, 0, i] = columns[node.name][:count]
        else:
            inputs[:, 0, i] = constants.get(node.name, 0.0)
    neurons, readout = _run(compile_circuit(graph), inputs, progress)
    return RunTable(
        circuit=graph.name,
        step_s=graph.step_s,
        columns=(
            *_columns("input", ((node.name, node.unit) for node in graph.inputs), inputs[:, 0]),
            *_columns("neuron", ((neuron.name, DIMENSIONLESS) for neuron in graph.neurons), neurons),
            *_columns("output", ((node.name, node.unit) for node in graph.outputs), readout),
        ),
        notes=(*_absent(graph, {*constants, *columns}), *_range_notes(graph, inputs[:, 0])),
    )


def _run(
    program: Program, inputs: FloatArray, progress: Callable[[int, int], None] | None
) -> tuple[FloatArray, FloatArray]:
    """Neuron outputs (T, n_neurons) and circuit outputs (T, n_outputs), [SI]."""
    neurons = np.empty((len(inputs), len(program.neuron_names)))
    readout = np.empty((len(inputs), len(program.output_names)))
    state = program.initial_state()
    for start in range(0, len(inputs), _CHUNK):
        part = slice(start, start + _CHUNK)
        trace = run(program, inputs[part], state)
        neurons[part], readout[part], state = trace.output[:, 0], trace.readout[:, 0], trace.state
        if progress is not None:
            progress(min(start + _CHUNK, len(inputs)), len(inputs))
    return neurons, readout


def _columns(role: Role, names: Iterable[tuple[str, Unit]], values_si: FloatArray) -> Iterator[Column]:
    for i, (name, unit) in enumerate(names):
        yield Column(name, role, unit, values_si[:, i] / unit.scale)


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
    with replacing(path) as part:
        if path.suffix.lower() == ".nc":
            _write_netcdf(result, part)
        else:
            with part.open("w", encoding="utf-8", newline="") as file:
                file.writelines(csv_lines(result))


def csv_lines(result: RunTable) -> Iterator[str]:
    """The lines of the CSV table, to 15 digits."""
    yield ",".join((TIME, *(column.name for column in result.columns))) + "\n"
    for row in zip(
        result.time_s().tolist(), *(column.values.tolist() for column in result.columns), strict=True
    ):
        yield ",".join([f"{value:.15g}" for value in row]) + "\n"


def _write_netcdf(result: RunTable, path: Path) -> None:
    from scipy.io import netcdf_file

    try:
        with netcdf_file(path, "w", version=2) as file:
            file.circuit = result.circuit
            file.createDimension(TIME, result.steps)
            time = file.createVariable(TIME, "f8", (TIME,))
            time[:], time.units = result.time_s(), "s"
            for column in result.columns:
                variable = file.createVariable(column.name, "f8", (TIME,))
                variable[:], variable.units, variable.role = column.values, column.unit.symbol, column.role
    except (TypeError, ValueError) as error:
        message = f"cannot write '{path}': {error}"
        raise OutputError(message) from error
