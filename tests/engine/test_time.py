"""Continuous models: methods against closed forms and scipy's integrator, delays against shifted signals."""

import math

import numpy as np
import pytest
from random_circuits import METHODS, leaky, neuron_kind, pair, synapse_kind
from scipy.integrate import solve_ivp

from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode, Synapse
from circuitkit.circuit.models import STATIC, neuron_model
from circuitkit.engine import compile_circuit, run

ORDERS = {"euler": 1, "exponential_euler": 1, "rk4": 4}
STEP_S = 0.01


def cell(name, model, start=None, sigma=0.0, **parameters):
    initial = {state.name: (start or {}).get(state.name, 0.0) for state in model.states}
    return Neuron(name, model, "excitatory", parameters, DIMENSIONLESS, initial=initial, noise=sigma)


def synapse(source, target, weight=1.0, model=STATIC, **more):
    return Synapse(source, target, weight, "excitatory", model, **more)


def circuit(neurons, synapses, substeps=1, timing="synchronous", step_s=STEP_S, outputs=()):
    node = InputNode("u", DIMENSIONLESS, -1.0, 1.0)
    return CircuitGraph(
        "time", "", timing, step_s, (node,), tuple(neurons), tuple(synapses), tuple(outputs), {}, substeps
    )


def last_states(graph, inputs):
    program = compile_circuit(graph, backend="numpy")
    return run(program, np.asarray(inputs, dtype=float).reshape(-1, 1, 1), states=True).states[:, 0]


