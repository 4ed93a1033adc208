"""Reads measures: a text becomes a formula, whose arguments and units fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from circuitkit.base.errors import ExpressionError
from circuitkit.base.units import Dimension, Unit, parse_unit
from circuitkit.circuit.expressions.dimensions import (
    DimensionError,
    OpenDimension,
    dimension_of,
    named_symbol,
)
from circuitkit.circuit.expressions.expression import COMPARISONS, Binary, Call, Expression, Name, Number
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.robots.parts import ARITIES, REFERENCES, StandIn
from circuitkit.robots.spec import ENDED, TIME
from circuitkit.simulation.formulas import Formula, mapped
from circuitkit.simulation.reductions import CONDITIONAL, PLAIN, REDUCTIONS, SECOND

_FUNCTIONS: Mapping[str, tuple[int, int]] = {
    **dict.fromkeys(REDUCTIONS, (1, 1)),
    "max": (1, 50),
    "min": (1, 50),
    "outside": (1, 3),
    "after": (2, 2),
    "between": (3, 3),
}


def parse_measure(text: str, units: Mapping[str, Unit], bounded: Iterable[str] = ()) -> Formula:
    """Read an expression that measures.

    Args:
        text: The expression.
        units: Unit of every channel and command that it may name.
        bounded: Channels that have bounds, for `outside` with one argument.

    Raises:
        ExpressionError: It is no such expression; its `offset` says where.
    """
    names = {*units, TIME, ENDED}
    tree = parse_expression(text, names, units=True, references=ARITIES, functions=_FUNCTIONS)
    dimensions = {name: OpenDimension(unit.dimension) for name, unit in units.items()}
    dimensions |= {TIME: SECOND, ENDED: PLAIN}
    references: dict[str, Call] = {}
    tree = _named(tree, references)
    # What a reference is measured in is known when the model is there; until then its own checks have to do.
    placeholders = {name: OpenDimension(units[name].dimension) for name in references if name in units}
    checker = _Checker(dimensions | placeholders, set(bounded))
    shown = checker.replaced(tree)
    unknown = [name for name in references if name not in units]
    dimension = None if unknown else dimension_of(shown, dimensions | placeholders | checker.extra)
    unit = parse_unit("1") if dimension is None else _unit_like(dimension.fixed, tree, units)
    used = tuple(name for name in sorted(tree.names()) if name not in {TIME, ENDED})
    return Formula(text, tree, unit, _is_condition(tree), used, tuple(references.values()))


def _unit_like(dimension: Dimension, tree: Expression, units: Mapping[str, Unit]) -> Unit:
    """The SI unit as a channel of the expression has it, such as N*m, rather than in base units."""
    for name in sorted(tree.names()):
        if name in units and units[name].dimension == dimension and units[name].scale == 1:
            return units[name]
    return parse_unit(named_symbol(dimension))


def _named(tree: Expression, references: dict[str, Call]) -> Expression:
    """Replace every reference by a name that is its text."""
    if isinstance(tree, Call) and tree.function in REFERENCES:
        references[str(tree)] = tree
        return StandIn(str(tree), offset=tree.offset)
    return mapped(tree, lambda each: _named(each, references))


class _Checker:
    """Finds the dimension of a measure, reduction by reduction.

    Attributes:
        extra: The dimensions of what stands for reductions.
    """

    def __init__(self, names: Mapping[str, OpenDimension], bounded: set[str]) -> None:
        self._names, self._bounded = names, bounded
        self.extra: dict[str, OpenDimension] = {}

    def replaced(self, part: Expression) -> Expression:
        """The expression with a name for every reduction.

        Raises:
            ExpressionError: A function has other arguments than it takes; says where.
        """
        match part:
            case Call(function="outside"):
                return self._outside(part)
            case Call(function="after" | "between"):
                return self._window(part)
            case Call(function=function, arguments=(argument,)) if function in REDUCTIONS:
                return self._reduction(part, argument)
        return mapped(part, self.replaced)

    def _outside(self, part: Call) -> Expression:
        arguments = part.arguments
        if len(arguments) == 2:  # noqa: PLR2004 - one or three
            message = "found outside with 2 arguments; allowed: outside(x, low, high), or outside(channel)"
            raise ExpressionError(message, part.offset)
        has_bounds = isinstance(arguments[0], Name) and arguments[0].name in self._bounded
        if len(arguments) == 1 and not has_bounds:
            message = f"found '{part}', whose bounds are not known; allowed: outside(x, low, high)"
            raise ExpressionError(message, part.offset)
        alike, *others = (self.replaced(each) for each in arguments)
        for other in others:
            alike = Call("max", (alike, other), offset=part.offset)
        try:
            return self._stand_in(part, self._known(alike))
        except DimensionError as error:
            raise ExpressionError(error.of(str(part)), part.offset) from error

    def _window(self, part: Call) -> Expression:
        argument, *times = part.arguments
        for each in times:
            if self._known(self.replaced(each)) not in {None, SECOND}:
                message = f"found '{part}'; allowed: times there, such as after({argument}, 2 s)"
                raise ExpressionError(message, each.offset)
        return self._stand_in(part, self._known(self.replaced(argument)))

    def _reduction(self, part: Call, argument: Expression) -> Expression:
        inside = self.replaced(argument)
        if part.function in CONDITIONAL and not _is_condition(argument):
            message = f"found '{part}'; allowed: a condition there, such as {part.function}(x > 0)"
            raise ExpressionError(message, part.offset)
        return self._stand_in(part, REDUCTIONS[part.function].dimension(self._known(inside)))

    def _known(self, part: Expression) -> OpenDimension | None:
        """The dimension; None if it is zero, or names what is known only with the model."""
        if any(name not in self._names and name not in self.extra for name in part.names()):
            return None
        return dimension_of(part, {**self._names, **self.extra})

    def _stand_in(self, part: Call, dimension: OpenDimension | None) -> Expression:
        if dimension is None:
            return Number(0.0, offset=part.offset)
        self.extra[str(part)] = dimension
        return StandIn(str(part), offset=part.offset)


def _is_condition(tree: Expression) -> bool:
    """Whether a value is true or false: comparisons, `ended`, and what and, or and not make of them."""
    match tree:
        case Name(name=name):
            return name == ENDED
        case Binary(operator=joint) if joint in COMPARISONS:
            return True
        case Call(function="where", arguments=(_, then, otherwise)):  # what and, or and not are read as
            return all(_is_condition(each) or _is_truth(each) for each in (then, otherwise))
        case Call(function="last" | "first" | "after" | "between", arguments=(argument, *_)):
            return _is_condition(argument)
    return False


def _is_truth(tree: Expression) -> bool:
    return isinstance(tree, Number) and tree.value in {0.0, 1.0}
