"""What generated C is put together from: expressions, the numbers it refers to, which rows it uses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.engine.operations import FloatArray, Map, Noise, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program

_INFIX = frozenset("+-*/")
_COMPARISONS: Mapping[str, str] = {"<": "less", "<=": "less_equal", ">": "greater", ">=": "greater_equal"}
_LARGEST_WHOLE_POWER = 8
_ROOT = 0.5
_PADDING = 8  # as many numbers as are ever loaded at once

AnyArray = npt.NDArray[np.generic]


def print_expression(expression: Expression, names: Mapping[str, str], width: int) -> str:
    """C source of type `v_WIDTH` for an expression.

    Args:
        expression: The tree.
        names: C source, of the same type, for every name.
        width: How many numbers are computed side by side.
    """
    return _Printer(names, width).text(expression)


def print_number(value: float) -> str:
    """C source of a number; the shortest digits that are read as the same double."""
    if math.isfinite(value):
        return f"(real){value!r}"
    return "(real)NAN" if math.isnan(value) else f"(real){'-' if value < 0 else ''}INFINITY"


class _Printer:
    """Walks a tree; `simd.h` has every function of the language under its own name."""

    def __init__(self, names: Mapping[str, str], width: int) -> None:
        self._names = names
        self._width = width

    def text(self, expression: Expression) -> str:
        match expression:
            case Number(value=value):
                return self._call("all", print_number(value))
            case Name(name=name):
                return self._names[name]
            case Unary(operator=sign, operand=operand):
                return f"({sign}{self.text(operand)})" if sign == "-" else self.text(operand)
            case Binary():
                return self._binary(expression)
            case Call(function=function, arguments=arguments):
                return self._call(function, *map(self.text, arguments))
        message = f"cannot print {type(expression).__name__}"
        raise TypeError(message)

    def _binary(self, expression: Binary) -> str:
        if expression.operator == "**":
            return self._power(expression.left, expression.right)
        left, right = self.text(expression.left), self.text(expression.right)
        if expression.operator in _INFIX:
            return f"({left} {expression.operator} {right})"
        return self._call(_COMPARISONS[expression.operator], left, right)

    def _call(self, function: str, *arguments: str) -> str:
        return f"{function}_{self._width}({', '.join(arguments)})"

    def _power(self, base: Expression, exponent: Expression) -> str:
        """Return products for small whole powers: a call of `pow` costs as much as twenty."""
        match exponent:
            case Number(value=value) if value in range(1, _LARGEST_WHOLE_POWER + 1):
                return self._call(f"power{int(value)}", self.text(base))
            case Number(value=value) if value == _ROOT:
                return self._call("sqrt", self.text(base))
        return self._call("pow", self.text(base), self.text(exponent))


class Constants:
    """Collects arrays in two blocks: numbers that all members share, and rows with one for each member."""

    def __init__(self) -> None:
        self._shared: list[FloatArray] = []
        self._own: list[FloatArray] = []
        self._n_shared = 0
        self._n_own = 0
        self._known: dict[int, tuple[FloatArray, int]] = {}

    def share(self, values: FloatArray) -> int:
        """Return place of the first number of an array of shape (), (n,) or (n, 1)."""
        if (known := self._known.get(id(values))) is not None:
            return known[1]
        self._known[id(values)] = values, self._n_shared  # held, so that the identity stays taken
        flat = values.ravel()
        # What loads several at once may read beyond the end.
        padded = np.concatenate([flat, np.repeat(flat[-1:], _PADDING)]) if values.ndim else flat
        self._shared.append(padded)
        self._n_shared += len(padded)
        return self._n_shared - len(padded)

    def own(self, values: FloatArray) -> int:
        """Return place of the first row of an array of shape (n, B)."""
        if (known := self._known.get(id(values))) is not None:
            return known[1]
        self._known[id(values)] = values, self._n_own
        self._own.append(values)
        self._n_own += len(values)
        return self._n_own - len(values)

    def shared_numbers(self) -> FloatArray:
        """Return all shared numbers, one after the other."""
        return np.concatenate([*self._shared, np.zeros(1)])

    def own_rows(self, batch: int) -> FloatArray:
        """Return all rows with a number for each member, shape (n, B)."""
        return np.concatenate([*self._own, np.zeros((0, batch))])


class Arrays:
    """The arrays that a program of loops is given, each once."""

    def __init__(self) -> None:
        self._make: list[Callable[[], AnyArray]] = []
        self._known: dict[int, int] = {}

    def number(self, array: AnyArray) -> int:
        """Return the number by which C finds an array."""
        if id(array) not in self._known:
            self._known[id(array)] = self.later(lambda: array)
        return self._known[id(array)]

    def later(self, make: Callable[[], AnyArray]) -> int:
        """Return the number of an array that is made when a kernel is."""
        self._make.append(make)
        return len(self._make) - 1

    def made(self) -> list[AnyArray]:
        """Return all of them, for a kernel."""
        return [make() for make in self._make]


def print_memories(program: Program) -> Iterator[str]:
    """Print the C function that says where every ring stands after a number of control steps."""
    yield "static void begin_memories(int64_t *places, int64_t done)"
    yield "{"
    yield "(void)places, (void)done;"
    for memory in program.memories:
        runs = program.substeps if memory in program.substep else 1
        yield f"places[{memory.memory}] = done * {runs} % {memory.depth};"
    yield "}"


def ranges(chosen: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield neighbouring rows that are chosen as pairs of the first one and the one after the last."""
    edges = np.flatnonzero(np.diff(chosen, prepend=False, append=False))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def first_read(operations: Iterable[Operation]) -> set[int]:
    """Return rows that are read before they are written."""
    read: set[int] = set()
    before: set[int] = set()
    for operation in operations:
        read |= _reads(operation) - before
        before |= written([operation])
    return read


def _reads(operation: Operation) -> set[int]:
    match operation:
        case Sum(start=start, stop=stop, sources=sources, base=base, add=add):
            return set((sources + base).tolist()) | (set(range(start, stop)) if add else set())
        case Map(count=count, rows=rows, picks=picks):
            neighbours = {row + i for row in rows.values() for i in range(count)}
            return neighbours.union(*(pick.tolist() for pick in picks.values()))
        case Noise(start=start, stop=stop):
            return set(range(start, stop))
        case Remember(sources=sources):
            return set(sources.tolist())
    return set()


def written(operations: Iterable[Operation]) -> set[int]:
    """Return rows that are written."""
    pairs = [pair for operation in operations for pair in written_ranges(operation)]
    return {row for start, stop in pairs for row in range(start, stop)}


def written_ranges(operation: Operation) -> Iterator[tuple[int, int]]:
    """Yield first rows that an operation writes, and the ones after the last."""
    match operation:
        case Map(count=count, results=results):
            yield from ((start, start + count) for start, _ in results)
        case Sum(start=start, stop=stop) | Noise(start=start, stop=stop) | Recall(start=start, stop=stop):
            yield start, stop