def slope_of_errors(errors):
    """The order at which errors fall when the substeps double."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@pytest.mark.parametrize("method", METHODS)
def test_a_leaky_integrator_rises_as_its_closed_form(method):
    tau, errors = 0.05, []
    for substeps in (4, 8, 16):
        graph = circuit([cell("n", leaky(method), tau=tau)], [synapse("u", "n")], substeps)
        found = last_states(graph, np.ones(10))[:, 0]
        expected = 1 - np.exp(-np.arange(1, 11) * STEP_S / tau)
        errors.append(np.abs(found - expected).max())
    if method in {"exact", "exponential_euler"}:  # both are exact for one linear state
        assert max(errors) < 1e-15
    else:
        np.testing.assert_allclose(slope_of_errors(errors), ORDERS[method], atol=0.15)


@pytest.mark.parametrize("method", METHODS)
def test_two_coupled_states_against_scipy(method):
    tau, start = 0.02, {"v": 0.4, "w": -0.3}

    def slopes(_, x):
        v, w = x
        return [(1 - v - 2 * w) / tau, (v - 0.3 * w) / tau]

    truth = solve_ivp(slopes, (0, 0.1), [0.4, -0.3], rtol=1e-13, atol=1e-13).y[:, -1]
    errors = []
    for substeps in (8, 16, 32):
        graph = circuit([cell("n", pair(method), start, tau=tau)], [synapse("u", "n")], substeps)
        errors.append(np.abs(last_states(graph, np.ones(10))[-1] - truth).max())
    if method == "exact":
        assert max(errors) < 1e-11
    else:
        np.testing.assert_allclose(slope_of_errors(errors), ORDERS[method], atol=0.3)


@pytest.mark.parametrize("step_s", [1e-4, 0.01, 1.0, 50.0])
def test_the_exact_method_is_exact_for_any_step(step_s):
    tau = 0.02
    graph = circuit([cell("n", leaky("exact"), {"v": 2.0}, tau=tau)], [synapse("u", "n")], step_s=step_s)
    found = last_states(graph, [1.0, 1.0, 1.0])[:, 0]
    np.testing.assert_allclose(found, 1 + np.exp(-np.arange(1, 4) * step_s / tau), rtol=1e-14)


def test_runge_kutta_sees_its_neighbours_move_within_a_step():
    """Two coupled neurons converge with order 4, which takes that the sums are made again at every stage."""
    model = neuron_kind("rate", ["tau"], ["v"], "tanh(v)", "rk4", derivatives={"v": "(A - v) / tau"})

    def slopes(_, x):
        return [(0.3 + 1.5 * math.tanh(x[1]) - x[0]) / 0.02, (-2.0 * math.tanh(x[0]) - x[1]) / 0.03]

    truth = solve_ivp(slopes, (0, 0.1), [0.1, 0.2], rtol=1e-13, atol=1e-13).y[:, -1]
    neurons = [cell("a", model, {"v": 0.1}, tau=0.02), cell("b", model, {"v": 0.2}, tau=0.03)]
    synapses = [synapse("u", "a", 0.3), synapse("b", "a", 1.5), synapse("a", "b", -2.0)]
    errors = [
        np.abs(last_states(circuit(neurons, synapses, n), np.ones(10))[-1] - truth).max() for n in (2, 4, 8)
    ]
    np.testing.assert_allclose(slope_of_errors(errors), 4, atol=0.3)


def test_a_first_order_synapse_follows_its_closed_form():
    lag = synapse_kind("lag", ["tau_s"], ["s"], "weight * s", "exact", derivatives={"s": "(pre - s) / tau_s"})
    more = {"parameters": {"tau_s": 0.03}, "initial": {"s": 0.0}}
    for target in (cell("n", neuron_model("identity"), gain=1.0), cell("n", leaky("exact"), tau=1.0)):
        graph = circuit([target], [synapse("u", "n", 2.0, lag, **more)])
        found = run(compile_circuit(graph, "numpy"), np.ones((12, 1, 1))).activation[:, 0, 0]
        np.testing.assert_allclose(found, 2 * (1 - np.exp(-np.arange(12) * STEP_S / 0.03)), atol=1e-14)


def test_an_integrate_and_fire_neuron_fires_at_the_rate_of_its_closed_form():
    """Constant drive: the interval is tau log((E - reset) / (E - threshold)), to a substep."""
    tau, drive = 0.02, 1.5
    model = neuron_kind(
        "fire",
        ["tau"],
        ["v"],
        "spike",
        "exact",
        spike=("v - 1", {"v": "0"}),
        derivatives={"v": "(A - v) / tau"},
    )
    output = OutputNode("y", DIMENSIONLESS, (("n", 1.0),), -math.inf, math.inf, 0.0)
    graph = circuit([cell("n", model, tau=tau)], [synapse("u", "n", drive)], 100, outputs=[output])
    trace = run(compile_circuit(graph, "numpy"), np.ones((300, 1, 1)))
    interval = tau * math.log(drive / (drive - 1))
    count = trace.output.sum()
    assert trace.readout[-1, 0, 0] == count  # an integrating output counts spikes
    assert abs(3.0 / count - interval) < STEP_S / 100 + 1e-9


@pytest.mark.parametrize("timing", ["as_printed", "synchronous", "ordered"])
@pytest.mark.parametrize("steps", [1, 2, 7])
def test_a_delayed_input_is_the_input_shifted(timing, steps):
    signal = np.random.default_rng(steps).normal(size=(30, 2, 1))
    neuron = cell("n", neuron_model("identity"), gain=1.0)
    now = circuit([neuron], [synapse("u", "n")], timing=timing)
    late = circuit([neuron], [synapse("u", "n", delay_s=steps * STEP_S)], timing=timing)
    expected = run(compile_circuit(now, "numpy"), signal).activation
    found = run(compile_circuit(late, "numpy"), signal).activation
    np.testing.assert_array_equal(found[steps:], expected[:-steps])
    np.testing.assert_array_equal(found[:steps], 0.0)


def test_a_delay_between_continuous_neurons_is_counted_in_substeps():
    a, b = cell("a", leaky("exact"), {"v": 0.3}, tau=0.01), cell("b", leaky("exact"), tau=0.02)
    first = math.tanh(0.3)
    for delay_s, shift in ((0.0, 0), (0.002, 1), (0.008, 4)):
        graph = circuit([a, b], [synapse("u", "a"), synapse("a", "b", delay_s=delay_s)], 5)
        found = run(compile_circuit(graph, "numpy"), np.ones((8, 1, 1))).activation[:, 0, 1]
        passed = (
            5 * np.arange(1, 9) - 1 - shift
        )  # substeps that a has done when the last one of a step begins
        v = 1 - 0.7 * np.exp(-np.maximum(passed, 0) * 0.002 / 0.01)
        np.testing.assert_allclose(found, np.where(passed > 0, np.tanh(v), first), rtol=1e-13)


def test_in_an_ordered_circuit_a_delayed_synapse_closes_no_cycle():
    one = neuron_model("identity")
    neurons = [cell("a", one, gain=1.0), cell("b", one, gain=1.0)]
    synapses = [synapse("u", "b"), synapse("b", "a"), synapse("a", "b", 0.5, delay_s=STEP_S)]
    impulse = np.zeros((6, 1, 1))
    impulse[0] = 1.0
    output = run(compile_circuit(circuit(neurons, synapses, timing="ordered"), "numpy"), impulse).output[:, 0]
    np.testing.assert_allclose(output[:, 0], 0.5 ** np.arange(6))  # b above a: without the delay it were late
    np.testing.assert_allclose(output[:, 1], 0.5 ** np.arange(6))


def test_equations_that_are_not_linear_have_no_exact_solution():
    from circuitkit.base.errors import InputError

    bent = neuron_kind("bent", ["tau"], ["v"], "v", "exact", derivatives={"v": "(A - v ** 3) / tau"})
    with pytest.raises(InputError) as error:
        compile_circuit(circuit([cell("n", bent, tau=0.1)], []), "numpy")
    assert str(error.value) == (
        "model bent: found equations that are not linear in the states; allowed: other methods than exact"
    )
