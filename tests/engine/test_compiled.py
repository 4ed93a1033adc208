"""The compiled backend: agreement with numpy, the same bits in every batch, what a divergence looks like."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from programs import program_of
from random_circuits import any_circuits

from circuitkit.base.errors import DivergedError, InputError
from circuitkit.circuit import load_circuit
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine import Stepper, compile_circuit, run
from circuitkit.engine.backends import compiled_backend, new_kernel
from circuitkit.engine.backends.c import fusion
from circuitkit.engine.backends.compiled_backend import CompiledKernel
from circuitkit.engine.operations import Map, Noise, Recall, Remember, Sum

pytestmark = pytest.mark.usefixtures("no_fallback", "quick_builds")
FORMS = {"unrolled": 10**6, "loops": -1}
both_forms = pytest.mark.usefixtures("form")
PARTS = ("activation", "output", "readout", "states")


@pytest.fixture(params=FORMS)
def form(request, monkeypatch):
    """Both ways to print a program."""
    monkeypatch.setattr(compiled_backend, "_MAX_UNROLLED", FORMS[request.param])
    monkeypatch.setattr(fusion, "_MANY_ROWS", 1)
    return request.param


def states_of(program, inputs, seed=0):
    """States after each step, by the compiled and by the numpy backend."""
    batch = inputs.shape[1]
    found = []
    for backend in ("compiled", "numpy"):
        chosen = replace(program, backend=backend)
        if backend == "compiled":
            assert isinstance(new_kernel(chosen, batch), CompiledKernel)
        state = chosen.initial_state(batch, seed)
        found.append(run(chosen, inputs, state, states=True).states)
    return found


def agree(found, wanted, tolerance=1e-12):
    np.testing.assert_allclose(found, wanted, rtol=tolerance, atol=tolerance)


@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
@given(graph=any_circuits(), seed=st.integers(0, 2**31), limit=st.sampled_from([*FORMS.values()]))
def test_random_circuits_of_all_kinds_agree_with_numpy_and_alone_with_the_batch(graph, seed, limit):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_backend, "_MAX_UNROLLED", limit)
        patch.setattr(fusion, "_MANY_ROWS", 1)
        program = compile_circuit(graph, backend="numpy")
        compiled = replace(program, backend="compiled")
        inputs = np.random.default_rng(seed).normal(size=(8, 20, len(graph.inputs)))
        wanted = run(program, inputs, program.initial_state(20, seed), states=True)
        batch = run(compiled, inputs, compiled.initial_state(20, seed), states=True)
        alone = run(compiled, inputs[:, :1], compiled.initial_state(1, seed), states=True)
    for part in PARTS:
        agree(getattr(batch, part), getattr(wanted, part))
        np.testing.assert_array_equal(getattr(alone, part)[:, 0], getattr(batch, part)[:, 0])
    for found, expected in zip(batch.state.histories, wanted.state.histories, strict=True):
        agree(found, expected)
    assert batch.state.time == wanted.state.time == 8


def side_by_side(graphs: list[CircuitGraph]) -> CircuitGraph:
    """Many circuits as one: every name with the number of its circuit before it."""

    def renamed(node, k, **fields):
        return replace(node, **{key: f"c{k}_{getattr(node, key)}" for key in fields if getattr(node, key)})

    first = graphs[0]
    parts: dict[str, list] = {"inputs": [], "neurons": [], "synapses": [], "outputs": []}
    for k, graph in enumerate(graphs):
        parts["inputs"] += [renamed(node, k, name=1) for node in graph.inputs]
        parts["neurons"] += [renamed(node, k, name=1) for node in graph.neurons]
        parts["synapses"] += [renamed(each, k, source=1, target=1, gate=1) for each in graph.synapses]
        for output in graph.outputs:
            readout = tuple((f"c{k}_{name}", weight) for name, weight in output.readout)
            parts["outputs"].append(replace(renamed(output, k, name=1), readout=readout))
    tuples = {key: tuple(values) for key, values in parts.items()}
    return CircuitGraph(
        "all", "", first.timing, first.step_s, parameters={}, substeps=first.substeps, **tuples
    )


@settings(max_examples=2, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    graphs=st.lists(any_circuits(populations=False), min_size=30, max_size=30),
    seed=st.integers(0, 2**31),
)
def test_many_random_circuits_agree_with_numpy_in_one_translation_unit(graphs, seed):
    program = compile_circuit(side_by_side(graphs), backend="numpy")
    compiled = replace(program, backend="compiled")
    inputs = np.random.default_rng(seed).normal(size=(6, 3, len(program.input_names)))
    wanted = run(program, inputs, program.initial_state(3, seed), states=True)
    found = run(compiled, inputs, compiled.initial_state(3, seed), states=True)
    for part in PARTS:
        agree(getattr(found, part), getattr(wanted, part))


FUNCTIONS = (
    "abs(x)", "clip(x, y, z)", "cos(x)", "exp(x)", "expm1(x)", "exprel(x)", "floor(3 * x)", "heaviside(x)",
    "log(abs(x) + 0.1)", "log1p(abs(x))", "max(x, y)", "min(x, y)", "sigmoid(x)", "sign(x)", "sin(x)",
    "sqrt(abs(x))", "tanh(x)", "where(x > y, x, z)", "x < y", "x <= y", "x > y", "x >= y",
    "-x + y * z - x / 3", "abs(x) ** 1.7", "x ** 2", "x ** 3", "x ** 5", "x ** 7", "x ** 8",
    "abs(x) ** 0.5", "x ** -2", "2 ** y",
)  # fmt: skip


@both_forms
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_every_function_agrees_with_numpy(precision):
    names = ("x", "y", "z")
    results = [(4 + i, parse_expression(text, names)) for i, text in enumerate(FUNCTIONS)]
    maps = [Map(1, (result,), {name: 1 + i for i, name in enumerate(names)}) for result in results]
    rows = range(4, 4 + len(results))
    program = program_of(maps, 4 + len(results), n_inputs=3, lasting=rows, precision=precision)
    inputs = np.random.default_rng(0).normal(size=(4, 50, 3)).astype(precision).astype(np.float64)
    agree(*states_of(program, inputs), tolerance=1e-12 if precision == "float64" else 1e-5)


def some_sum(rng, n_sources, n, weights, *, add=False):
    """Random sums of 0 to 4 terms from rows 1 ... into rows after them."""
    lengths = rng.integers(0, 5, size=n)
    indptr = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    sources = rng.integers(0, n_sources, size=indptr[-1]).astype(np.int32)
    shapes = {"one": (), "each": (indptr[-1],), "signs": (indptr[-1],), "members": (indptr[-1], 5)}
    values = rng.normal(size=shapes[weights])
    values = np.sign(values) if weights == "signs" else values
    return Sum(1 + n_sources, 1 + n_sources + n, indptr, sources, values, add=add, base=1)


@both_forms
@pytest.mark.parametrize("weights", ["one", "each", "signs", "members"])
def test_sums_agree_with_numpy(weights):
    rng = np.random.default_rng(1)
    sums = [some_sum(rng, 3, 7, weights), some_sum(rng, 3, 7, weights, add=True)]
    program = program_of(sums, 11, n_inputs=3, lasting=range(4, 11), members=5 if weights == "members" else 0)
    agree(*states_of(program, rng.normal(size=(6, 5, 3))))


def test_the_members_of_a_sweep_are_the_circuits_alone():
    rng = np.random.default_rng(2)
    graphs = [
        compile_graph(slope, weight)
        for slope, weight in zip(rng.normal(size=9), rng.normal(size=9), strict=True)
    ]
    sweep = compile_circuit(graphs, backend="compiled")
    inputs = np.repeat(rng.normal(size=(10, 1, 1)), 9, axis=1)
    found = run(sweep, inputs)
    for member, graph in enumerate(graphs):
        alone = run(compile_circuit(graph, backend="compiled"), inputs[:, :1])
        np.testing.assert_array_equal(found.output[:, member], alone.output[:, 0])


def compile_graph(slope, weight):
    """Two neurons in a row."""
    from circuitkit.circuit import parse_circuit

    text = f"""
