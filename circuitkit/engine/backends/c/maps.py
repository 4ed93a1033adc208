"""A loop of maps as C: every row is read once and written once, whatever the maps do with it in between."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy.typing as npt

from circuitkit.engine.backends.c import SIMD_WIDTH
from circuitkit.engine.backends.c.fusion import Loop
from circuitkit.engine.backends.c.pieces import print_expression
from circuitkit.engine.operations import Map


class LoopPrinter:
    """Prints the function of a loop and what it is called with.

    Attributes:
        arguments: What stands for every parameter of a program.
    """

    def __init__(self, loop: Loop, array: Callable[[npt.NDArray[Any]], str]) -> None:
        """Number the parameters, so that like loops share a function.

        Args:
            loop: The maps.
            array: C source by which an array is found.
        """
        self._loop = loop
        self._rows: dict[int, str] = {}  # pointers
        self.arguments: dict[str, str] = {}
        for m, operation in enumerate(loop.maps):
            for row in [*operation.rows.values(), *(row for row, _ in operation.results)]:
                if row not in self._rows:
                    self._rows[row] = f"row{len(self._rows)}"
                    self.arguments[f"real *{self._rows[row]}"] = f"table + {row}L * stride"
            for k, values in enumerate(operation.constants.values()):
                self.arguments[f"const real *constant{m}_{k}"] = array(values)
            for k, rows in enumerate(operation.picks.values()):
                self.arguments[f"const int32_t *pick{m}_{k}"] = array(rows)

    def alone(self) -> Iterator[str]:
        """Yield the loops for one circuit: neighbouring rows side by side, then one by one."""
        for width in (SIMD_WIDTH, 1):
            yield f"for (; i + {width} <= end; i += {width}) {{"
            yield from self._body(
                width,
                "i",
                f"pick_{width}(table, {{0}} + i)",
                (f"all_{width}(*{{0}})", f"load_{width}({{0}} + i)", f"load_{width}({{0}} + i)"),
            )
            yield "}"

    def batch(self) -> Iterator[str]:
        """Yield the loops for a batch: neighbouring members side by side."""
        at = "* stride + at"
        yield "for (; i < end; i++) for (int64_t at = 0; at < stride; at += 8) {"
        constants = ("all_8(*{0})", "all_8({0}[i])", f"load_8({{0}} + i {at})")
        yield from self._body(SIMD_WIDTH, f"i {at}", f"load_8(table + {{0}}[i] {at})", constants)
        yield "}"

    def _body(self, width: int, place: str, pick: str, constants: tuple[str, ...]) -> Iterator[str]:
        """Yield statements for vectors of a width.

        `pick` and `constants`, these by their number of axes, load what {0} points to.
        """
        values: dict[int, str] = {}  # variables with the present values of rows
        written: dict[int, str] = {}
        for m, operation in enumerate(self._loop.maps):
            for row in operation.rows.values():
                if row not in values:
                    values[row] = f"x_{self._rows[row]}"
                    yield f"const v_{width} {values[row]} = load_{width}({self._rows[row]} + {place});"
            names = {name: values[row] for name, row in operation.rows.items()}
            for name, variable, text in _loaded(operation, m, pick, constants):
                names[name] = variable
                yield f"const v_{width} {variable} = {text};"
            results = {row: f"y{m}_{k}" for k, (row, _) in enumerate(operation.results)}
            for row, expression in operation.results:
                yield f"const v_{width} {results[row]} = {print_expression(expression, names, width)};"
            values |= results
            written |= results
        for row, variable in written.items():
            yield f"store_{width}({self._rows[row]} + {place}, {variable});"


def _loaded(operation: Map, m: int, pick: str, constants: tuple[str, ...]) -> Iterator[tuple[str, str, str]]:
    """Yield names for something else than neighbours, with their variables and what these are set to."""
    for k, name in enumerate(operation.picks):
        yield name, f"p{m}_{k}", pick.format(f"pick{m}_{k}")
    for k, (name, values) in enumerate(operation.constants.items()):
        yield name, f"c{m}_{k}", constants[values.ndim].format(f"constant{m}_{k}")
