"""Inputs of a circuit from what a user writes: values such as `70 mm`, or a CSV table with one row a step."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from circuitkit.base.errors import InputError, Problem, UnitError, listing, suggest
from circuitkit.base.reading import MOST_TABLE, read_text
from circuitkit.base.tables import read_number
from circuitkit.base.units import DIMENSIONLESS, Unit, parse_quantity
from circuitkit.circuit.graph import CircuitGraph, InputNode
from circuitkit.engine.operations import FloatArray

TIME = "time_s"
_MOST_PROBLEMS = 20
_TIME_TOLERANCE = 1e-3  # part of a control step by which a table's times may be off


def constant_inputs(graph: CircuitGraph, values: Mapping[str, str]) -> dict[str, float]:
    """Return SI values of constant inputs.

    Args:
        graph: The circuit.
        values: Text with a unit by name of the input, such as `{"zmp_y": "70 mm"}`.

    Raises:
        InputError: An unknown input, a wrong unit, no finite number; lists all problems.
    """
    nodes = {node.name: node for node in graph.inputs}
    found: dict[str, float] = {}
    problems: list[Problem] = []
    for name, text in values.items():
        node = nodes.get(name)
        if node is None:
            problems.append(Problem("", 0, 0, "inputs", *_unknown_input(name, tuple(nodes))))
            continue
        try:
            found[name] = _value_si(text, node, bare_in=DIMENSIONLESS)
        except UnitError as error:
            problems.append(Problem("", 0, 0, f"inputs.{name}", str(error)))
    if problems:
        raise InputError(*problems)
    return found


def _unknown_input(name: str, names: Sequence[str]) -> tuple[str, str]:
    return f"unknown input '{name}'; allowed: {listing(names)}", suggest(name, names)


def _value_si(text: str, node: InputNode, bare_in: Unit) -> float:
    """Return SI value of text such as `70 mm`; a bare number is in `bare_in`."""
    try:
        number = read_number(text)
        value = bare_in.to_si(number) if math.isfinite(number) else math.nan
        dimension = bare_in.dimension
    except ValueError:
        quantity = parse_quantity(text)
        value, dimension = quantity.value_si, quantity.dimension
    if math.isnan(value):
        message = f"found {text.strip()}; allowed: finite numbers"
        raise UnitError(message)
    if dimension != node.unit.dimension:
        wanted = f"a value in {node.unit} or alike ({node.unit.dimension})"
        message = f"found '{text.strip()}' ({dimension}); allowed: {wanted}"
        raise UnitError(message)
    return value


def read_inputs(graph: CircuitGraph, path: Path) -> dict[str, FloatArray]:
    """Read the inputs of a CSV file, each shape (T,), [SI].

    The header names inputs; `time_s` and the names of neurons and outputs are passed over, so that what `run`
    wrote can be read again. A cell is a number in the input's declared unit, or has a unit of its own.

    Raises:
        InputError: The table cannot be read, a column is no input, a cell is no value; lists all problems.
    """
    (header_line, header), *body = _rows(path)
    names = [name.strip() for name in header]
    nodes = _columns_in_use(graph, names, path, header_line)
    values = np.zeros((len(body), len(names)))
    problems = []
    for r, (line, row) in enumerate(body):
        if len(row) != len(names):
            message = f"found {len(row)} values; allowed: {len(names)}, as in the header"
            problems.append(Problem(str(path), line, 1, "", message))
            continue
        for c, node in nodes.items():
            try:
                values[r, c] = _cell(row[c], node)
            except UnitError as error:
                problems.append(Problem(str(path), line, _position(row, c), names[c], str(error)))
    _raise_some(problems, path)
    if TIME in names:
        c = names.index(TIME)
        _check_times(path, [(line, _position(row, c), row[c]) for line, row in body], graph.step_s)
    return {node.name: values[:, c] for c, node in nodes.items()}


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return line numbers and cells of the header and of at least one row; empty lines are passed over."""
    lines = csv.reader(io.StringIO(read_text(path, "a CSV table", MOST_TABLE), newline=""), strict=True)
    try:
        rows = [(lines.line_num, row) for row in lines if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(Problem(str(path), lines.line_num, 1, "", f"not a CSV table: {error}")) from error
    if len(rows) <= 1:
        found = "a header and no rows" if rows else "an empty table"
        message = f"found {found}; allowed: a header and one row a step"
        raise InputError(Problem(str(path), max(lines.line_num, 1), 1, "", message))
    return rows


def _columns_in_use(graph: CircuitGraph, names: Sequence[str], path: Path, line: int) -> dict[int, InputNode]:
    nodes = {node.name: node for node in graph.inputs}
    passed_over = {TIME, *graph.names()} - set(nodes)
    problems = []
    for c, name in enumerate(names):
        place = (str(path), line, _position(names, c), "header")
        if name in names[:c]:
            problems.append(Problem(*place, f"the column '{name}' occurs twice"))
        elif name not in nodes and name not in passed_over:
            message, hint = _unknown_input(name, tuple(nodes))
            separated = len(names) == 1 and any(mark in name for mark in ";\t")
            problems.append(Problem(*place, message, "separate the columns by commas" if separated else hint))
    if not problems and not set(nodes) & set(names):
        message = f"found no column of an input; allowed: {listing(nodes)}"
        problems.append(Problem(str(path), line, 1, "header", message))
    _raise_some(problems, path)
    return {c: nodes[name] for c, name in enumerate(names) if name in nodes}


def _cell(text: str, node: InputNode) -> float:
    if not text.strip():
        message = "found nothing; allowed: a number"
        raise UnitError(message)
    return _value_si(text, node, bare_in=node.unit)


def _check_times(path: Path, cells: Sequence[tuple[int, int, str]], step_s: float) -> None:
    """Refuse times that are not one control step apart: rows are steps, they are not interpolated."""
    previous = None
    for line, column, text in cells:
        try:
            time_s = read_number(text)
        except ValueError:
            message = f"found '{text.strip()}'; allowed: seconds as a number"
            raise InputError(Problem(str(path), line, column, TIME, message)) from None
        if previous is not None and not abs(time_s - previous - step_s) <= _TIME_TOLERANCE * step_s:
            message = (
                f"found {time_s - previous:g} s after the row above; allowed: the circuit's {step_s:g} s"
            )
            raise InputError(Problem(str(path), line, column, TIME, message))
        previous = time_s


def _position(cells: Sequence[str], index: int) -> int:
    """Return column of the text at which a cell starts, as long as no cell is quoted."""
    return sum(len(cell) + 1 for cell in cells[:index]) + 1


def _raise_some(problems: Sequence[Problem], path: Path) -> None:
    if len(problems) > _MOST_PROBLEMS:
        rest = Problem(
            str(path), problems[_MOST_PROBLEMS].line, 1, "", f"{len(problems) - _MOST_PROBLEMS} more problems"
        )
        raise InputError(*problems[:_MOST_PROBLEMS], rest)
    if problems:
        raise InputError(*problems)