circuit: two
control_step: 10 ms
timing: ordered
inputs: {{u: {{unit: "1", range: [-1, 1]}}}}
neurons:
  a: {{model: sigmoid, role: excitatory, slope: {abs(slope) + 0.5}, shift: 0.1}}
  b: {{model: tanh, role: excitatory, slope: 1}}
synapses:
  - {{from: u, to: a, weight: {weight}}}
  - {{from: a, to: b, weight: {abs(weight)}}}
outputs: {{y: {{unit: "1", readout: {{b: 1}}}}}}
"""
    return parse_circuit(text)


@both_forms
@pytest.mark.parametrize("in_substeps", [False, True])
def test_delays_give_back_what_was_so_many_steps_ago(in_substeps):
    """Row 2 counts its own steps; rows 3, 4, 5 are it 1, 2 and 5 steps ago, from -1 on."""
    count = Map(1, ((2, parse_expression("x + 1", ("x",))),), {"x": 2})
    recall = Recall(0, 3, 6, np.zeros(3, np.int32), np.array([1, 2, 5], np.int32))
    remember = Remember(0, np.array([2], np.int32), 5)
    operations = (recall, count, remember)
    program = program_of(
        () if in_substeps else operations,
        6,
        substep=operations if in_substeps else (),
        substeps=3,
        lasting=(2, 3, 4, 5),
        initial=np.array([0.0, 0, -1, 0, 0, 0]),
        backend="compiled",
    )
    steps = 9
    state = program.initial_state(2)
    kernel = new_kernel(program, 2)
    for done in range(1, steps + 1):
        kernel.load(state)  # the ring must not depend on where it stood
        assert kernel.advance()
        kernel.store(state)
        runs = done * (3 if in_substeps else 1)
        count_now = runs - 1
        ago = [max(-1, count_now - k) for k in (1, 2, 5)]
        assert state.states[1].tolist() == [count_now, *ago]
        assert state.histories[0][0, :, 0].tolist() == [max(-1, count_now - k) for k in range(5)]


@both_forms
def test_noise_is_that_of_the_definition():
    """Seeds, streams and times that the reference computes in Python's integers."""
    from reference import normal

    noise = Noise(2, 5, np.array([1.0, 0.5, 2.0]), np.array([0, 7, 123456], np.int32))
    clear = Sum(2, 5, np.zeros(4, np.int64), np.zeros(0, np.int32), np.zeros(0))
    program = program_of((clear, noise), 5, lasting=(2, 3, 4), backend="compiled")
    found = run(program, np.zeros((3, 4, 1)), program.initial_state(4, seed=2**63), states=True).states
    for t, b in np.ndindex(3, 4):
        wanted = [s * normal(2**63 + b, k, t) for s, k in ((1.0, 0), (0.5, 7), (2.0, 123456))]
        agree(found[t, b], wanted, 1e-14)


