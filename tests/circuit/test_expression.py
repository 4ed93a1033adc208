"""Expressions: what they compute, against Python's own arithmetic; and what is refused."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import expression_trees

from circuitkit.base.errors import ExpressionError
from circuitkit.circuit.expressions.expression import (
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.circuit.expressions.symbolic import simplify

NAMES = ("A", "slope", "shift")


def value(text: str, **values: float) -> float:
    return parse_expression(text, tuple(values)).evaluate(values)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2 * 3", 7.0),
        ("(1 + 2) * 3", 9.0),
        ("2 ^ 3 ^ 2", 512.0),
        ("2 ** 3", 8.0),
        ("-2 ^ 2", -4.0),
        ("3 * 2 ^ 2", 12.0),
        ("1 - 2 - 3", -4.0),
        ("8 / 4 / 2", 1.0),
        ("+5", 5.0),
        ("1e-3", 0.001),
        ("exp(1)", math.e),
        ("log(exp(2))", 2.0),
        ("sqrt(16)", 4.0),
        ("abs(-3)", 3.0),
        ("min(2, 3) + max(2, 3)", 5.0),
        ("tanh(0.5)", math.tanh(0.5)),
        ("sin(1) ^ 2 + cos(1) ^ 2", 1.0),
        ("sigmoid(0)", 0.5),
        ("sigmoid(log(3))", 0.75),
        ("heaviside(-1) + heaviside(0) + heaviside(1)", 2.0),
        ("sign(-3) + 10 * sign(0) + 100 * sign(0.1)", 99.0),
        ("floor(-1.5)", -2.0),
        ("log1p(1e-20)", 1e-20),
        ("expm1(1e-20)", 1e-20),
        ("exprel(0)", 1.0),
        ("exprel(2)", (math.e**2 - 1) / 2),
        ("exprel(-1e-9)", 1 - 0.5e-9),
        ("clip(5, 0, 2) + clip(-5, 0, 2) + clip(1, 0, 2)", 3.0),
        ("(1 < 2) + 2 * (2 < 2) + 4 * (2 <= 2) + 8 * (3 > 2) + 16 * (2 > 2) + 32 * (2 >= 2)", 45.0),
        ("1 + 1 < 3 - 2", 0.0),
        ("where(1 < 2, 3, 4) + where(1 > 2, 30, 40)", 43.0),
        ("sin(pi / 2) + cos(pi)", 0.0),
        ("hypot(3, -4)", 5.0),
        ("hypot(1e200, 1e200)", math.hypot(1e200, 1e200)),
        ("atan2(1, -1) + 10 * atan2(-1, 1)", math.atan2(1, -1) + 10 * math.atan2(-1, 1)),
        ("(1 < 2 and 2 < 3) + 2 * (1 < 2 and 3 < 2) + 4 * (2 < 1 and 2 < 3)", 1.0),
        ("(1 < 2 or 3 < 2) + 2 * (2 < 1 or 3 < 2) + 4 * (2 < 1 or 2 < 3)", 5.0),
        ("(not 1 < 2) + 2 * (not 2 < 1) + 4 * (not 7)", 2.0),
        ("(1 < 2 and 5) + 10 * (0 or -3) + 100 * (2 and 3 and 4)", 111.0),
        ("2 < 1 and 2 < 1 or 1 < 2", 1.0),
        ("not 1 < 2 or 1 < 2", 1.0),
    ],
)
def test_expressions_have_their_value(text, expected):
    assert value(text) == pytest.approx(expected, rel=1e-15)


@given(st.floats(-1e300, 1e300))
def test_the_sigmoid_never_overflows_and_is_symmetric(x):
    high, low = value("sigmoid(x)", x=x), value("sigmoid(-x)", x=x)
    assert 0 <= low <= 1
    assert high + low == pytest.approx(1, abs=1e-15)


def test_the_tree_has_the_shape_of_the_text():
    tree = parse_expression("sigmoid(slope * (A - -1))", NAMES)
    difference = Binary("-", Name("A"), Unary("-", Number(1.0)))
    assert tree == Call("sigmoid", (Binary("*", Name("slope"), difference),))
    assert tree.names() == {"slope", "A"}


expressions = expression_trees(st.floats(0, 1e6), NAMES, max_leaves=8)


@given(expressions)
def test_the_text_of_an_expression_parses_to_the_same_expression(tree: Expression):
    assert parse_expression(str(tree), NAMES) == tree


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("((a)) + (b * c)", "a + b * c"),
        ("(a - b) - c", "a - b - c"),
        ("a - (b - c)", "a - (b - c)"),
        ("a / (b * c)", "a / (b * c)"),
        ("-(a ^ b)", "-a ** b"),
        ("(-a) ^ (-b)", "(-a) ** -b"),
        ("(a ^ b) ^ c", "(a ** b) ** c"),
        ("a ^ (b ^ c)", "a ** b ** c"),
        ("-(a + b) * -c", "-(a + b) * -c"),
        ("(a + b < c) * 2.50", "(a + b < c) * 2.5"),
        ("(a < b) < c", "(a < b) < c"),
        ("where((a), 1e-9, 3.0)", "where(a, 1e-09, 3)"),
    ],
)
def test_the_text_has_no_more_parentheses_than_it_takes(text, printed):
    assert str(parse_expression(text, ("a", "b", "c"))) == printed


def test_powers_are_real():
    with pytest.raises(ValueError, match="a negative number has no real power of this exponent"):
        value("x ^ 0.5", x=-2.0)


def test_a_name_may_be_called_like_a_constant():
    assert value("2 * pi", pi=10.0) == 20.0


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("B + 1", "B"),
        ("  A ^ 2 ^ 3 + B", "B"),
        ("A ^ (2 + sigmoyd(A))", "sigmoyd"),
        ("A * min(A)", "min"),
        ("A + A[0]", "A[0]"),
        ("A\n  + 'text'", "'"),
        ("A + 1e999", "1e999"),
        ("A + (1 < 2 < 3)", "1 < 2 < 3"),
        ("A ^ 2 + = 3", "="),
        ("slope + (A ^ 2) // 3", "//"),
        ("slope + (A == 3)", "=="),
        ("(A) % 2", "%"),
    ],
)
def test_the_error_says_where_in_the_text(text, found):
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text, NAMES)
    assert caught.value.offset == text.index(found)


@given(st.sampled_from(["", " ", "  "]), st.lists(st.sampled_from(["A^2", "A**2", "slope"]), max_size=5))
def test_every_part_knows_where_it_was_read(blank, terms):
    text = blank + " + ".join([*terms, "sin(shift)"])
    tree = parse_expression(text, NAMES)
    last = tree.right if isinstance(tree, Binary) else tree
    assert isinstance(last, Call)
    assert last.offset == text.index("sin")
    assert last.arguments[0].offset == text.index("shift")


FUNCTIONS = (
    "abs, atan2, clip, cos, exp, expm1, exprel, floor, heaviside, hypot, log, log1p, max, min, sigmoid, "
    "sign, sin, sqrt, tanh, where"
)
ALLOWED = "numbers, names, + - * / ^ < <= > >= and or not, and functions"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("B + 1", "unknown name 'B'; allowed: A, shift, slope"),
        ("slop * A", "unknown name 'slop'; allowed: A, shift, slope; did you mean 'slope'?"),
        ("sigmoyd(A)", f"unknown function 'sigmoyd'; allowed: {FUNCTIONS}; did you mean 'sigmoid'?"),
        ("min(A)", "found min with 1 arguments; allowed: 2 or more"),
        ("__import__('os')", f"unknown function '__import__'; allowed: {FUNCTIONS}"),
        ("A.real", f"found 'A.real'; allowed: {ALLOWED}"),
        ("A[0]", f"found 'A[0]'; allowed: {ALLOWED}"),
        ("A if A else 1", f"found 'A if A else 1'; allowed: {ALLOWED}; did you mean 'where(A, A, 1)'?"),
        ("A == 1", f"found 'A == 1'; allowed: {ALLOWED}"),
        ("0 < A < 1", f"found '0 < A < 1'; allowed: {ALLOWED}; did you mean '0 < A and A < 1'?"),
        ("A is 1", f"found 'A is 1'; allowed: {ALLOWED}"),
        ("not", f"cannot read the expression 'not'; allowed: {ALLOWED}"),
        ("sensor(A)", f"unknown function 'sensor'; allowed: {FUNCTIONS}"),
        ("lambda: 1", f"found 'lambda: 1'; allowed: {ALLOWED}"),
        ("max(*A)", "found max with 1 arguments; allowed: 2 or more"),
        ("exp(x=1)", f"found 'exp(x=1)'; allowed: {ALLOWED}"),
        ("'text'", f"found ''text''; allowed: {ALLOWED}"),
        ("1j", f"found '1j'; allowed: {ALLOWED}"),
        ("True", f"found 'True'; allowed: {ALLOWED}"),
        ("A +", f"cannot read the expression 'A +'; allowed: {ALLOWED}"),
        ("", f"cannot read the expression ''; allowed: {ALLOWED}"),
        ("1e999", "found a number that is too large; allowed: finite numbers"),
        ("1" * 1001, "found an expression of 1001 characters; allowed: 1000"),
        ("-" * 60 + "A", "found an expression nested more than 50 deep; allowed: up to 50"),
    ],
)  # fmt: skip
def test_what_is_no_expression_is_refused(text, message):
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text, NAMES)
    assert str(caught.value) == message


@given(st.text(max_size=20))
def test_any_text_is_an_expression_or_refused(text):
    try:
        tree = parse_expression(text, NAMES)
    except ExpressionError:
        return
    assert isinstance(tree, Expression)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("40 mV + v", 1.04),
        ("(v + 1 V) / 5 mV", 400.0),
        ("2mV", 0.002),
        ("0.03 /ms * 2", 60.0),
        ("3 m/s^2 * 2 s", 6.0),
        ("4 kg*m^2 / v", 4.0),
        ("2 V / v", 2.0),
        ("5 % * v", 0.05),
        ("1 / g", 0.5),  # a name goes before a unit
        ("3 * g", 6.0),
        ("1e-3 kHz + 1.5e3 ms / 1 s", 2.5),
    ],
)
def test_numbers_may_have_units(text, expected):
    values = {"v": 1.0, "g": 2.0}
    tree = parse_expression(text, values, units=True)
    assert tree.evaluate(values) == pytest.approx(expected, rel=1e-15)
    assert parse_expression(str(tree), values, units=True) == tree


@pytest.mark.parametrize("text", ["v + 40 mV", "5 % * v", "v / 0.03 /ms", "-3 m/s^2 ** v", "2 * 79.9 mm"])
def test_quantities_are_printed_as_they_were_written(text):
    assert str(parse_expression(text, ("v",), units=True)) == text


@pytest.mark.parametrize(
    ("text", "offset", "message"),
    [
        ("v + 40 mW2", 7, "cannot read the expression 'v + 40 mW2'"),
        ("v + 40 mv", 7, "unknown unit 'mv'; allowed: 1, %"),
        ("40 mV + w", 8, "unknown name 'w'; allowed: v"),
        ("1 + v[40 mV]", 4, "found 'v[40 mV]'; allowed"),
        ("40 mV v", 6, "cannot read the expression '40 mV v'; allowed"),
        ("v + A", 4, "unknown name 'A'; allowed: v"),
    ],
)
def test_what_is_wrong_beside_units(text, offset, message):
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text, ("v",), units=True)
    assert str(caught.value).startswith(message)
    assert caught.value.offset == offset


@given(*[st.floats(-9, 9) | st.sampled_from([0.0, 1.0])] * 3)
def test_conditions_are_joined_as_in_python(a, b, c):
    names = {"a": a, "b": b, "c": c}
    for text in (
        "a < b and b < c",
        "a < b or b >= c",
        "not a > b",
        "a and not b or c",
        "not (a and b <= c) and c",
    ):
        assert value(text, **names) == float(bool(eval(text, {}, names))), text


REFERENCES = {"sensor": (1, 1), "position": (1, 3)}


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("position(eye_left, x)", ("eye_left", "x")),
        ('position("left foot", x)', ("left foot", "x")),
        ("position('40 mm ^2 * (')", ("40 mm ^2 * (",)),
        ("position(leg.knee, pi)", ("leg.knee", "pi")),
        ("position(foot, -2, 40 mm)", ("foot", -2.0, 0.04)),
    ],
)
def test_arguments_of_references_are_taken_literally(text, arguments):
    tree = parse_expression(f"A + 2 * {text}", NAMES, units=True, references=REFERENCES)
    wanted = tuple(Name(each) if isinstance(each, str) else Number(each) for each in arguments)
    assert tree == Binary("+", Name("A"), Binary("*", Number(2.0), Call("position", wanted)))
    assert parse_expression(str(tree), NAMES, units=True, references=REFERENCES) == tree
    assert simplify(tree) == tree


@pytest.mark.parametrize(
    ("text", "offset", "message"),
    [
        ("A + sensor(a, b)", 4, "found sensor with 2 arguments; allowed: 1"),
        ("position()", 0, "found position with 0 arguments; allowed: 1 to 3"),
        ("sensor('a b' + A)", 7, "found ''a b' + A'; allowed: a name, a text in quotes, or a number"),
        ("1 + 'a b'", 4, f"found ''a b''; allowed: {ALLOWED}"),
        ("sensr(a)", 0, "unknown function 'sensr'; allowed: abs"),
    ],
)
def test_what_is_no_reference_is_refused(text, offset, message):
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text, NAMES, units=True, references=REFERENCES)
    assert str(caught.value).startswith(message)
    assert caught.value.offset == offset


def test_a_caller_may_add_functions_or_give_them_other_arguments():
    tree = parse_expression("max(first(A) / 2)", NAMES, functions={"first": (1, 1), "max": (1, 2)})
    assert tree == Call("max", (Binary("/", Call("first", (Name("A"),)), Number(2.0)),))


@pytest.mark.parametrize("name", ["ª", "µ", "ﬁ", "τ"])
def test_a_name_keeps_its_characters(name):
    """Python's own parser would take `ª` for `a`, and the micro sign for a Greek letter."""
    assert parse_expression(f"a + 2 * ({name})", ["a", name]).names() == {"a", name}
    read = parse_expression(f"joint(x.{name})", (), references={"joint": (1, 1)})
    assert read == Call("joint", (Name(f"x.{name}"),))
