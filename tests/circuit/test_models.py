"""The neuron models: their files, their equations against the literature, and their units."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.circuit.models import NEURON_MODEL_NAMES, neuron_model
from circuitkit.circuit.models.model import ACTIVATION
from circuitkit.errors import UnknownNameError

numbers = st.floats(-10, 10)


def output(name: str, activation: float, **parameters: float) -> float:
    return neuron_model(name).output.evaluate({ACTIVATION: activation, **parameters})


@given(numbers, numbers, numbers)
def test_sigmoid_is_eq_12(activation, slope, shift):
    expected = 1 / (1 + math.exp(-slope * (activation - shift)))
    assert output("sigmoid", activation, slope=slope, shift=shift) == pytest.approx(expected, rel=1e-12)


def test_the_neurons_of_section_4_2_respond_as_the_paper_says():
    """lf from 0.1 on, rf up to -0.1, bf between them; half of the full output at each threshold."""
    lf, rf = {"slope": 500, "shift": 0.1}, {"slope": -500, "shift": -0.1}
    bf = {"slope": 500, "low": -0.1, "high": 0.1}
    for difference, left, both, right in [
        (-1.0, 0, 0, 1),
        (-0.12, 0, 0, 1),
        (-0.1, 0, 0.5, 0.5),
        (-0.08, 0, 1, 0),
        (0.0, 0, 1, 0),
        (0.08, 0, 1, 0),
        (0.1, 0.5, 0.5, 0),
        (0.12, 1, 0, 0),
        (1.0, 1, 0, 0),
    ]:
        assert output("sigmoid", difference, **lf) == pytest.approx(left, abs=1e-4)
        assert output("window", difference, **bf) == pytest.approx(both, abs=1e-4)
        assert output("sigmoid", difference, **rf) == pytest.approx(right, abs=1e-4)


@given(numbers)
def test_the_window_of_the_paper_is_what_the_other_two_leave(difference):
    rest = (
        1
        - output("sigmoid", difference, slope=500, shift=0.1)
        - output("sigmoid", difference, slope=-500, shift=-0.1)
    )
    assert output("window", difference, slope=500, low=-0.1, high=0.1) == pytest.approx(rest, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "parameters", "points"),
    [
        ("identity", {"gain": 3}, [(-2, -6), (0, 0), (2, 6)]),
        ("threshold_linear", {"slope": 2, "shift": 1}, [(-5, 0), (1, 0), (3, 4)]),
        ("step", {"shift": 1}, [(0.999, 0), (1, 1), (5, 1)]),
        ("tanh", {"slope": 2, "shift": 1}, [(1, 0), (100, 1), (-100, -1), (1.5, math.tanh(1))]),
    ],
)
def test_the_other_models_respond_as_described(name, parameters, points):
    for activation, expected in points:
        assert output(name, activation, **parameters) == pytest.approx(expected)


@given(numbers, numbers, numbers)
def test_tanh_is_a_scaled_sigmoid(activation, slope, shift):
    scaled = 2 * output("sigmoid", activation, slope=2 * slope, shift=shift) - 1
    assert output("tanh", activation, slope=slope, shift=shift) == pytest.approx(scaled, abs=1e-12)


@pytest.mark.parametrize("name", NEURON_MODEL_NAMES)
@given(data=st.data(), unit=st.sampled_from([1e-3, 0.25, 1000.0]))
def test_outputs_do_not_depend_on_the_unit_of_the_activation(name, data, unit):
    """Dimensional analysis by numbers: rescaling all that has a unit must change nothing."""
    model = neuron_model(name)
    power = {"activation": 1, "1/activation": -1, "1": 0}
    values = {each.name: data.draw(numbers) for each in model.parameters}
    activation = data.draw(numbers.filter(lambda a: all(abs(a - v) > 1e-6 for v in values.values())))
    scaled = {each.name: values[each.name] * unit ** power[each.unit_rule.text] for each in model.parameters}
    here = output(name, activation, **values)
    assert output(name, activation * unit, **scaled) == pytest.approx(here, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", NEURON_MODEL_NAMES)
def test_model_files_are_complete(name):
    model = neuron_model(name)
    assert model.name == name
    assert model.description.endswith(".")
    assert model.source
    assert model.output.names() == {ACTIVATION, *model.parameter_names}
    assert set(model.increasing) <= set(model.parameter_names)
    for parameter in model.parameters:
        assert parameter.description
        # A default in an activation's unit would mean something else in every unit, unless it is zero.
        assert parameter.default in (None, 0) or parameter.unit_rule.text != "activation"


def test_models_are_read_once():
    assert neuron_model("sigmoid") is neuron_model("sigmoid")


def test_an_unknown_model_is_named():
    with pytest.raises(UnknownNameError) as caught:
        neuron_model("sigmoyd")
    assert str(caught.value) == (
        "unknown model 'sigmoyd'; allowed: identity, sigmoid, step, tanh, threshold_linear, window; "
        "did you mean 'sigmoid'?"
    )