@pytest.mark.parametrize("threads", ["2", "3"])
@pytest.mark.parametrize("batch", [1, 17, 100])
def test_threads_and_batch_sizes_change_no_bit(form, threads, batch, monkeypatch):
    rng = np.random.default_rng(3)
    n = 400 if form == "loops" else 12
    sums = some_sum(rng, 40, n, "each")
    pick = rng.integers(1, 41, size=n).astype(np.int32)
    squash = Map(n, ((41, parse_expression("tanh(x) * sigmoid(y)", ("x", "y"))),), {"x": 41}, {"y": pick})
    program = program_of((sums, squash), 41 + n, n_inputs=40, lasting=range(41, 41 + n), backend="compiled")
    inputs = rng.normal(size=(5, batch, 40))
    one = run(program, inputs, states=True).states
    monkeypatch.setenv("CIRCUITKIT_THREADS", threads)
    several = run(replace(program), inputs, states=True).states
    np.testing.assert_array_equal(one, several)
    alone = run(replace(program), inputs[:, -1:], states=True).states
    np.testing.assert_array_equal(several[:, -1:], alone)


@both_forms
@pytest.mark.parametrize("batch", [1, 20, 50])
def test_a_run_ends_with_the_step_after_which_something_is_not_finite(batch):
    """Member 17 of 20 doubles from 1e300 on: infinite after step 27 (2^28 1e300 > 1.8e308)."""
    double = Map(1, ((2, parse_expression("2 * x + u", ("x", "u"))),), {"x": 2, "u": 1})
    program = program_of((double,), 3, lasting=(2,), backend="compiled")
    steps, member = 40, min(batch - 1, 17)
    inputs = np.zeros((steps, batch, 1))
    inputs[0, member] = 1e300
    first = next(t for t in range(steps) if not math.isfinite(1e300 * 2.0**t))
    kernel = new_kernel(program, batch)
    kernel.load(program.initial_state(batch))
    record = np.zeros((steps, batch, 1))
    assert kernel.run(inputs, np.array([2], np.int32), record) == first
    state = program.initial_state(batch)
    kernel.store(state)
    assert state.time == first + 1
    assert np.flatnonzero(~np.isfinite(state.states[:, 0])).tolist() == [member]
    with pytest.raises(
        DivergedError, match=f"in step {first} the state 2 of batch member {member} became inf"
    ):
        run(program, inputs)


