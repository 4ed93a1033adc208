"""Which programs are a few matrix products with functions between them, and which products these are.

For neurons without states an output is f(x) or a joint of two such, with x = gain A + constant and A a
weighted sum (eqs. 11 and 12). Gains and constants go into the weights: for all neurons of a stage x = G s, s
being the number 1, the inputs and the outputs. What is added up in G s is in no fixed order, so this serves
programs that need not be reproducible to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.engine.operations import FloatArray, Map, Operation, Sum
from circuitkit.engine.program import Program

LARGEST = 20_000  # numbers in all matrices; above, most of them would be zeros
_LARGEST_SHIFT = 1e3  # of an activation; that of one with a larger shift could not be worked out from x
_LEAST_GAIN = 1e-100
IDENTITY = ""
BOUNDED = frozenset({"sigmoid", "tanh", "heaviside"})
_RECTIFIED = "rectified"  # max(0, x)
FUNCTIONS = frozenset({*BOUNDED, IDENTITY, _RECTIFIED})


@dataclass(frozen=True)
class Element:
    """`function(gain A + constant)` with A in a row of the table."""

    function: str
    row: int
    gain: float
    constant: float


@dataclass(frozen=True)
class Cell:
    """An output: an element, or two joined by an operator.

    Attributes:
        target: Row of the table that is written.
        elements: One or two.
        joint: The operator between two.
    """

    target: int
    elements: tuple[Element, ...]
    joint: str = ""


@dataclass(eq=False)
class Stage:
    """Sums, and cells that read nothing but these.

    Attributes:
        terms: For every row of an activation the rows that are added up, with weights.
        cells: What is made of them.
        copies: Pairs (source, target) of rows that are copied before.
        outputs_first: Whether the cells get the activations of the last step, not the new ones.
    """

    terms: dict[int, list[tuple[int, float]]] = field(default_factory=dict)
    cells: list[Cell] = field(default_factory=list)
    copies: list[tuple[int, int]] = field(default_factory=list)
    outputs_first: bool = False


def dense_stages(program: Program) -> list[Stage] | None:
    """Return the stages of a program; None if it is not of this kind, or too large to be dense."""
    has_more = program.substep or len(program.state_rows) or program.memories or program.members
    n = len(program.activation_rows)
    if has_more or n * (n + len(program.input_names)) > LARGEST:
        return None
    stages = [Stage()]
    operations = program.before
    waiting = _waiting(operations)
    if waiting:
        stages[0].outputs_first = True
        operations = operations[:-1]
    for operation in operations:
        if not _extend(stages, operation, waiting):
            return None
    elements = [element for stage in stages for cell in stage.cells for element in cell.elements]
    known = {e.row for e in elements if abs(e.gain) > max(abs(e.constant) / _LARGEST_SHIFT, _LEAST_GAIN)}
    return stages if known == set(program.activation_rows.tolist()) else None


def _waiting(operations: Sequence[Operation]) -> int:
    """Find how many rows behind the activations their new values wait for the rest; 0 if they do not."""
    match operations:
        case [*_, Map(results=((target, Name(name)),), rows=rows)] if len(operations) > 1 and name in rows:
            return rows[name] - target
    return 0


def _extend(stages: list[Stage], operation: Operation, waiting: int) -> bool:
    if isinstance(operation, Sum):
        if stages[-1].cells:
            stages.append(Stage())
        _add_terms(stages[-1], operation, waiting)
        return len(stages) == 1 or not waiting
    if not isinstance(operation, Map) or operation.picks:
        return False
    stage = stages[-1]
    for target, expression in operation.results:
        if isinstance(expression, Name) and not stage.terms:
            source = operation.rows[expression.name]
            stage.copies += [(source + i, target + i) for i in range(operation.count)]
            continue
        cells = _cells(operation, target, expression)
        known = cells is not None and all(e.row in stage.terms for cell in cells for e in cell.elements)
        if cells is None or not known:
            return False
        stage.cells += cells
    return True


def _add_terms(stage: Stage, operation: Sum, waiting: int) -> None:
    weights = np.broadcast_to(operation.weights, operation.sources.shape).tolist()
    sources = (operation.sources + operation.base).tolist()
    for i in range(operation.stop - operation.start):
        part = slice(int(operation.indptr[i]), int(operation.indptr[i + 1]))
        row = operation.start - waiting + i
        before = stage.terms.get(row, []) if operation.add else []
        stage.terms[row] = [*before, *zip(sources[part], weights[part], strict=True)]


def _cells(operation: Map, target: int, expression: Expression) -> list[Cell] | None:
    single = _elements(operation, expression)
    if single is not None:
        return [Cell(target + i, (element,)) for i, element in enumerate(single)]
    match expression:
        case Binary(operator="*" | "+" | "-" as joint, left=left, right=right):
            first, second = _elements(operation, left), _elements(operation, right)
            if first is not None and second is not None:
                pairs = enumerate(zip(first, second, strict=True))
                return [Cell(target + i, pair, joint) for i, pair in pairs]
    return None


def _elements(operation: Map, expression: Expression) -> list[Element] | None:
    """`function(gain A + constant)` for every i of a map; None if the expression is no such thing."""
    function, inside = IDENTITY, expression
    match expression:
        case Call(function="sigmoid" | "tanh" | "heaviside" as name, arguments=(argument,)):
            function, inside = name, argument
        case Call(function="max", arguments=(Number(value=0.0), argument) | (argument, Number(value=0.0))):
            function, inside = _RECTIFIED, argument
    if len(operation.rows) != 1:
        return None
    (variable,) = operation.rows
    affine = _affine(inside, variable, operation.constants)
    if affine is None:
        return None
    gains, constants = (np.broadcast_to(part, (operation.count,)).tolist() for part in affine)
    row = operation.rows[variable]
    return [
        Element(function, row + i, gain, constant)
        for i, (gain, constant) in enumerate(zip(gains, constants, strict=True))
    ]


def _affine(
    expression: Expression, variable: str, constants: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray] | None:
    """(gain, constant) of an expression that is gain times the variable plus a constant."""
    zero = np.array(0.0)
    match expression:
        case Number(value=value):
            return zero, np.array(value)
        case Name(name=name) if name == variable:
            return np.array(1.0), zero
        case Name(name=name) if name in constants:
            return zero, constants[name]
        case Unary(operator=sign, operand=operand):
            inner = _affine(operand, variable, constants)
            return inner if inner is None or sign == "+" else (-inner[0], -inner[1])
        case Binary(operator=joint, left=left, right=right):
            first, second = _affine(left, variable, constants), _affine(right, variable, constants)
            if first is not None and second is not None:
                return _joined(joint, first, second)
    return None


def _joined(
    joint: str, first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray] | None:
    match joint:
        case "+":
            return first[0] + second[0], first[1] + second[1]
        case "-":
            return first[0] - second[0], first[1] - second[1]
        case "*" if not second[0].any():
            return first[0] * second[1], first[1] * second[1]
        case "*" if not first[0].any():
            return second[0] * first[1], second[1] * first[1]
        case "/" if not second[0].any() and second[1].all():
            return first[0] / second[1], first[1] / second[1]
    return None


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the numbers stand: 1, the inputs, what the functions give, joints, copies, readouts.

    Attributes:
        place: Place of every row of the program that has one.
        parts: For every stage, for every function, places (start, stop) of what it gives.
        joints: For every stage, (target, operator, first, second) by places.
        elements: For every stage the elements, in the order of their places.
        readouts: First place of the outputs of the circuit, and the one after the last.
        count: Number of places.
    """

    place: Mapping[int, int]
    parts: Sequence[Sequence[tuple[str, int, int]]]
    joints: Sequence[Sequence[tuple[int, str, int, int]]]
    elements: Sequence[Sequence[Element]]
    readouts: tuple[int, int]
    count: int

    @property
    def is_bounded(self) -> bool:
        """Whether the outputs of all neurons are, so that finite inputs give finite ones."""
        return all(function in BOUNDED for parts in self.parts for function, _, _ in parts)


