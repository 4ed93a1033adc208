"""A member of a batch gets the same bits as one alone, by every way to step; and states are values."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.engine import Stepper, compile_circuit, run, step


def _bits(*arrays):
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


@settings(max_examples=100, deadline=None)
@given(data=st.data(), batch=st.integers(1, 64), seed=st.integers(0, 2**32 - 1))
def test_alone_or_in_a_batch_of_any_size_gives_the_same_bits(circuits, data, batch, seed):
    graph = data.draw(circuits())
    program = compile_circuit(graph, "numpy", reproducible=True)
    inputs = np.random.default_rng(seed).normal(size=(5, batch, len(graph.inputs)))
    together = run(program, inputs)
    for member in {0, batch // 2, batch - 1}:
        alone = run(program, inputs[:, [member]])
        assert _bits(alone.activation, alone.output, alone.readout) == _bits(
            together.activation[:, [member]], together.output[:, [member]], together.readout[:, [member]]
        )


@pytest.mark.parametrize("n", [1, 3, 30])
def test_a_dense_recurrent_circuit_gives_the_same_bits_alone(build, n):
    random = np.random.default_rng(n)
    models = [("sigmoid", {"slope": 3.0, "shift": 0.1}), ("tanh", {"slope": 2.0, "shift": 0.0})]
    neurons = [build.neuron(f"n{i}", models[i % 2][0], **models[i % 2][1]) for i in range(n)]
    names = [neuron.name for neuron in neurons]
    synapses = [(a, b, random.normal()) for a in ["u", *names] for b in names]
    for timing in ("as_printed", "synchronous", "ordered"):
        graph = build.circuit(
            neurons, synapses, [build.output("y", dict.fromkeys(names, 0.1), 0.1)], timing=timing
        )
        program = compile_circuit(graph, "numpy", reproducible=True)
        inputs = random.normal(size=(6, 50, 1))
        together = run(program, inputs)
        for member in (0, 31, 49):
            alone = run(program, inputs[:, [member]])
            assert _bits(alone.output, alone.readout) == _bits(
                together.output[:, [member]], together.readout[:, [member]]
            )


@settings(max_examples=40, deadline=None)
@given(data=st.data(), batch=st.integers(1, 5))
def test_step_stepper_and_run_are_one_thing(circuits, data, batch):
    graph = data.draw(circuits())
    program = compile_circuit(graph, "numpy", reproducible=True)
    inputs = np.random.default_rng(batch).normal(size=(4, batch, len(graph.inputs)))
    trace = run(program, inputs)
    stepper, state = Stepper(program, batch), program.initial_state(batch)
    for t in range(4):
        state = step(program, state, inputs[t])
        readout = stepper.step(inputs[t])
        expected = _bits(trace.activation[t], trace.output[t], trace.readout[t])
        assert _bits(state.activation, state.output, state.readout) == expected
        assert _bits(stepper.state.activation, stepper.state.output, readout) == expected
        outputs = np.empty((batch, len(graph.neurons)))
        stepper.store_output(outputs)
        assert _bits(outputs) == _bits(trace.output[t])
    assert _bits(trace.state.output, trace.state.readout) == _bits(state.output, state.readout)


@pytest.fixture
def program(build):
    neurons = [build.neuron(name, "tanh", slope=2.0, shift=0.1) for name in ("a", "b")]
    synapses = [("u", "a", 1.0), ("a", "b", 0.7), ("b", "a", -0.5)]
    return compile_circuit(build.circuit(neurons, synapses, [build.output("y", {"b": 1.0}, 0.1)]), "numpy")


def test_a_run_in_two_parts_is_the_run_in_one(program):
    inputs = np.random.default_rng(0).normal(size=(20, 3, 1))
    whole, first = run(program, inputs), run(program, inputs[:7])
    second = run(program, inputs[7:], first.state)
    assert _bits(second.output, second.readout) == _bits(whole.output[7:], whole.readout[7:])


def test_step_does_not_touch_its_state_unless_it_is_told_to(program):
    before = step(program, program.initial_state(2), np.ones((2, 1)))
    kept = before.copy()
    after = step(program, before, np.ones((2, 1)))
    assert _bits(before.activation, before.output, before.readout) == _bits(
        kept.activation, kept.output, kept.readout
    )
    same = step(program, before, np.ones((2, 1)), out=before)
    assert same is before
    assert _bits(before.activation, before.readout) == _bits(after.activation, after.readout)


def test_a_stepper_takes_inputs_in_place_and_goes_back_to_any_state(program):
    stepper = Stepper(program, 2)
    stepper.step(np.array([[0.5], [0.25]]))
    middle = stepper.state
    stepper.inputs[...] = 1.0
    first = stepper.step().copy()
    stepper.state = middle
    assert _bits(stepper.step(np.ones((2, 1)))) == _bits(first)
    stepper.reset()
    assert _bits(stepper.state.output, stepper.state.readout) == _bits(np.zeros((2, 2)), np.zeros((2, 1)))
    with pytest.raises(ValueError, match="read-only"):
        stepper.readout[0, 0] = 1.0


def test_a_program_is_frozen_and_survives_pickling(program):
    with pytest.raises(ValueError, match="read-only"):
        program.before[0].weights[0] = 2.0
    with pytest.raises(AttributeError):
        program.name = "other"
    inputs = np.random.default_rng(0).normal(size=(5, 2, 1))
    expected = run(program, inputs)
    assert _bits(run(pickle.loads(pickle.dumps(program)), inputs).output) == _bits(expected.output)


def test_threads_may_share_a_program(program):
    inputs = [np.random.default_rng(i).normal(size=(200, 2, 1)) for i in range(8)]
    expected = [_bits(run(program, each).output) for each in inputs]
    with ThreadPoolExecutor(4) as pool:
        assert [_bits(trace.output) for trace in pool.map(lambda u: run(program, u), inputs)] == expected
