"""Whether a state fits a program: looked at as a whole before anything is taken over."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from circuitkit.base.errors import InputError
from circuitkit.circuit import parse_circuit
from circuitkit.engine import State, Stepper, compile_circuit, run, step

TEXT = """
circuit: c
control_step: 10 ms
timing: ordered
inputs: {{u: {{unit: "1", range: [0, 1]}}}}
neurons:
  {name}: {{model: leaky_linear, role: excitatory, tau: 20 ms}}
  b: {{model: {model}, role: excitatory{more}}}
synapses:
  - {{from: u, to: {name}, weight: 1}}
  - {{from: {name}, to: b, weight: 1{delay}}}
outputs: {{{output}: {{unit: "1", readout: {{b: 1}}}}}}
"""
HINT = "a state fits the circuit that it was made for"
LINEAR = ", tau: 20 ms"


def program_of(
    name="a", model="leaky_linear", more=LINEAR, delay=", delay: 30 ms", backend="numpy", output="y"
):
    text = TEXT.format(name=name, model=model, more=more, delay=delay, output=output)
    return compile_circuit(parse_circuit(text), backend=backend)


def spoilt(**changes):
    return lambda state: replace(state, **{name: change(state) for name, change in changes.items()})


def with_nan(state):
    state.states[1, 1] = np.nan
    return state


BAD = {
    "found dict; allowed: a State, such as Program.initial_state gives": lambda _: {},
    "found activation of shape (3, 2); allowed: (2, 2)": lambda _: program_of().initial_state(3),
    "found states of shape (2, 1); allowed: (2, 2)": spoilt(states=lambda s: s.states[:, :1].copy()),
    "found states of float32; allowed: float64": spoilt(states=lambda s: s.states.astype(np.float32)),
    "found output of the type list; allowed: an array of shape (2, 2)": spoilt(
        output=lambda s: s.output.tolist()
    ),
    "found histories[0] of shape (2, 5, 1); allowed: (2, 4, 1)": (
        lambda _: program_of(delay=", delay: 40 ms").initial_state(2)
    ),
    "found delayed values of 0 memories; allowed: 1, as many as the circuit has": spoilt(
        histories=lambda _: ()
    ),
    "found delayed values of 3 memories; allowed: 1, as many as the circuit has": spoilt(
        histories=lambda s: s.histories * 3
    ),
    "found seed of shape (1,); allowed: (2,)": spoilt(seed=lambda s: s.seed[:1]),
    "found seed of int64; allowed: uint64": spoilt(seed=lambda s: s.seed.astype(np.int64)),
    "found time -1; allowed: a whole number of control steps from 0": spoilt(time=lambda _: -1),
    "found time 1.5; allowed: a whole number of control steps from 0": spoilt(time=lambda _: 1.5),
    "found a state with other neurons than the circuit's; allowed: the same": (
        lambda _: program_of(name="other").initial_state(2)
    ),
    "found a state with other outputs than the circuit's; allowed: the same": (
        lambda _: program_of(output="z").initial_state(2)
    ),
    "found readout of shape (2, 2); allowed: (2, 1)": spoilt(readout=lambda _: np.zeros((2, 2))),
    "found nan as states of b.v of batch member 1; allowed: finite numbers": with_nan,
    "found inf as readout of y of batch member 0; allowed: finite numbers": spoilt(
        readout=lambda _: np.array([[np.inf], [0]])
    ),
    "found nan as activation of a of batch member 1; allowed: finite numbers": spoilt(
        activation=lambda _: np.array([[0, 0], [np.nan, np.nan]])
    ),
    "found nan as histories[0] of batch member 1; allowed: finite numbers": spoilt(
        histories=lambda s: (np.where(np.arange(2).reshape(2, 1, 1), np.nan, s.histories[0]),)
    ),
}  # fmt: skip


@pytest.mark.parametrize("backend", ["numpy", "auto"])
@pytest.mark.parametrize("message", BAD)
def test_a_state_that_does_not_fit_is_refused_and_nothing_of_it_is_taken(message, backend):
    program = program_of(backend=backend)
    stepper = Stepper(program, 2, seed=7)
    stepper.step(np.ones((2, 1)))
    before = stepper.state
    bad = BAD[message](before.copy())
    calls = [lambda: setattr(stepper, "state", bad), lambda: run(program, np.zeros((5, 2, 1)), bad)]
    if "finite" not in message and "(3, 2)" not in message:
        calls.append(lambda: step(program, bad, np.zeros((2, 1))))
    for call in calls:
        with pytest.raises(InputError) as error:
            call()
        assert str(error.value) == f"state: {message}; {HINT}"
    after = stepper.state
    for mine, theirs in zip(before.arrays(), after.arrays(), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert (after.time, after.seed.tolist()) == (1, [7, 8])


def test_a_step_from_a_state_with_nan_says_that_it_was_there_before():
    program = program_of()
    with pytest.raises(InputError, match=r"state: found nan as states of b\.v of batch member 1"):
        step(program, with_nan(program.initial_state(2)), np.zeros((2, 1)))


def test_a_state_of_another_model_with_the_same_names_of_neurons_is_refused():
    other = program_of(model="matsuoka", more=", tau: 20 ms, tau_adaptation: 1 s, beta: 1").initial_state(2)
    with pytest.raises(InputError, match="found states of shape"):
        Stepper(program_of(), 2).state = other


def test_a_state_of_delays_of_other_neurons_is_refused():
    """As many memories, as deep, but of the outputs of others."""
    text = TEXT.format(name="a", model="leaky_linear", more=LINEAR, delay=", delay: 30 ms", output="y")
    turned = text.replace("from: a, to: b", "from: b, to: a")
    with pytest.raises(InputError, match="found a state with other delays than the circuit's"):
        Stepper(program_of(), 2).state = compile_circuit(parse_circuit(turned), "numpy").initial_state(2)


def test_states_pass_between_backends_pickles_and_programs_compiled_again():
    program = program_of()
    state = run(program, np.ones((5, 2, 1))).state
    for fitting in (
        pickle.loads(pickle.dumps(state)),
        run(program_of(backend="auto"), np.ones((5, 2, 1))).state,
        run(pickle.loads(pickle.dumps(program)), np.ones((5, 2, 1))).state,
    ):
        found = step(program, fitting, np.ones((2, 1)))
        np.testing.assert_allclose(found.states, step(program, state, np.ones((2, 1))).states, rtol=1e-12)
    other = pickle.loads(pickle.dumps(program_of(name="other").initial_state(2)))
    with pytest.raises(InputError, match="other neurons"):
        step(program, other, np.ones((2, 1)))


def test_out_must_fit_and_be_writable_but_may_hold_anything():
    program = program_of()
    state, out = program.initial_state(2), program.initial_state(2)
    out.states[...] = np.nan
    assert step(program, state, np.ones((2, 1)), out) is out
    out.states.flags.writeable = False
    with pytest.raises(
        InputError, match="out: found arrays that cannot be written; allowed: arrays to write to"
    ):
        step(program, state, np.ones((2, 1)), out)


def test_a_state_put_together_by_hand_is_known_by_its_shapes():
    state = program_of().initial_state(1)
    by_hand = State(*state.arrays()[:4], state.histories, 0, state.seed)
    step(program_of(), by_hand, np.ones((1, 1)))


def test_a_sweep_steps_a_state_of_its_own_size_only():
    graph = parse_circuit(TEXT.format(name="a", model="leaky_linear", more=LINEAR, delay="", output="y"))
    sweep = compile_circuit([graph, graph], "numpy")
    other = compile_circuit(graph, "numpy").initial_state(3)
    for call in (
        lambda: step(sweep, other, np.zeros((3, 1)), other.copy()),
        lambda: run(sweep, np.zeros((4, 3, 1)), other),
    ):
        with pytest.raises(
            InputError, match="batch: found 3; allowed: 2, the number of circuits of the sweep"
        ):
            call()