@both_forms
def test_a_large_but_finite_number_is_no_divergence():
    """Two numbers of 1e308 are finite, although their sum, which is looked at first, is not."""
    keep = Map(
        2, ((2, parse_expression("1e308 * heaviside(x)", ("x",))),), {}, {"x": np.array([1, 1], np.int32)}
    )
    program = program_of((keep,), 4, lasting=(2, 3), backend="compiled")
    for batch in (1, 3):
        assert run(program, np.ones((2, batch, 1)), states=True).states.max() == 1e308


@both_forms
def test_an_input_that_is_not_finite_is_noticed_in_the_step():
    program = program_of((), 3, lasting=(2,), backend="compiled")
    stepper = Stepper(program, 3)
    stepper.inputs[2] = math.nan
    with pytest.raises(InputError, match="found nan at batch member 2"):
        stepper.step()
    stepper.reset()
    stepper.inputs[...] = 1.0
    stepper.step()


@both_forms
def test_a_run_of_many_steps_is_the_same_steps_one_by_one():
    program = compile_circuit(load_circuit("binn_lateral"), backend="compiled")
    inputs = np.random.default_rng(4).normal(size=(30, 5, 2)) * [0.3, 0.1]
    trace = run(program, inputs)
    stepper = Stepper(program, 5)
    for t, row in enumerate(inputs):
        np.testing.assert_array_equal(stepper.step(row), trace.readout[t])
    for found, wanted in zip(stepper.state.arrays(), trace.state.arrays(), strict=True):
        np.testing.assert_array_equal(found, wanted)


@both_forms
def test_float32_is_close():
    double = compile_circuit(load_circuit("binn_lateral"), backend="compiled")
    single = compile_circuit(load_circuit("binn_lateral"), backend="compiled", precision="float32")
    inputs = np.random.default_rng(5).normal(size=(30, 9, 2)) * [0.3, 0.1]
    assert isinstance(new_kernel(single, 9), CompiledKernel)
    np.testing.assert_allclose(run(single, inputs).readout, run(double, inputs).readout, atol=2e-4)


def test_weights_are_data(monkeypatch):
    """Other numbers need no other library."""
    new_kernel(compile_circuit(compile_graph(1.0, 0.5), backend="compiled"), 1)
    monkeypatch.setenv("PATH", "")
    other = compile_circuit(compile_graph(2.0, 0.7), backend="compiled")
    assert isinstance(new_kernel(other, 1), CompiledKernel)
