"""Expressions with units as values of a circuit file, against arithmetic by hand."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from circuitkit.base.units import Quantity, parse_quantity
from circuitkit.circuit import check, parse_circuit
from circuitkit.circuit.expressions.values import ValueProblemError, evaluate, unknown_parameter

PARAMETERS = {
    "w": parse_quantity("2 deg"),
    "edge": parse_quantity("80 mm"),
    "margin": parse_quantity("5 mm"),
    "lateral.w": parse_quantity("3 deg"),
}


def look_up(name: str) -> Quantity:
    if name not in PARAMETERS:
        raise unknown_parameter(name, PARAMETERS)
    return PARAMETERS[name]


@pytest.mark.parametrize(
    ("text", "value", "dimension"),
    [
        ("edge - margin", 0.075, "length"),
        ("edge-margin", 0.075, "length"),
        ("-80 mm + edge / 2", -0.04, "length"),
        ("2 * w", math.radians(4), "angle"),
        ("cos(120 deg) * w", math.radians(-1), "angle"),
        ("sin(pi / 6) * 4", 2, "dimensionless"),
        ("100 /m", 100, "1/length"),
        ("100 / m", 100, "1/length"),
        ("1 / edge", 12.5, "1/length"),
        ("edge^2", 0.0064, "length^2"),
        ("sqrt(edge ** 2)", 0.08, "length"),
        ("max(edge, 3 cm)", 0.08, "length"),
        ("clip(edge, 1 cm, 2 cm)", 0.02, "length"),
        ("where(edge > margin, 1, 2)", 1, "dimensionless"),
        ("5 % * w", math.radians(0.1), "angle"),
        ("5 N*m/rad", 5, "length^2*mass/time^2/angle"),
        ("10 ms / 2", 0.005, "time"),
        ("2 / 3 * sin(210 deg)", -1 / 3, "dimensionless"),
        ("2/3", 2 / 3, "dimensionless"),
        ("edge ^ (margin / margin + 1)", 0.0064, "length^2"),
        ("(edge ^ 3) ^ (1 / 3)", 0.08, "length"),
        ("max(edge, 0)", 0.08, "length"),
        ("cos(pi) * mm", -0.001, "length"),
        ("lateral.w - w", math.radians(1), "angle"),
        ("80 mm \N{MINUS SIGN} margin", 0.075, "length"),
        ("(edge + margin) * (1 - 20 %)", 0.068, "length"),
        ("2e-3 m * 2", 0.004, "length"),
        ("where(edge > 1 cm and not margin > 1 m, edge, 0 m)", 0.08, "length"),
        ("(edge < 1 cm or margin < 1 m) + 2", 3, "dimensionless"),
        ("hypot(edge, 6 cm)", 0.1, "length"),
        ("atan2(margin, -margin)", 3 * math.pi / 4, "angle"),
        ("exp(edge / margin)", math.exp(16), "dimensionless"),
    ],
)
def test_expressions_are_worked_out_with_their_units(text, value, dimension):
    found = evaluate(text, look_up)
    assert found.value_si == pytest.approx(value, rel=1e-12)
    assert str(found.dimension) == dimension


@given(st.floats(-100, 100), st.floats(0.1, 100))
def test_arithmetic_is_that_of_floats(a, b):
    for sign, expected in (("+", a + b), ("-", a - b), ("*", a * b), ("/", a / b)):
        assert evaluate(f"({a!r}) {sign} {b!r}", look_up).value_si == expected


@given(st.sampled_from(["mm", "deg", "ms", "N", "mV"]), st.floats(-1e3, 1e3), st.integers(2, 9))
def test_a_multiple_keeps_its_unit_and_a_ratio_has_none(unit, value, factor):
    assume(value == 0 or abs(value) > 1e-300)  # in SI units it is no float any more
    quantity = parse_quantity(f"{value!r} {unit}")
    product = evaluate(f"{factor} * {value!r} {unit}", look_up)
    assert product.unit == quantity.unit
    assert product.value_si == factor * quantity.value_si
    if abs(value) > 1e-100:
        assert evaluate(f"{value!r} {unit} / ({value!r} {unit})", look_up).value_si == 1


@pytest.mark.parametrize(
    ("text", "message", "hint", "offset"),
    [
        ("edge - w", "found 'edge - w', which joins length and angle; allowed: the same on all sides", "", 0),
        ("edge < 2", "found 'edge < 2', which joins length and dimensionless; allowed: the same on all sides", "", 0),
        ("exp(edge)", "found 'exp(edge)' with length; allowed: a plain number there", "", 0),
        ("sqrt(edge)", "found 'sqrt(edge)', the root of length; allowed: even powers of a unit there", "", 0),
        ("2 ^ edge", "found '2 ^ edge' with length; allowed: a plain number there", "", 0),
        ("edge / 0", "found 'edge / 0', which has no value (float division by zero); allowed: a finite number", "", 0),
        ("exp(1000)", "found 'exp(1000)', which has no value (math range error); allowed: a finite number", "", 0),
        ("9 ^ 9 ^ 9", "found '9 ^ 9 ^ 9', which has no value (math range error); allowed: a finite number", "", 0),
        ("10 ^ 300 * 10 ^ 300", "found '10 ^ 300 * 10 ^ 300', which is too large or no number; allowed: a finite number", "", 0),
        ("(-8) ^ 0.5", "found '(-8) ^ 0.5', which has no value (a negative number has no real power of this exponent); allowed: a finite number", "", 0),
        ("edge - magrin", "unknown parameter 'magrin'; allowed: a number, a quantity such as '-80 mm', or a parameter: "
         "w, edge, margin, lateral.w", "did you mean 'margin'?", 7),
        ("mm", "unknown parameter 'mm'; allowed: a number, a quantity such as '-80 mm', or a parameter: "
         "w, edge, margin, lateral.w", "did you mean '1 mm'?", 0),
        ("2 if 1 else 3", "found '2 if 1 else 3'; allowed: numbers, names, + - * / ^ < <= > >= and or not, and functions; did you mean 'where(1, 2, 3)'?", "", 0),
        ("edge - inf", "found 'inf'; allowed: a finite number", "", 7),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_said(text, message, hint, offset):
    with pytest.raises(ValueProblemError) as caught:
        evaluate(text, look_up)
    assert (caught.value.message, caught.value.hint, caught.value.offset or 0) == (message, hint, offset)


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "lambda: 1", "edge.real", "[1][0]", "edge if 1 else 2", "w and", "edge not w", "'a' * 3", "w := 1",
     "max(w for w in w)", "edge //2", "edge % 2", "~1", "print(1)", "w == w", "", " ", "edge -", "((1)", "2 w", "1 2"],
)  # fmt: skip
def test_what_is_no_expression_is_refused(text):
    with pytest.raises(ValueProblemError) as caught:
        evaluate(text, look_up)
    assert "; allowed: " in caught.value.message


FILE = """\
circuit: a
control_step: 1 ms
timing: ordered
parameters: {left_edge: 80 mm, margin: 5 mm, PARAMETER}
inputs: {u: {unit: mm, range: [-1 m, 1 m]}}
neurons:
  q: {model: sigmoid, role: excitatory, slope: 100 /m, shift: VALUE}
