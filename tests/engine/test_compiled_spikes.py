"""Sums of spikes by columns: the bits of the sums over all terms, and only where there are spikes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from programs import program_of

from circuitkit.circuit import parse_circuit
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.backends import compiled_backend, new_kernel
from circuitkit.engine.backends.c import spikes
from circuitkit.engine.operations import Map, Recall, Remember, Sum

pytestmark = pytest.mark.usefixtures("no_fallback", "quick_builds")
N_SOURCES, N_TARGETS, DELAY = 97, 60, 3


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Even small programs become loops, and their sums go by columns."""
    monkeypatch.setattr(compiled_backend, "_MAX_UNROLLED", -1)
    monkeypatch.setattr(spikes, "_MANY_TERMS", 1)


def some_sum(rng, start, base, *, one_weight, add):
    """Random sums with ascending sources; one of them without any, and one with a source twice."""
    connected = rng.random((N_TARGETS, N_SOURCES)) < 0.3
    connected[1] = False
    rows = [np.flatnonzero(row) for row in connected]
    rows[0] = np.array([5, 5, 40])
    indptr = np.concatenate([[0], np.cumsum([len(row) for row in rows])]).astype(np.int64)
    sources = np.concatenate(rows).astype(np.int32)
    weights = np.array(rng.normal()) if one_weight else rng.normal(size=len(sources))
    return Sum(start, start + N_TARGETS, indptr, sources, weights, add=add, base=base)


def spiking(rng, *, one_weight):
    """Inputs above a threshold are spikes; two sums of them, and one of what they were three steps ago."""
    spike = 1 + N_SOURCES
    delayed = spike + N_SOURCES
    sums = delayed + N_SOURCES
    compare = Map(N_SOURCES, ((spike, parse_expression("where(u > 1, u, 0)", ("u",))),), {"u": 1})
    slots = np.arange(N_SOURCES, dtype=np.int32)
    recall = Recall(0, delayed, sums, slots, np.full(N_SOURCES, DELAY, np.int32))
    remember = Remember(0, slots + np.int32(spike), DELAY)
    operations = (
        recall,
        compare,
        some_sum(rng, sums, spike, one_weight=one_weight, add=False),
        some_sum(rng, sums, delayed, one_weight=not one_weight, add=True),
        some_sum(rng, sums, spike, one_weight=one_weight, add=True),
        remember,
    )
    rows = range(sums, sums + N_TARGETS)
    return program_of(operations, rows.stop, n_inputs=N_SOURCES, lasting=rows, backend="compiled")


@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**31),
    active=st.sampled_from([0.0, 0.02, 0.1, 0.2, 1.0]),
    one_weight=st.booleans(),
    threads=st.sampled_from(["1", "2", "3"]),
)
def test_all_bits_are_those_of_the_sums_over_all_terms(seed, active, one_weight, threads):
    rng = np.random.default_rng(seed)
    program = spiking(rng, one_weight=one_weight)
    assert len(spikes.sums_of_spikes(program)) == 3
    inputs = rng.uniform(1.0, 2.0, size=(8, 1, N_SOURCES)) * (rng.random((8, 1, N_SOURCES)) < active)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CIRCUITKIT_THREADS", threads)
        found = run(program, inputs, states=True).states
        patch.setattr(spikes, "_MANY_TERMS", 10**9)
        wanted = run(replace(program), inputs, states=True).states
    assert found.tobytes() == wanted.tobytes()
    batch = run(program, np.repeat(inputs, 9, axis=1), states=True).states
    np.testing.assert_array_equal(batch[:, -1], found[:, 0])


def test_what_is_not_finite_is_no_zero():
    """An infinite spike reaches its targets."""
    program = spiking(np.random.default_rng(0), one_weight=False)
    kernel, state = new_kernel(program, 1), program.initial_state(1)
    kernel.load(state)
    kernel.inputs[0, 5] = np.inf
    assert not kernel.advance()
    kernel.store(state)
    assert not np.isfinite(state.states[0, 0])
    assert state.states[0, 1] == 0  # it has no sources


def test_terms_in_another_order_than_their_sources_are_left_as_they_are():
    program = spiking(np.random.default_rng(1), one_weight=True)
    first = program.before[2]
    backwards = np.concatenate([row[::-1] for row in np.split(first.sources, first.indptr[1:-1])])
    other = replace(first, sources=backwards)
    operations = *program.before[:2], other, *program.before[3:]
    assert first in spikes.sums_of_spikes(program)
    assert other not in spikes.sums_of_spikes(replace(program, before=operations))


NETWORK = """
circuit: network
control_step: 1 ms
timing: ordered
substeps: 2
inputs: {u: {unit: "1", range: [-1, 1]}}
populations:
  all: {size: 40, NEURON}
projections:
  - {from: all, to: all, connect: {in_degree: 10}, weight: WEIGHT, SYNAPSE}
outputs: {y: {unit: "1", readout: {"all[0]": 1}}}
"""


def network(neuron, weight, synapse):
    """A program of neurons of a kind, each with synapses from some others."""
    text = NETWORK.replace("NEURON", neuron).replace("WEIGHT", weight).replace("SYNAPSE", synapse)
    return compile_circuit(parse_circuit(text), backend="compiled")


@pytest.mark.parametrize("synapse", ["delay: 1 ms", "model: exponential, tau: 5 ms", "delay: 0 ms"])
def test_sums_of_spikes_are_found_behind_delays_and_synapses(synapse):
    program = network("model: leaky_integrate_and_fire, role: excitatory", "0.1 nA", synapse)
    assert len(spikes.sums_of_spikes(program)) == 1


@pytest.mark.parametrize(
    "neuron",
    ["model: sigmoid, slope: 1, shift: 0", "model: leaky_integrator, tau: 10 ms", "model: tanh, slope: 1"],
)
def test_rate_circuits_have_no_second_copy_of_their_weights(neuron, monkeypatch):
    monkeypatch.setattr(spikes, "_columns", lambda _: pytest.fail("a copy was made"))
    program = network(f"{neuron}, role: excitatory", "0.1", "delay: 1 ms")
    assert not spikes.sums_of_spikes(program)
    assert run(program, np.zeros((2, 1, 1))).readout.shape == (2, 1, 1)


def test_a_batch_of_spiking_circuits_has_no_second_copy_of_its_weights(monkeypatch):
    monkeypatch.setattr(spikes, "_columns", lambda _: pytest.fail("a copy was made"))
    new_kernel(spiking(np.random.default_rng(2), one_weight=False), 2)
