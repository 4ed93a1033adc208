"""Properties of all kinds of circuits: bits in a batch, ways to step, nothing allocated, projections."""

import pickle
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_circuits import NEURON_KINDS, any_circuits

from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.graph import (
    CircuitGraph,
    InputNode,
    Neuron,
    OutputNode,
    Population,
    Projection,
    Synapse,
)
from circuitkit.circuit.models import neuron_model
from circuitkit.engine import Stepper, compile_circuit, run, step

MODERATE = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))


def bits(*arrays):
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


def signals(graph, batch, steps=5, seed=0):
    return np.random.default_rng(seed).normal(size=(steps, batch, len(graph.inputs)))


@MODERATE
@given(graph=any_circuits(), batch=st.integers(2, 20))
def test_a_member_of_a_batch_gets_the_bits_of_one_alone(graph, batch):
    program, inputs = compile_circuit(graph, "numpy", reproducible=True), signals(graph, batch)
    together = run(program, inputs, states=True)
    for member in {0, batch - 1}:
        alone = run(program, inputs[:, [member]], program.initial_state(1, seed=member), states=True)
        parts = (together.activation, together.output, together.readout, together.states)
        assert bits(alone.activation, alone.output, alone.readout, alone.states) == bits(
            *(part[:, [member]] for part in parts)
        )


@MODERATE
@given(graph=any_circuits(), batch=st.integers(1, 3))
def test_step_stepper_and_run_are_one_thing_in_one_part_or_two(graph, batch):
    program, inputs = compile_circuit(graph, "numpy", reproducible=True), signals(graph, batch)
    whole = run(program, inputs)
    stepper, state = Stepper(program, batch), program.initial_state(batch)
    for t, row in enumerate(inputs):
        readout = stepper.step(row)
        state = step(program, state, row)
        assert bits(*state.arrays()) == bits(*stepper.state.arrays())
        assert state.time == stepper.state.time == t + 1
        assert bits(readout, state.output) == bits(whole.readout[t], whole.output[t])
    first = run(program, inputs[:2])
    second = run(program, inputs[2:], pickle.loads(pickle.dumps(first.state)))
    assert bits(*second.state.arrays()) == bits(*whole.state.arrays())
    stepper.reset()
    assert bits(*stepper.state.arrays()) == bits(*program.initial_state(batch).arrays())


@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
@given(graph=any_circuits(), batch=st.sampled_from([1, 7, 300]))
def test_a_step_allocates_nothing(graph, batch):
    stepper = Stepper(compile_circuit(graph, "numpy", reproducible=True), batch)
    stepper.inputs[...] = 0.1
    for _ in range(3):
        stepper.step()
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        for _ in range(5):
            stepper.step()
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 4096  # numbers such as the time
    assert peak - before < 4096  # views; an array of a batch of 300 would take 2.4 kB for every neuron


@pytest.mark.parametrize("timing", ["as_printed", "synchronous", "ordered"])
def test_the_straight_code_of_a_few_neurons_allocates_nothing(timing):
    from circuitkit.circuit.load import load_circuit

    graph = replace(load_circuit("binn_lateral"), timing=timing)
    for batch in (1, 100, 3000):
        stepper = Stepper(compile_circuit(graph, "numpy", reproducible=False), batch)
        for _ in range(3):
            stepper.step()
        tracemalloc.start()
        try:
            before = tracemalloc.get_traced_memory()[0]
            for _ in range(5):
                stepper.step()
            after, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert after - before < 4096
        assert peak - before < 4096