synapses: [{from: u, to: q, weight: 1}]
outputs: {y: {unit: "1", readout: {q: 1}}}
"""


@pytest.mark.parametrize(
    ("value", "column", "message"),
    [
        ("left_edge - magrin", 75, "unknown parameter 'magrin'"),
        ("'left_edge - magrin'", 76, "unknown parameter 'magrin'"),
        ("-left_egde - margin", 64, "unknown parameter 'left_egde'"),
        ("left_edge - 5 mmm", 77, "unknown unit 'mmm'"),
    ],
)
def test_a_complaint_points_into_the_expression(value, column, message, tmp_path):
    path = tmp_path / "f.yaml"
    path.write_text(FILE.replace("VALUE", value).replace(", PARAMETER", ""), encoding="utf-8")
    found = [problem for problem in check(path)[0] if problem.line == 7]
    assert [(problem.column, problem.message.split(";")[0]) for problem in found] == [(column, message)]


def test_a_parameter_may_be_named_like_a_unit_with_a_warning():
    """After a number m is the metre, anywhere else the parameter."""
    text = FILE.replace("PARAMETER", "m: 2 mm").replace("VALUE", "2 * m + 1 m")
    assert parse_circuit(text).neurons[0].parameters["shift"] == 1.004


def test_the_warning_about_the_unit(tmp_path):
    (tmp_path / "f.yaml").write_text(
        FILE.replace("PARAMETER", "m: 2 mm").replace("VALUE", "2 * m + left_edge + margin")
    )
    (warning,) = check(tmp_path / "f.yaml")[1]
    assert warning.message == (
        "the parameter has the same name as the unit m, which it still means after a number (1 m); give it another name"
    )


def test_a_hyphen_for_an_underscore_is_understood():
    with pytest.raises(Exception, match="did you mean 'left_edge'"):
        parse_circuit(FILE.replace(", PARAMETER", "").replace("VALUE", "left-edge - margin"))
