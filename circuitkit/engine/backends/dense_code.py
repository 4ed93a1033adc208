"""The step of one circuit as straight Python: a few calls on arrays, or, where quicker, numbers one by one.

The text is made from checked trees of operations and expressions, never from what a user wrote. Numbers are
looked up as globals of the function, which takes no time at a call.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.engine.backends.dense_plan import Element, Layout, Stage, moved
from circuitkit.engine.operations import Map, Operation, Sum

_FEW_INPUTS = 8
_FEW = 32  # terms of all readouts that are added one by one rather than by calls
# Measured costs in ns: a product and a function on arrays; a function of a number, a term of a sum.
_STAGE, _FUNCTION, _TERM = 600, 55, 25
_PRINTED_FUNCTIONS = {
    "sigmoid": "1.0 / (1.0 + exp(-{x})) if {x} > -700.0 else exp({x})",
    "tanh": "tanh({x})",
    "heaviside": "1.0 if {x} >= 0.0 else 0.0",
    "rectified": "{x} if {x} > 0.0 else 0.0",
    "": "{x}",
}


class Code:
    """Lines of a function and the globals that its names stand for.

    Infinite limits print as `inf`, which is one of them.

    Attributes:
        n_inputs: Number of inputs, from place 1 on; their names are `u1` and so on.
        lines: What is done in a step.
        guard: A condition of the numbers at the beginning of a step, without which others must do it.
        names: The globals.
        written: Names of numbers that the step changes.
    """

    def __init__(self, numbers: memoryview, n_inputs: int) -> None:
        self.n_inputs = n_inputs
        self.lines: list[str] = []
        self.guard = ""
        self.names: dict[str, Any] = {
            "m": numbers,
            "exp": math.exp,
            "tanh": math.tanh,
            "inf": math.inf,
            "nan": math.nan,
        }
        self.written: set[str] = {"time"}
        self.values: dict[int, str] = {1 + i: f"u{1 + i}" for i in range(n_inputs)}

    def bind(self, thing: object) -> str:
        """Bind a name for an object."""
        name = f"v{len(self.names)}"
        self.names[name] = thing
        return name

    def call(self, function: Callable[..., object], *arguments: object) -> None:
        """Add a line that calls a function with these arguments."""
        names = ", ".join(self.bind(argument) for argument in arguments)
        self.lines.append(f"{self.bind(function)}({names})")

    def keep(self, name: str, text: str) -> str:
        """Return a line that gives a number a name that outlives the step."""
        self.lines.append(f"{name} = {text}")
        self.names.setdefault(name, 0.0)
        self.written.add(name)
        return name

    def value(self, place: int) -> str:
        """Give text for the number at a place: its name, if it has one already, or a look into the array."""
        return self.values.get(place, f"m[{place}]")

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return [f"u{1 + i}" for i in range(self.n_inputs)]

    def reads(self) -> list[str]:
        """Return lines that give the inputs their names."""
        return [f"u{1 + i} = m[{1 + i}]" for i in range(self.n_inputs)]

    def takes(self) -> list[str]:
        """Return lines for inputs that are handed over or, if there are none, stand in their place already.

        A few are taken one by one; what does not fit, `take` refuses.
        """
        names = ", ".join(self.inputs)
        reads = [f"    {line}" for line in self.reads()] or ["    pass"]
        lines = ["if inputs is None:", *reads, "else:"]
        if not 0 < self.n_inputs <= _FEW_INPUTS:
            return [*lines, "    take(inputs)", *reads]
        writes = [f"        m[{1 + i}] = u{1 + i}" for i in range(self.n_inputs)]
        attempt = ["    try:", f"        (({names},),) = inputs.tolist()"]
        refusal = ["    except Exception:", "        take(inputs)", *(f"    {line}" for line in reads)]
        return [*lines, *attempt, *refusal, "    else:", *writes]

    def function(
        self, head: str, start: Sequence[str], otherwise: Sequence[str], ending: Sequence[str]
    ) -> Callable[..., Any]:
        """Return a function; several share their globals.

        Args:
            head: Its name and arguments.
            start: Lines that give the inputs their names.
            otherwise: What it does, before all else, if the guard does not hold.
            ending: Its last lines.
        """
        first = [f"global {', '.join(sorted(self.written))}", *start]
        if self.guard:
            first += [f"if not {self.guard}:", *(f"    {line}" for line in otherwise)]
        body = [*first, *self.lines, "time += 1", *ending]
        text = f"def {head}:\n    " + "\n    ".join(body) + "\n"
        exec(compile(text, f"<{head}>", "exec"), self.names)  # the text is our own
        made: Callable[..., Any] = self.names[head.partition("(")[0]]
        return made


def quicker_one_by_one(stages: Sequence[Stage], layout: Layout) -> bool:
    """Check whether a step takes less time without arrays."""
    elements = [element for stage in layout.elements for element in stage]
    terms = sum(
        len(stage.terms[element.row])
        for stage, each in zip(stages, layout.elements, strict=True)
        for element in each
    )
    return len(elements) * _FUNCTION + terms * _TERM < len(stages) * _STAGE


def one_by_one(code: Code, stage: Stage, layout: Layout, number: int) -> None:
    """Add the lines of a stage's cells, each number with a name of its own: `x` arguments, `o` results."""
    for source, target in stage.copies:
        place = layout.place[target]
        code.values[place] = code.keep(f"o{place}", code.value(layout.place[source]))
    results = iter(place for _, start, stop in layout.parts[number] for place in range(start, stop))
    lines = []
    for i, (element, place) in enumerate(zip(layout.elements[number], results, strict=True)):
        x = code.keep(f"x{number}_{i}", _argument(code, element, stage, layout))
        lines.append((place, _PRINTED_FUNCTIONS[element.function].format(x=x)))
    for place, text in lines:
        code.keep(f"o{place}", text)
    for target, joint, first, second in layout.joints[number]:
        code.keep(f"o{target}", f"o{first} {joint} o{second}")


