"""Derivatives against finite differences; simplification and substitution against evaluation."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from circuitkit.circuit.expressions.expression import (
    BINARY_OPERATORS,
    FUNCTION_ARITY,
    SCALAR_FUNCTIONS,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.expressions.expression import Binary as Joined
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.circuit.expressions.symbolic import constant, derivative, simplify, substitute

NAMES = ("x", "y")
points = st.floats(-3, 3)
# No kink of a short expression is at these.
odd_x = st.integers(-30, 30).map(lambda k: 0.0971 * k + 0.01237)
odd_y = st.integers(-30, 30).map(lambda k: 0.0923 * k + 0.03191)


def parsed(text: str) -> Expression:
    return parse_expression(text, NAMES)


expressions = st.recursive(
    st.sampled_from([0.0, 0.5, 1.0, 2.0]).map(Number) | st.sampled_from(NAMES).map(Name),
    lambda inner: (
        st.builds(Unary, st.sampled_from("+-"), inner)
        | st.builds(Joined, st.sampled_from(BINARY_OPERATORS), inner, inner)
        | st.sampled_from(sorted(FUNCTION_ARITY)).flatmap(
            lambda name: st.tuples(*[inner] * FUNCTION_ARITY[name]).map(
                lambda arguments: Call(name, arguments)
            )
        )
    ),
    max_leaves=6,
)


# Of zeros without a sign, as `simplify` takes them: -0.0 + 0.0 is 0.0.
FUNCTIONS = {**SCALAR_FUNCTIONS, "atan2": lambda y, x: math.atan2(y + 0.0, x + 0.0)}


def value(expression: Expression, x: float, y: float) -> float:
    """The value, or NaN where there is none."""
    try:
        found = expression.evaluate({"x": x, "y": y}, FUNCTIONS)
    except (ArithmeticError, ValueError):
        return math.nan
    return found if isinstance(found, float | int) else math.nan


SMOOTH = [
    "x ** 3 - 2 * x / (y + 5)",
    "(x + 4) ** y",
    "(y * y + 1) ** (x / 4) * (y > 0)",
    "exp(-x ** 2) * sin(3 * x) + cos(x * y)",
    "sqrt(x + 4) * log(x + 4)",
    "log1p(x / 4) - expm1(x)",
    "exprel(x)",
    "exprel(x * 1e-4)",
    "exprel(-3 * x * y)",
    "sigmoid(5 * (x - y)) * sigmoid(-x)",
    "tanh(x / y)",
    "--x / -(x - 9)",
]


@pytest.mark.parametrize("text", SMOOTH)
@given(x=points, y=points.filter(lambda y: abs(y) > 0.1))
def test_derivatives_are_limits_of_differences(text, x, y):
    expression, h = parsed(text), 1e-5
    assume(not math.isnan(value(expression, x, y)))
    ahead, behind = value(expression, x + h, y), value(expression, x - h, y)
    # Error of a central difference: h^2/6 times the third derivative, and rounding over h.
    scale = 1 + abs(ahead) + abs(derivative(expression, "x").evaluate({"x": x, "y": y}))
    assert value(derivative(expression, "x"), x, y) == pytest.approx(
        (ahead - behind) / (2 * h), abs=1e-5 * scale
    )


@given(expressions, odd_x, odd_y)
def test_derivatives_of_any_expression_are_limits_of_differences(expression, x, y):
    """Where the expression is smooth, seen from two step widths that agree."""
    slope = value(derivative(expression, "x"), x, y)

    def difference(h: float) -> float:
        return (value(expression, x + h, y) - value(expression, x - h, y)) / (2 * h)

    wide, narrow = difference(1e-4), difference(1e-5)
    assume(math.isfinite(wide) and math.isfinite(narrow) and math.isfinite(slope))
    assume(abs(value(expression, x, y)) < 1e3 and abs(wide) < 1e3)
    assume(abs(wide - narrow) < 1e-6 * (1 + abs(wide)))
    assert slope == pytest.approx(narrow, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(y - x) / 5", "-0.2"),
        ("y", "0"),
        ("x", "1"),
        ("3 * x + y", "3"),
        ("(y - x) / tau", "-(1 / tau)"),
        ("where(y > 0, 0, y - x)", "where(y > 0, 0, -1)"),
        ("abs(x)", "sign(x)"),
        ("floor(x) + heaviside(x) + sign(x) + (x < y)", "0"),
        ("max(x, y)", "where(x >= y, 1, 0)"),
        ("min(x, y)", "where(x <= y, 1, 0)"),
        ("clip(x, 0, y)", "where(max(x, 0) <= y, where(x >= 0, 1, 0), 0)"),
    ],
)
def test_derivatives_are_as_short_as_by_hand(text, expected):
    names = (*NAMES, "tau")
    found = derivative(parse_expression(text, names), "x")
    if constant(found) is not None:
        assert constant(found) == pytest.approx(float(expected))
    else:
        assert str(found) == expected


@given(expressions, points, points)
def test_simplification_keeps_the_value(expression, x, y):
    before, after = value(expression, x, y), value(simplify(expression), x, y)
    assume(math.isfinite(before))
    assert after == pytest.approx(before, rel=1e-9, abs=1e-9)


@given(expressions)
def test_simplified_text_reads_as_the_same(expression):
    simple = simplify(expression)
    assert parsed(str(simple)) == simple
    assert simplify(simple) == simple


@pytest.mark.parametrize(
    ("text", "simple"),
    [
        ("0 * x + 1 * y", "y"),
        ("x * (2 - 1) + 0 / y", "x"),
        ("x ** 1 + y ** 0", "x + 1"),
        ("0 - x", "-x"),
        ("-(-x)", "x"),
        ("+x - -y", "x + y"),
        ("x * -1 / y", "-(x / y)"),
        ("where(1 < 2, x, y)", "x"),
        ("where(x, y, y)", "y"),
        ("1 / 0 + x", "1 / 0 + x"),
        ("log(0) + x", "log(0) + x"),
        ("3 - 5", "-2"),
    ],
)
def test_simplification(text, simple):
    assert str(simplify(parsed(text))) == simple


@given(expressions, expressions, points, points)
def test_substitution_is_evaluation_at_the_value(outer, inner, x, y):
    at = value(inner, x, y)
    assume(math.isfinite(at))
    direct = value(outer, at, y)
    assume(not math.isnan(direct))
    assert value(substitute(outer, {"x": inner}), x, y) == direct


def test_substitution_replaces_all_at_once():
    swapped = substitute(parsed("x - sin(y) * -x"), {"x": Name("y"), "y": Name("x")})
    assert swapped == parsed("y - sin(x) * -y")
