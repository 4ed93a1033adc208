"""Names, messages, wide and odd circuits, and values that are not finite."""

import warnings

import numpy as np
import pytest

from circuitkit.base.errors import DivergedError, InputError, UnknownNameError
from circuitkit.circuit import memory
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.engine import State, Stepper, compile_circuit, run, step
from circuitkit.engine.backends import BACKEND_NAMES
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.lowering.arithmetic import make_map


@pytest.fixture
def graph(build):
    neurons = [
        build.neuron("a", "sigmoid", slope=2.0, shift=0.0),
        build.neuron("b"),
        build.neuron("c", "window", slope=2.0, low=-1.0, high=1.0),
        build.neuron("d"),
    ]
    synapses = [
        ("left", "a", 1.0),
        ("right", "b", 2.0),
        ("right", "c", 1.0),
        ("a", "d", 1.0),
        ("b", "d", -1.0),
    ]
    return build.circuit(neurons, synapses, [build.output("y", {"d": 1.0})], inputs=("left", "right"))


def test_names_and_indices_are_in_file_order_whatever_the_order_inside(graph):
    program = compile_circuit(graph, "numpy")
    assert program.neuron_names == ("a", "b", "c", "d")
    assert program.input_index == {"left": 0, "right": 1}
    assert program.neuron_index == {"a": 0, "b": 1, "c": 2, "d": 3}
    assert program.output_index == {"y": 0}
    assert program.step_s == 0.01
    output = step(program, program.initial_state(), np.array([[0.0, 3.0]])).output
    assert output[0, [0, 1, 3]].tolist() == [0.5, 6.0, -5.5]


def test_inputs_are_packed_by_name(graph):
    program = compile_circuit(graph, "numpy")
    assert program.pack_inputs({"right": 2.0, "left": 1.0}).tolist() == [[1.0, 2.0]]
    assert program.pack_inputs({"left": np.zeros((5, 3)), "right": 1.0}).shape == (5, 3, 2)
    with pytest.raises(UnknownNameError) as unknown:
        program.pack_inputs({"left": 1.0, "rihgt": 2.0})
    assert str(unknown.value) == "unknown input 'rihgt'; allowed: left, right; did you mean 'right'?"
    with pytest.raises(InputError) as missing:
        program.pack_inputs({"left": 1.0})
    assert str(missing.value) == "inputs: found no value for right; allowed: a value for every input"
    with pytest.raises(InputError) as shapes:
        program.pack_inputs({"left": np.zeros(2), "right": np.zeros(3)})
    assert str(shapes.value) == "inputs: found shapes left (2,), right (3,); allowed: shapes that broadcast"


def test_shapes_that_do_not_fit_are_named_with_those_that_do(graph):
    program = compile_circuit(graph, "numpy")
    state = program.initial_state(4)
    calls = {
        "inputs: found shape (4, 3); allowed: an array of shape (4, 2) with the columns left, right": (
            lambda: step(program, state, np.zeros((4, 3)))
        ),
        "inputs: found shape (2,); allowed: an array of shape (1, 2) with the columns left, right": (
            lambda: Stepper(program).step(np.zeros(2))
        ),
        "inputs: found list; allowed: an array of shape (1, 2) with the columns left, right": (
            lambda: Stepper(program).step([[0.0, 0.0]])
        ),
        "inputs: found shape (9, 2); allowed: an array of shape (T, B, 2) with the columns left, right": (
            lambda: run(program, np.zeros((9, 2)))
        ),
        "state: found activation of shape (4, 4); allowed: (3, 4); a state fits the circuit that it was made "
        "for": (lambda: run(program, np.zeros((9, 3, 2)), state)),
        "out: found activation of shape (1, 4); allowed: (4, 4); a state fits the circuit that it was made "
        "for": (lambda: step(program, state, np.zeros((4, 2)), out=program.initial_state())),
        "batch: found 0; allowed: whole numbers from 1": lambda: program.initial_state(0),
    }
    for message, call in calls.items():
        with pytest.raises(InputError) as error:
            call()
        assert str(error.value) == message