def _argument(code: Code, element: Element, stage: Stage, layout: Layout) -> str:
    parts = [repr(element.constant)] if element.constant else []
    for row, weight in stage.terms[element.row]:
        parts.append(_term(element.gain * weight, code.value(layout.place[row])))
    return " + ".join(parts) or "0.0"


def read_out(code: Code, operations: Sequence[Operation], layout: Layout) -> bool:
    """Add lines for the outputs of the circuit, one by one; False if there are too many terms."""
    rows = [moved(operation, layout) for operation in operations]
    if sum(len(each.sources) if isinstance(each, Sum) else each.count for each in rows) > _FEW:
        return False
    found: dict[int, str] = {}
    for operation in rows:
        if isinstance(operation, Sum):
            _print_sum(code, operation, found)
        else:
            _print_map(code, operation, found)
    first, stop = layout.readouts
    for place in range(first, stop):
        code.lines.append(f"m[{place}] = {found[place]}")
    return True


def _print_sum(code: Code, operation: Sum, found: dict[int, str]) -> None:
    weights = np.broadcast_to(operation.weights, operation.sources.shape).tolist()
    for i in range(operation.stop - operation.start):
        part = range(int(operation.indptr[i]), int(operation.indptr[i + 1]))
        terms = [_term(weights[k], code.value(int(operation.sources[k]))) for k in part]
        found[operation.start + i] = f"s{operation.start + i}"
        code.lines.append(f"s{operation.start + i} = {' + '.join(terms) or '0.0'}")


def _term(weight: float, source: str) -> str:
    return source if weight == 1.0 else f"{weight!r} * {source}"


def _print_map(code: Code, operation: Map, found: dict[int, str]) -> None:
    for row, expression in operation.results:
        for i in range(operation.count):
            names = {name: found.get(first + i, f"y{first + i}") for name, first in operation.rows.items()}
            names |= {
                name: repr(float(np.broadcast_to(value, (operation.count,))[i]))
                for name, value in operation.constants.items()
            }
            found[row + i] = code.keep(f"y{row + i}", _printed(code, expression, names))


def _printed(code: Code, expression: Expression, names: dict[str, str]) -> str:
    """Return a readout's expression; limits keep what is not a number."""
    match expression:
        case Number(value=value):
            return repr(value)
        case Name(name=name):
            return names[name]
        case Unary(operator=sign, operand=operand):
            return f"({sign}{_printed(code, operand, names)})"
        case Binary(operator=joint, left=left, right=right):
            return f"({_printed(code, left, names)} {joint} {_printed(code, right, names)})"
        case Call("min", (Call("max", (inside, low)), high)):
            name = f"t{len(code.lines)}"
            code.lines.append(f"{name} = {_printed(code, inside, names)}")
            least, most = _printed(code, low, names), _printed(code, high, names)
            return f"{least} if {name} < {least} else {most} if {name} > {most} else {name}"
    message = f"cannot print {expression}"
    raise TypeError(message)