def make_layout(program: Program, stages: Sequence[Stage]) -> Layout:
    """Give the results of one function in one stage neighbouring places."""
    place = {1 + i: 1 + i for i in range(len(program.input_names))}
    count = 1 + len(place)
    all_parts, all_joints, all_elements = [], [], []
    for stage in stages:
        parts, joints, elements = [], [], []
        where: dict[tuple[int, int], int] = {}
        for cell in stage.cells:  # before their elements, which no product reads
            if cell.joint:
                place[cell.target] = count
                count += 1
        for function in sorted({e.function for cell in stage.cells for e in cell.elements}):
            start = count
            chosen = [
                (len(cell.elements), i, number, cell)
                for number, cell in enumerate(stage.cells)
                for i, element in enumerate(cell.elements)
                if element.function == function
            ]
            for length, i, number, cell in sorted(chosen, key=lambda each: each[:3]):
                elements.append(cell.elements[i])
                where[number, i] = count
                if length == 1:
                    place[cell.target] = count
                count += 1
            parts.append((function, start, count))
        for number, cell in enumerate(stage.cells):
            if cell.joint:
                joints.append((place[cell.target], cell.joint, where[number, 0], where[number, 1]))
        all_parts.append(parts)
        all_joints.append(joints)
        all_elements.append(elements)
    copied = {target for stage in stages for _, target in stage.copies}
    for row in sorted(copied) + sorted(_written(program.after)):
        place[row] = count
        count += 1
    first = place[program.readout_rows[0]] if program.output_names else 0
    return Layout(
        place, all_parts, all_joints, all_elements, (first, first + len(program.output_names)), count
    )