def test_an_unknown_backend_is_named_with_those_there_are(graph):
    with pytest.raises(UnknownNameError) as error:
        compile_circuit(graph, backend="nunpy")
    assert (
        str(error.value)
        == f"unknown backend 'nunpy'; allowed: auto, {', '.join(BACKEND_NAMES)}; did you mean 'numpy'?"
    )


def test_an_unknown_precision_is_named_with_those_there_are(graph):
    with pytest.raises(UnknownNameError) as error:
        compile_circuit(graph, precision="float16")
    assert str(error.value).startswith("unknown precision 'float16'; allowed: float64, float32")


@pytest.mark.parametrize("wrap", [lambda program: program, lambda program: [program]])
def test_what_is_no_circuit_is_refused(graph, wrap):
    with pytest.raises(InputError) as error:
        compile_circuit(wrap(compile_circuit(graph, "numpy")))
    assert str(error.value) == ("circuit: found Program; allowed: a CircuitGraph, such as load_circuit gives")


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5])
def test_seeds_beyond_64_bits_are_refused(graph, seed):
    program = compile_circuit(graph, "numpy")
    assert program.initial_state(seed=2**64 - 1).seed[0] == 2**64 - 1
    with pytest.raises(InputError) as error:
        program.initial_state(seed=seed)
    assert str(error.value) == f"seed: found {seed}; allowed: whole numbers from 0 to 18446744073709551615"


def test_what_is_named_twice_is_recorded_once(graph):
    program = compile_circuit(graph, "numpy")
    trace = run(program, np.zeros((3, 1, 2)), record=["b", "a", "y", "b", "y"])
    assert (trace.neuron_names, trace.output_names) == (("b", "a"), ("y",))
    assert (trace.output.shape, trace.readout.shape) == ((3, 1, 2), (3, 1, 1))


def test_names_of_a_recording_are_in_its_order(graph):
    program = compile_circuit(graph, "numpy")
    inputs = np.ones((3, 1, 2))
    trace, every = run(program, inputs, record=["d", "c", "b", "a"]), run(program, inputs)
    assert trace.neuron_names == ("d", "c", "b", "a")
    np.testing.assert_array_equal(trace.output, every.output[..., ::-1])


def test_a_recording_that_does_not_fit_into_memory_is_refused(graph, monkeypatch):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 100_000_000)
    program = compile_circuit(graph, "numpy")
    with pytest.raises(InputError) as error:
        run(program, np.zeros((1000, 20000, 2)), record=["y"])
    assert str(error.value) == (
        "record: found 1000 steps of 20000 times 1 values, which need about 0.16 GB of memory, "
        "but this machine has 0.1 GB; allowed: fewer"
    )


def test_check_inputs_names_what_is_not_finite(graph):
    program = compile_circuit(graph, "numpy")
    inputs = np.zeros((10, 3, 2))
    program.check_inputs(inputs)
    inputs[4, 2, 1] = np.nan
    inputs[5, 0, 0] = np.inf
    expected = (
        "inputs.right: found nan at step 4, batch member 2; allowed: finite numbers; 1 more are not finite"
    )
    with pytest.raises(InputError) as error:
        program.check_inputs(inputs)
    assert str(error.value) == expected
    with pytest.raises(InputError) as error:
        run(program, inputs)
    assert str(error.value) == expected
    with pytest.raises(InputError) as error:
        program.check_inputs(np.array([[-np.inf, 0.0]]))
    assert str(error.value) == "inputs.left: found -inf at batch member 0; allowed: finite numbers"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_step_accepts_an_input_that_is_not_finite(graph, value):
    program = compile_circuit(graph, "numpy")
    stepper = Stepper(program)
    inputs = np.array([[0.0, value]])
    for call in (
        lambda: step(program, program.initial_state(), inputs),
        lambda: stepper.step(inputs),
        lambda: run(program, inputs[np.newaxis]),
    ):
        with pytest.raises(InputError, match=r"^inputs\.right: found -?(nan|inf) at "):
            call()
    stepper.reset()
    assert np.isfinite(stepper.step(np.zeros((1, 2)))).all()


