"""Dimensions of expressions, against dimensional analysis by numbers and by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import expression_trees

from circuitkit.base.errors import ExpressionError
from circuitkit.base.units import parse_unit
from circuitkit.circuit.expressions.dimensions import (
    NO_DIMENSION,
    OpenDimension,
    check_dimension,
    dimension_of,
)
from circuitkit.circuit.expressions.expression import (
    COMPARISONS,
    Expression,
)
from circuitkit.circuit.expressions.parsing import parse_expression


def of(unit: str) -> OpenDimension:
    return OpenDimension(parse_unit(unit).dimension)


NAMES = {
    "v": of("V"),
    "i": of("A"),
    "tau": of("s"),
    "phi": of("rad"),
    "n": NO_DIMENSION,
    "A": OpenDimension(activation=1),
    "pre": OpenDimension(source=1),
}


@pytest.mark.parametrize(
    ("text", "dimension"),
    [
        ("v / tau", of("V/s")),
        ("v * i * tau", of("J")),
        ("sqrt(v ** 2 + v * v)", of("V")),
        ("(v / v) ** n", NO_DIMENSION),
        ("v ** -2", of("V^-2")),
        ("(v * v) ** 0.5", of("V")),
        ("(v * v) ** (1 / 2)", of("V")),
        ("max(0, v) + clip(v, -v, 0)", of("V")),
        ("where(v > 0, i, 0)", of("A")),
        ("where(i < i, 1, 2)", NO_DIMENSION),
        ("sin(phi) + cos(n)", NO_DIMENSION),
        ("hypot(v, 0) + hypot(0, v)", of("V")),
        ("atan2(v, v) + phi", of("rad")),
        ("atan2(0, n)", of("rad")),
        ("(v > 0 and i > 0) + (not v > 0 or n)", NO_DIMENSION),
        ("exp(v / v) + sigmoid(n) + exprel(0) + floor(n)", NO_DIMENSION),
        ("heaviside(v) * sign(i) * abs(v)", of("V")),
        ("(0 - A) / tau", OpenDimension(parse_unit("/s").dimension, activation=1)),
        ("A / pre * n", OpenDimension(activation=1, source=-1)),
        ("0", None),
        ("-0 * v", None),
        ("0 / v", None),
        ("max(0, 0) + v", of("V")),
        ("(v > i * v / i) + 1", NO_DIMENSION),
        ("0 ** n", NO_DIMENSION),
    ],
)
def test_dimensions_by_hand(text, dimension):
    assert dimension_of(parse_expression(text, NAMES), NAMES) == dimension


SAME = "allowed: the same on all sides"
PLAIN = "allowed: a plain number there"
EXPONENT = "allowed: a number as exponent that gives whole powers of the unit"


@pytest.mark.parametrize(
    ("text", "at", "message"),
    [
        ("n * (v + i)", "v", f"found 'v + i', which joins V and A; {SAME}"),
        ("1 + v", "1", f"found '1 + v', which joins a plain number and V; {SAME}"),
        ("v / tau < v", "v", f"found 'v / tau < v', which joins V/s and V; {SAME}"),
        ("n + max(A, v)", "max", f"found 'max(A, v)', which joins activation and V; {SAME}"),
        ("where(v, A, A / tau)", "where", "found 'where(v, A, A / tau)', which joins activation and"),
        ("clip(v, 0, 1)", "clip", f"found 'clip(v, 0, 1)', which joins V and a plain number; {SAME}"),
        ("n * exp(v)", "exp", f"found 'exp(v)' with V; {PLAIN}"),
        ("tanh(A)", "tanh", f"found 'tanh(A)' with activation; {PLAIN}"),
        ("sin(v)", "sin", f"found 'sin(v)' with V; {PLAIN}"),
        ("n ** v", "n", f"found 'n ** v' with V; {PLAIN}"),
        ("v ** n", "n", f"found 'v ** n', a power of V; {EXPONENT}"),
        ("n + v ** 0.5", "0.5", f"found 'v ** 0.5', a power of V; {EXPONENT}"),
        ("sqrt(v)", "sqrt", "found 'sqrt(v)', the root of V; allowed: even powers of a unit there"),
        ("exp(1 / pre / tau)", "exp", f"found 'exp(1 / pre / tau)' with 1/source/s; {PLAIN}"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(text, at, message):
    with pytest.raises(ExpressionError) as caught:
        dimension_of(parse_expression(text, NAMES), NAMES)
    assert str(caught.value).startswith(message)
    assert caught.value.offset == text.index(at)


def test_the_dimension_wanted_is_named():
    expression = parse_expression("v * tau", NAMES)
    check_dimension(expression, NAMES, of("V*s"))
    check_dimension(parse_expression("0", NAMES), NAMES, of("V*s"))
    with pytest.raises(ExpressionError) as caught:
        check_dimension(expression, NAMES, of("V/s"))
    assert str(caught.value) == "found 'v * tau', which is V*s; allowed: V/s"


expressions = expression_trees(st.sampled_from([0.0, 0.5, 2.0]), NAMES, max_leaves=6)


def scaled(dimension: OpenDimension, units: list[float]) -> float:
    """How much a value grows if every base unit becomes smaller by these factors."""
    exponents = (*dimension.fixed, dimension.activation, dimension.source)
    return math.prod(unit**exponent for unit, exponent in zip(units, exponents, strict=True))


@given(expressions, st.lists(st.sampled_from([0.5, 2.0, 4.0]), min_size=8, max_size=8), st.data())
def test_values_scale_with_their_dimension(expression: Expression, units, data):
    """Change the units of everything, and the value of whatever passes changes by that of its own."""
    units[3] = 1.0  # the radian is what sine and cosine take
    try:
        dimension = dimension_of(expression, NAMES)
    except ExpressionError:
        return
    values = {name: data.draw(st.sampled_from([-1.7, 0.3, 1.1])) for name in NAMES}
    there = {name: value * scaled(NAMES[name], units) for name, value in values.items()}
    try:
        before, after = expression.evaluate(values), expression.evaluate(there)
    except (ArithmeticError, ValueError):
        return
    assume(math.isfinite(before) and math.isfinite(after))
    if dimension is None:
        assert before == after == 0
    else:
        assert after == pytest.approx(before * scaled(dimension, units), rel=1e-9)


@pytest.mark.parametrize(
    "unit", ["V", "/V", "V/s", "s/V", "S", "A*s", "N", "m/s", "/s", "rad", "kg*m", "/F/s"]
)
def test_dimensions_are_shown_as_units(unit):
    dimension = of(unit)
    assert (
        of(str(dimension).replace("1/", "/", 1) if str(dimension).startswith("1/") else str(dimension))
        == dimension
    )
    assert len(str(dimension)) <= len(unit) + 1


def test_comparisons_are_numbers():
    for order in COMPARISONS:
        assert dimension_of(parse_expression(f"v {order} v", NAMES), NAMES) == NO_DIMENSION
