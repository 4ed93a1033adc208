"""The engine against eqs. 11 and 12 by hand, and against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.circuit.expressions.expression import FUNCTION_ARITY, SCALAR_FUNCTIONS
from circuitkit.circuit.models import NEURON_MODEL_NAMES, neuron_model
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.lowering.order import make_order

TIMINGS = ("as_printed", "synchronous", "ordered")


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_random_circuits_follow_the_equations_by_hand(by_hand, circuits, data):
    graph = data.draw(circuits())
    columns = len(graph.inputs)
    inputs = data.draw(
        st.lists(st.lists(st.floats(-2, 2), min_size=columns, max_size=columns), min_size=1, max_size=6)
    )
    trace = run(compile_circuit(graph, "numpy", reproducible=True), np.array(inputs)[:, np.newaxis])
    reference = by_hand(graph)
    for t, row in enumerate(inputs):
        names = (node.name for node in graph.inputs)
        activation, output, readout = reference.tick(dict(zip(names, row, strict=True)))
        np.testing.assert_allclose(trace.activation[t, 0], activation, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(trace.output[t, 0], output, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(trace.readout[t, 0], readout, rtol=1e-12, atol=1e-12)


@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_sums_are_added_term_by_term_in_file_order_neurons_before_inputs(by_hand, circuits, data):
    graph = data.draw(circuits(models=("identity",)))
    row = data.draw(st.lists(st.floats(-2, 2), min_size=len(graph.inputs), max_size=len(graph.inputs)))
    trace = run(compile_circuit(graph, "numpy", reproducible=True), np.array([[row]] * 4))
    reference = by_hand(graph)
    for t in range(4):
        activation, output, _ = reference.tick({f"u{i}": value for i, value in enumerate(row)})
        assert trace.activation[t, 0].tolist() == activation
        assert trace.output[t, 0].tolist() == output


@pytest.mark.parametrize("fan_in", [1, 2, 4, 5, 9, 40])
def test_long_sums_keep_the_order(build, fan_in):
    weights = np.random.default_rng(fan_in).normal(size=fan_in)
    sources = [f"u{i}" for i in range(fan_in)]
    synapses = [(source, "n", weight) for source, weight in zip(sources, weights.tolist(), strict=True)]
    values = np.random.default_rng(1).normal(size=(1, fan_in))
    expected = 0.0
    for weight, value in zip(weights.tolist(), values[0].tolist(), strict=True):
        expected += weight * value
    graph = build.circuit([build.neuron("n")], synapses, inputs=sources)
    for batch in (1, 2, 17):
        trace = run(compile_circuit(graph, "numpy", reproducible=True), np.tile(values, (1, batch, 1)))
        assert (trace.activation == expected).all()


@pytest.mark.parametrize(
    ("timing", "ticks_a_layer", "first"), [("as_printed", 2, 1), ("synchronous", 1, 0), ("ordered", 0, 0)]
)
def test_an_impulse_takes_two_one_or_no_ticks_a_layer(build, timing, ticks_a_layer, first):
    names = ["a", "b", "c", "d"]
    synapses = [("u", "a", 1.0), ("a", "b", 1.0), ("b", "c", 1.0), ("c", "d", 1.0)]
    graph = build.circuit([build.neuron(name) for name in names], synapses, timing=timing)
    impulse = np.zeros((10, 1, 1))
    impulse[0] = 1.0
    output = run(compile_circuit(graph, "numpy"), impulse).output[:, 0]
    for layer in range(4):
        arrival = first + layer * ticks_a_layer
        assert np.flatnonzero(output[:, layer]).tolist() == [arrival]


@pytest.mark.parametrize("leak", [0.0, 0.05, 0.5, 1.0])
def test_a_leaking_output_is_a_geometric_series(build, leak):
    graph = build.circuit([build.neuron("n")], [("u", "n", 1.0)], [build.output("y", {"n": 0.3}, leak)])
    inputs = np.concatenate([np.ones((40, 1, 1)), np.zeros((40, 1, 1))])
    y = run(compile_circuit(graph, "numpy"), inputs).readout[:, 0, 0]
    kept = 1 - leak
    rising = [0.3 * t if leak == 0 else 0.3 * (1 - kept**t) / leak for t in range(1, 41)]
    falling = [rising[-1] * kept**t for t in range(1, 41)]
    np.testing.assert_allclose(y, rising + falling, rtol=1e-12, atol=1e-15)


def test_limits_stop_the_integrator_itself_so_that_it_does_not_wind_up(build):
    graph = build.circuit(
        [build.neuron("n")], [("u", "n", 1.0)], [build.output("y", {"n": 1.0}, 0.0, limit=2.5)]
    )
    inputs = np.array([1.0, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1]).reshape(-1, 1, 1)
    y = run(compile_circuit(graph, "numpy"), inputs).readout[:, 0, 0]
    assert y.tolist() == [1, 2, 2.5, 2.5, 2.5, 1.5, 0.5, -0.5, -1.5, -2.5, -2.5, -2.5]


def test_outputs_that_integrate_and_outputs_that_do_not_stand_side_by_side(build):
    outputs = [
        build.output("plain", {"n": 1.0}),
        build.output("sum", {"n": 1.0}, 0.0),
        build.output("limited", {"n": 5.0}, None, limit=2.0),
        build.output("halved", {"n": 1.0}, 0.5),
    ]
    graph = build.circuit([build.neuron("n")], [("u", "n", 1.0)], outputs)
    y = run(compile_circuit(graph, "numpy"), np.ones((3, 2, 1))).readout
    expected = [[1, 1, 2, 1], [1, 2, 2, 1.5], [1, 3, 2, 1.75]]
    assert y[:, 0].tolist() == expected
    assert y[:, 1].tolist() == expected


def test_in_a_cycle_the_upper_neuron_sees_the_last_tick_of_the_lower_one(build):
    synapses = [("u", "a", 1.0), ("a", "b", 0.5), ("b", "a", 0.8)]
    for order in (["a", "b"], ["b", "a"]):
        graph = build.circuit([build.neuron(name) for name in order], synapses)
        impulse = np.zeros((8, 1, 1))
        impulse[0] = 1.0
        output = run(compile_circuit(graph, "numpy"), impulse).output[:, 0]
        a, b = output[:, order.index("a")], output[:, order.index("b")]
        delay = order.index("a")  # b above a sees it one tick late
        np.testing.assert_allclose(a, 0.4 ** np.arange(8), rtol=1e-14)
        np.testing.assert_allclose(b[delay:], 0.5 * 0.4 ** np.arange(8 - delay), rtol=1e-14)


def test_a_neuron_that_feeds_itself_sees_its_last_output(build):
    graph = build.circuit([build.neuron("n")], [("u", "n", 1.0), ("n", "n", -0.5)])
    output = run(compile_circuit(graph, "numpy"), np.ones((20, 1, 1))).output[:, 0, 0]
    np.testing.assert_allclose(output, (1 - (-0.5) ** np.arange(1, 21)) / 1.5, rtol=1e-14)


def test_a_last_output_that_is_still_read_after_the_new_one_is_kept(build, by_hand):
    neurons = [build.neuron(name, "tanh", slope=1.0, shift=0.2) for name in "abcd"]
    synapses = [("u", "a", 1.0), ("a", "b", 1.0), ("b", "d", 1.0), ("d", "c", 0.7), ("c", "b", -0.9)]
    graph = build.circuit(neurons, synapses)
    order = make_order("abcd", [edge[:2] for edge in synapses[1:]], graph.timing)
    assert order.stages == (("a", "c"), ("b",), ("d",))
    assert order.held == {("c", "b")}
    inputs = np.random.default_rng(0).normal(size=(12, 1, 1))
    output = run(compile_circuit(graph, "numpy"), inputs).output[:, 0]
    reference = by_hand(graph)
    for t in range(12):
        np.testing.assert_allclose(output[t], reference.tick({"u": float(inputs[t, 0, 0])})[1], rtol=1e-13)


@pytest.mark.parametrize("timing", TIMINGS)
def test_stages_are_as_few_as_the_timing_allows(timing):
    names = ["c", "a", "b", "x"]  # the file need not name the sources first
    stages = make_order(names, [("a", "b"), ("b", "c")], timing).stages
    assert stages == ((("a", "x"), ("b",), ("c",)) if timing == "ordered" else (tuple(names),))


MEMORYLESS = [name for name in NEURON_MODEL_NAMES if not neuron_model(name).states]


@pytest.mark.parametrize("name", MEMORYLESS)
def test_every_model_computes_its_equation(build, name):
    model = neuron_model(name)
    parameters = {"slope": 7.5, "shift": 0.2, "low": -0.4, "high": 0.3, "gain": -1.5}
    given_parameters = {key: parameters.get(key, 0.7) for key in model.parameter_names}
    graph = build.circuit([build.neuron("n", name, **given_parameters)], [("u", "n", 1.0)])
    values = np.linspace(-2, 2, 101)
    output = run(compile_circuit(graph, "numpy"), values.reshape(-1, 1, 1)).output[:, 0, 0]
    expected = [model.output.evaluate({**given_parameters, "A": float(a)}) for a in values]
    np.testing.assert_allclose(output, expected, rtol=1e-14, atol=1e-15)


def test_the_backend_has_every_function_of_the_language_with_the_same_values():
    assert set(NUMPY_FUNCTIONS) == set(SCALAR_FUNCTIONS)
    for name, function in SCALAR_FUNCTIONS.items():
        arguments = (0.3, 0.8, 0.9)[: FUNCTION_ARITY[name]]
        assert math.isclose(NUMPY_FUNCTIONS[name](*arguments), function(*arguments), rel_tol=1e-15), name
    assert NUMPY_FUNCTIONS["heaviside"](0.0) == 1.0
