"""The shipped models: their files, their equations against the literature, and their units."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.source import Document
from circuitkit.circuit.expressions.expression import Expression
from circuitkit.circuit.models import (
    NEURON_MODEL_NAMES,
    STATIC,
    SYNAPSE_MODEL_NAMES,
    NeuronModel,
    SynapseModel,
    neuron_model,
    read_neuron_model,
    read_synapse_model,
    synapse_model,
)
from circuitkit.circuit.models.model import ACTIVATION
from circuitkit.circuit.models.writing import model_data

numbers = st.floats(-10, 10)
MEMORYLESS = [name for name in NEURON_MODEL_NAMES if not neuron_model(name).states]


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


@pytest.mark.parametrize("name", MEMORYLESS)
@given(data=st.data(), unit=st.sampled_from([1e-3, 0.25, 1000.0]))
def test_outputs_do_not_depend_on_the_unit_of_the_activation(name, data, unit):
    """Dimensional analysis by numbers: rescaling all that has a unit must change nothing."""
    model = neuron_model(name)
    values = {each.name: data.draw(numbers) for each in model.parameters}
    activation = data.draw(numbers.filter(lambda a: all(abs(a - v) > 1e-6 for v in values.values())))
    scaled = {each.name: values[each.name] * unit**each.unit_rule.activation for each in model.parameters}
    here = output(name, activation, **values)
    assert output(name, activation * unit, **scaled) == pytest.approx(here, rel=1e-9, abs=1e-9)


def equations(model: NeuronModel | SynapseModel) -> list[Expression]:
    """Every expression that a model has, but initial values."""
    found = [*model.derivatives.values(), *model.updates.values()]
    if isinstance(model, NeuronModel):
        return [
            *found,
            model.output,
            *((model.spike.when, *model.spike.reset.values()) if model.spike else ()),
        ]
    return [*found, model.current, *model.jumps.values()]


EVERY_MODEL = [
    *(neuron_model(name) for name in NEURON_MODEL_NAMES),
    *(synapse_model(name) for name in SYNAPSE_MODEL_NAMES),
]


@pytest.mark.parametrize("model", EVERY_MODEL, ids=lambda model: model.name)
def test_model_files_are_complete(model):
    assert model.name in (*NEURON_MODEL_NAMES, *SYNAPSE_MODEL_NAMES)
    assert model.description.endswith(".")
    assert model.source
    used = frozenset().union(*(each.names() for each in equations(model)))
    starts = frozenset().union(*(state.initial.names() for state in model.states), ())
    assert used | starts >= {*model.parameter_names, *(state.name for state in model.states)}
    assert set(model.increasing) <= set(model.parameter_names)
    for parameter in (*model.parameters, *model.states):
        assert parameter.description
    for parameter in model.parameters:
        # A default in an activation's unit would mean something else in every unit, unless it is zero.
        assert parameter.default in (None, 0) or parameter.unit_rule.text not in ("activation", "weight")


@pytest.mark.parametrize("model", EVERY_MODEL, ids=lambda model: model.name)
def test_models_written_out_read_the_same(model):
    read = read_neuron_model if isinstance(model, NeuronModel) else read_synapse_model
    assert read(Document("", {model.name: model_data(model)}, {}), (model.name,)) == model


def test_every_kind_of_model_is_shipped():
    """What once shipped stays; a new model needs no line here."""
    assert set(NEURON_MODEL_NAMES) >= {
        *("sigmoid", "window", "identity", "threshold_linear", "tanh", "step"),
        *("leaky_integrator", "leaky_linear", "conductance", "matsuoka"),
        *("leaky_integrate_and_fire", "adaptive_exponential", "izhikevich"),
    }
    assert set(SYNAPSE_MODEL_NAMES) >= {
        *("static", "first_order", "exponential", "conductance", "exponential_conductance", "gated"),
        *("depressing_facilitating", "depressing_facilitating_rate", "hebbian", "oja"),
    }
    assert synapse_model("gated").gated
    assert not synapse_model("static").gated


@pytest.mark.parametrize("model", EVERY_MODEL, ids=lambda model: model.name)
def test_shared_states_are_those_of_models_linear_in_the_weight(model):
    """A model whose states are kept per target sees the sources' sum alone; `weight` is not a state of it."""
    if isinstance(model, SynapseModel):
        used = frozenset().union(*(each.names() for each in equations(model)))
        assert ("input" in used) == (model.per == "target")
        assert used.isdisjoint({"pre", "weight"}) == (model.per == "target")


def test_models_are_read_once():
    assert neuron_model("sigmoid") is neuron_model("sigmoid")
    assert synapse_model("static") is STATIC


def test_an_unknown_model_is_named():
    with pytest.raises(UnknownNameError) as caught:
        neuron_model("sigmoyd")
    names = ", ".join(NEURON_MODEL_NAMES)
    assert str(caught.value) == f"unknown model 'sigmoyd'; allowed: {names}; did you mean 'sigmoid'?"
    with pytest.raises(UnknownNameError) as caught:
        synapse_model("statik")
    names = ", ".join(SYNAPSE_MODEL_NAMES)
    assert str(caught.value) == f"unknown model 'statik'; allowed: {names}; did you mean 'static'?"