def _written(operations: Sequence[Operation]) -> set[int]:
    rows: set[int] = set()
    for operation in operations:
        if isinstance(operation, Sum):
            rows.update(range(operation.start, operation.stop))
        elif isinstance(operation, Map):
            for row, _ in operation.results:
                rows.update(range(row, row + operation.count))
    return rows


def moved(operation: Operation, layout: Layout) -> Sum | Map:
    """Move an operation on the outputs to the places of its rows; ranges of rows stay ranges."""
    if isinstance(operation, Sum):
        rows = (operation.sources + operation.base).tolist()
        start = layout.place[operation.start]
        return replace(
            operation,
            start=start,
            stop=start + operation.stop - operation.start,
            sources=np.array([layout.place[row] for row in rows], dtype=np.int32),
            base=0,
        )
    if isinstance(operation, Map):
        return replace(
            operation,
            results=tuple((layout.place[row], expression) for row, expression in operation.results),
            rows={name: layout.place[row] for name, row in operation.rows.items()},
        )
    message = "only sums and maps can be moved"
    raise TypeError(message)


@dataclass(frozen=True, eq=False)
class Readout:
    """Outputs of the circuit as `clip(matrix s, low, high)`, s being the numbers as they stand.

    Attributes:
        first: The first of the places that are multiplied.
        matrix: Shape (n_outputs, number of places that are multiplied).
        low: Lower limits, shape (n_outputs, 1).
        high: Upper limits, shape (n_outputs, 1).
    """

    first: int
    matrix: FloatArray
    low: FloatArray
    high: FloatArray


def make_readout(operations: Sequence[Operation], layout: Layout) -> Readout | None:
    """Make the outputs of the circuit as one product; None if they are something else."""
    rows = np.zeros((layout.count, layout.count))
    limits = np.tile([-np.inf, np.inf], (layout.count, 1))
    for operation in operations:
        found = moved(operation, layout)
        if isinstance(found, Sum):
            weights = np.broadcast_to(found.weights, found.sources.shape)
            targets = np.repeat(np.arange(found.start, found.stop), np.diff(found.indptr))
            np.add.at(rows, (targets, found.sources), weights)
        elif not _accumulate(found, rows, limits):
            return None
    part = slice(*layout.readouts)
    used = np.flatnonzero(rows[part].any(axis=0))
    first, stop = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 1)
    return Readout(first, rows[part, first:stop], limits[part, :1], limits[part, 1:])


def _accumulate(operation: Map, rows: FloatArray, limits: FloatArray) -> bool:
    """Put the rows and limits of `clip(keep before + sum, low, high)` into their places."""
    ((target, expression),) = operation.results
    part = slice(target, target + operation.count)
    constants = {n: np.broadcast_to(v, (operation.count,)) for n, v in operation.constants.items()}
    match expression:
        case Call("min", (Call("max", (inside, Name(low))), Name(high))):
            limits[part, 0], limits[part, 1] = constants[low], constants[high]
            expression = inside
    match expression:
        case Binary("+", Binary("*", Name(keep), Name(before)), Name(total)):
            places = np.arange(operation.count)
            rows[target + places] = rows[operation.rows[total] + places]
            rows[target + places, operation.rows[before] + places] += constants[keep]
            return True
        case Name(total):
            rows[part] = rows[operation.rows[total] : operation.rows[total] + operation.count]
            return True
    return False


def matrices(stages: Sequence[Stage], layout: Layout, sigmoid: float) -> list[FloatArray]:
    """G of every stage, shape (n_elements, k): it multiplies the first k places.

    Arguments of sigmoids come out with the sign `sigmoid`. There are two rows at least, for numpy copies the
    numbers before it multiplies one.
    """
    found = []
    for stage, elements in zip(stages, layout.elements, strict=True):
        matrix = np.zeros((max(len(elements), 2), layout.count))
        for i, element in enumerate(elements):
            matrix[i, 0] = element.constant
            for row, weight in stage.terms[element.row]:
                matrix[i, layout.place[row]] += element.gain * weight
            if element.function == "sigmoid":
                matrix[i] *= sigmoid
        used = int(np.flatnonzero(matrix.any(axis=0)).max(initial=0)) + 1
        found.append(np.ascontiguousarray(matrix[:, :used]))
    return found