def test_what_overflows_is_named_with_step_neuron_and_member(build):
    neurons = [build.neuron("a"), build.neuron("b")]
    synapses = [("u", "a", 1.0), ("a", "b", 1.0), ("b", "b", 1e200)]
    program = compile_circuit(
        build.circuit(neurons, synapses, [build.output("y", {"b": 1.0}, limit=1.0)]), "numpy"
    )
    inputs = np.zeros((4, 3, 1))
    inputs[:, 1] = 1.0
    message = "the circuit 'test' diverged: in step 2 the activation of b of batch member 1 became inf"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(DivergedError) as error:
            run(program, inputs)
        assert str(error.value) == message
        stepper = Stepper(program, 3)
        stepper.step(inputs[0])
        stepper.step(inputs[1])
        with pytest.raises(DivergedError) as error:
            stepper.step(inputs[2])
        assert str(error.value) == message


def test_sigmoids_do_not_overflow(build):
    neurons = [
        build.neuron("s", "sigmoid", slope=1e10, shift=0.0),
        build.neuron("w", "window", slope=1e10, low=-1.0, high=1.0),
    ]
    program = compile_circuit(build.circuit(neurons, [("u", "s", 1.0), ("u", "w", 1.0)]), "numpy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        trace = run(program, np.array([-1e300, 0.0, 1e300]).reshape(-1, 1, 1))
    assert trace.output[:, 0].tolist() == [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]


def test_circuits_without_inputs_outputs_or_synapses_run(build):
    graph = build.circuit([build.neuron("n", "sigmoid", slope=4.0, shift=0.5)], [], inputs=())
    trace = run(compile_circuit(graph, "numpy"), np.zeros((3, 2, 0)))
    assert trace.output.shape == (3, 2, 1)
    np.testing.assert_allclose(trace.output, 1 / (1 + np.exp(2.0)), rtol=1e-15)
    assert trace.readout.shape == (3, 2, 0)


def test_one_neuron_with_very_many_sources_among_others_with_few(build, by_hand):
    names = [f"n{i}" for i in range(300)]
    neurons = [build.neuron(name, "tanh", slope=1.0, shift=0.0) for name in names]
    synapses = [("u", "n1", 1.0)]
    synapses += [(name, "n0", 0.01 * i) for i, name in enumerate(names)]
    synapses += [("n0", name, 0.001 * i) for i, name in enumerate(names[2:])]
    graph = build.circuit(neurons, synapses, timing="synchronous")
    program = compile_circuit(graph, "numpy")
    state, reference = program.initial_state(), by_hand(graph)
    for _ in range(5):
        state = step(program, state, np.array([[0.3]]))
        expected = reference.tick({"u": 0.3})[1]
    np.testing.assert_allclose(state.output[0], expected, rtol=1e-12)


def test_a_state_of_zeros_has_the_shapes_of_its_program(graph):
    state = compile_circuit(graph, "numpy").initial_state(3)
    assert isinstance(state, State)
    assert state.batch == 3
    assert (state.activation.shape, state.output.shape, state.readout.shape) == ((3, 4), (3, 4), (3, 1))
    assert not state.output.any()


def test_what_follows_from_a_choice_between_constants_is_computed_once():
    """The factor of an exponential step of a neuron that waits or not: dt phi1(dt J), J = 0 or -1 / tau."""
    text = "x + dt * exprel(dt * where(wait > 0, 0, -1 / tau)) * x"
    constants = {"dt": np.array(0.5), "tau": np.array([1.0, 2.0])}
    made = make_map(
        2, ((1, parse_expression(text, ("x", "wait", "dt", "tau"))),), {"x": 1, "wait": 3}, constants
    )
    ((_, expression),) = made.results
    assert "exprel" not in str(expression)
    for wait, factor in ((1.0, [0.5, 0.5]), (0.0, [1 - np.exp(-0.5), 2 * (1 - np.exp(-0.25))])):
        values = {"x": np.array([3.0, 5.0]), "wait": np.full(2, wait), **made.constants}
        found = expression.evaluate(values, NUMPY_FUNCTIONS)
        np.testing.assert_allclose(found, np.array([3.0, 5.0]) * (1 + np.array(factor)), rtol=1e-15)