@MODERATE
@given(model=st.sampled_from(NEURON_KINDS), size=st.integers(1, 5), data=st.data())
def test_a_projection_is_its_synapses_one_by_one(model, size, data):
    """A population, and its members as single neurons: only the order of additions differs."""
    timing = data.draw(st.sampled_from(["as_printed", "synchronous"]))
    rng = np.random.default_rng(data.draw(st.integers(0, 100)))
    parameters = {p.name: 0.1 + 0.2 * rng.random(size) for p in model.parameters}
    initial = {s.name: 0.1 * rng.random(size) for s in model.states}
    weights = rng.normal(size=(size, size)) * (rng.random((size, size)) < 0.7)
    population = Population("p", size, model, "excitatory", parameters, DIMENSIONLESS, initial=initial)
    indptr = np.concatenate([[0], np.cumsum((weights != 0).sum(axis=1))]).astype(np.int64)
    sources = np.nonzero(weights)[1].astype(np.int32)
    inside = Projection("p", "p", indptr, sources, weights[weights != 0], "excitatory")
    driven = Projection("u", "p", np.arange(size + 1), np.zeros(size, np.int32), 0.5, "sensorial")
    header = ("x", "", timing, 0.01, (InputNode("u", DIMENSIONLESS, -1, 1),))
    together = CircuitGraph(
        *header,
        (),
        (),
        (OutputNode("y", DIMENSIONLESS, (("p", 0.5),), -9, 9),),
        {},
        2,
        (population,),
        (inside, driven),
    )
    neurons = tuple(
        Neuron(f"n{i}", model, "excitatory", {k: v[i] for k, v in parameters.items()}, DIMENSIONLESS,
               initial={k: v[i] for k, v in initial.items()})
        for i in range(size)
    )  # fmt: skip
    synapses = [Synapse("u", f"n{i}", 0.5, "sensorial") for i in range(size)]
    synapses += [
        Synapse(f"n{j}", f"n{i}", weights[i, j], "excitatory")
        for i in range(size)
        for j in range(size)
        if weights[i, j]
    ]
    readout = OutputNode("y", DIMENSIONLESS, tuple((n.name, 0.5) for n in neurons), -9, 9)
    single = CircuitGraph(*header, neurons, tuple(synapses), (readout,), {}, 2)
    inputs = signals(together, 2)
    one, other = (
        run(compile_circuit(graph, "numpy", reproducible=True), inputs) for graph in (together, single)
    )
    np.testing.assert_allclose(one.output, other.output, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(one.readout, other.readout, rtol=1e-11, atol=1e-11)
    assert one.neuron_names[0] == "p[0]"


@pytest.fixture
def network():
    """A population with more synapses than are gathered; weights as an array, and one for all."""
    n, k = 300, 8
    rng = np.random.default_rng(5)
    model = neuron_model("sigmoid")
    population = Population(
        "p", n, model, "excitatory", {"slope": 2.0, "shift": rng.random(n)}, DIMENSIONLESS
    )
    sources = np.sort(rng.integers(0, n, (n, k), dtype=np.int32), axis=1).ravel()
    indptr = np.arange(0, n * k + 1, k)
    projections = tuple(
        Projection("p", "p", indptr, sources, weights, "excitatory")
        for weights in (rng.normal(size=n * k), 0.01)
    )
    node = InputNode("u", DIMENSIONLESS, -1, 1)
    synapse = Synapse("u", "p[3]", 1.0, "sensorial")
    return CircuitGraph(
        "net", "", "synchronous", 0.01, (node,), (), (synapse,), (), {}, 1, (population,), projections
    )


def test_many_synapses_are_summed_as_dense_matrices_are(network):
    n = network.populations[0].size
    matrix = np.zeros((n, n))
    for projection in network.projections:
        targets = np.repeat(np.arange(n), np.diff(projection.indptr))
        np.add.at(matrix, (targets, projection.sources), projection.weights)
    inputs = signals(network, 3, 6)
    trace = run(compile_circuit(network, "numpy", reproducible=True), inputs)
    output = np.zeros((3, n))
    for t in range(6):
        activation = output @ matrix.T
        activation[:, 3] += inputs[t, :, 0]
        output = 1 / (1 + np.exp(-2.0 * (activation - network.populations[0].parameters["shift"])))
        np.testing.assert_allclose(trace.output[t], output, rtol=1e-12)
    alone = run(compile_circuit(network, "numpy", reproducible=True), inputs[:, [1]])
    assert bits(alone.output) == bits(trace.output[:, [1]])


def test_a_program_copies_no_array_of_a_projection(network):
    sums = [each for each in compile_circuit(network, "numpy").before if hasattr(each, "sources")]
    first, second = network.projections
    assert any(np.shares_memory(each.sources, first.sources) for each in sums)
    assert any(np.shares_memory(each.weights, first.weights) for each in sums)
    assert any(each.weights.ndim == 0 and np.shares_memory(each.sources, second.sources) for each in sums)


def test_what_is_recorded_is_chosen_by_name(network):
    program = compile_circuit(network, "numpy", reproducible=True)
    inputs = signals(network, 2)
    whole = run(program, inputs)
    part = run(program, inputs, record=["p[7]", "p[250]"])
    assert part.neuron_names == ("p[7]", "p[250]")
    assert bits(part.output, part.activation) == bits(
        whole.output[..., [7, 250]], whole.activation[..., [7, 250]]
    )
    assert part.readout.shape == (5, 2, 0)
    assert run(program, inputs, record=["p"]).output.shape == (5, 2, 300)
    with pytest.raises(UnknownNameError, match=r"^unknown neuron, output or state 'q'; allowed: p, p\[0\]"):
        run(program, inputs, record=["q"])


def test_states_are_recorded_with_their_names():
    model = NEURON_KINDS[5]
    neuron = Neuron("a", model, "excitatory", {"tau": 0.02}, DIMENSIONLESS, initial={"v": 0.5, "w": -0.25})
    population = Population(
        "p", 2, model, "excitatory", {"tau": 0.02}, DIMENSIONLESS, initial={"v": 1.0, "w": 0.0}
    )
    graph = CircuitGraph("s", "", "ordered", 0.01, (), (neuron,), (), (), {}, 3, (population,))
    program = compile_circuit(graph, "numpy", reproducible=True)
    assert list(program.state_names) == ["a.v", "p[0].v", "p[1].v", "a.w", "p[0].w", "p[1].w"]
    assert program.initial_state().states.tolist() == [[0.5, 1.0, 1.0, -0.25, 0.0, 0.0]]
    trace = run(program, np.zeros((4, 1, 0)), states=True)
    assert bits(run(program, np.zeros((4, 1, 0)), record=["p[1].w"]).states) == bits(trace.states[..., [5]])


def test_a_sweep_is_its_circuits_one_by_one():
    graphs = [_pair(weight, slope) for weight, slope in ((1.0, 2.0), (-0.5, 3.0), (0.25, -1.0))]
    program = compile_circuit(graphs, "numpy", reproducible=True)
    assert program.members == 3
    inputs = signals(graphs[0], 3)
    trace = run(program, inputs)
    for member, graph in enumerate(graphs):
        alone = run(compile_circuit(graph, "numpy", reproducible=True), inputs[:, [member]])
        assert bits(alone.output, alone.readout) == bits(
            trace.output[:, [member]], trace.readout[:, [member]]
        )
    with pytest.raises(InputError) as error:
        program.initial_state(2)
    assert str(error.value) == "batch: found 2; allowed: 3, the number of circuits of the sweep"
    with pytest.raises(InputError) as error:
        compile_circuit([graphs[0], replace(graphs[0], synapses=graphs[0].synapses[:1])], "numpy")
    assert str(error.value) == (
        "sweep: found other number of operations in circuit 1 than in circuit 0; "
        "allowed: the same structure; circuits of a sweep may differ in numbers alone"
    )
    with pytest.raises(InputError, match="sweep: found no circuit; allowed: at least one"):
        compile_circuit([])


def _pair(weight, slope):
    sigmoid = neuron_model("sigmoid")
    neurons = [
        Neuron(name, sigmoid, "excitatory", {"slope": slope, "shift": 0.1}, DIMENSIONLESS) for name in "ab"
    ]
    synapses = (Synapse("u", "a", 1.0, "sensorial"), Synapse("a", "b", weight, "excitatory"))
    output = OutputNode("y", DIMENSIONLESS, (("b", weight),), -1.0, 1.0, 0.1)
    node = InputNode("u", DIMENSIONLESS, -1, 1)
    return CircuitGraph("pair", "", "ordered", 0.01, (node,), tuple(neurons), synapses, (output,), {})


@settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data(), batch=st.sampled_from([1, 1, 3, 40]))
def test_without_a_fixed_order_results_agree_to_rounding(circuits, data, batch):
    graph = data.draw(circuits())
    inputs = signals(graph, batch)
    exact = run(compile_circuit(graph, "numpy", reproducible=True), inputs)
    program = compile_circuit(graph, "numpy", reproducible=False)
    loose = run(program, inputs)
    stepper = Stepper(program, batch)
    for row in inputs:
        readout = stepper.step(row)
    for one, other in (
        (loose.activation, exact.activation),
        (loose.output, exact.output),
        (loose.readout, exact.readout),
        (stepper.state.output, exact.output[-1]),
        (readout, exact.readout[-1]),
    ):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("batch", [1, 3, 2000])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("timing", ["synchronous", "ordered"])
def test_without_a_fixed_order_too_nothing_that_is_not_finite_is_returned(batch, value, timing):
    from circuitkit.circuit.load import load_circuit

    graph = replace(load_circuit("binn_lateral"), timing=timing)
    stepper = Stepper(compile_circuit(graph, "numpy", reproducible=False), batch)
    inputs = np.zeros((batch, 2))
    stepper.step(inputs)
    inputs[-1, 1] = value
    with pytest.raises(InputError, match=rf"^inputs\.zmp_y: found {value} at batch member {batch - 1}"):
        stepper.step(inputs)


def test_float32_is_near_float64(network):
    inputs = signals(network, 4)
    fine = run(compile_circuit(network, "numpy"), inputs)
    coarse = run(compile_circuit(network, "numpy", "float32"), inputs)
    np.testing.assert_allclose(coarse.output, fine.output, atol=1e-5)
    assert not (coarse.output == fine.output).all()
