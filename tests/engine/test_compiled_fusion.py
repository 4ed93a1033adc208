"""Maps that share a loop: what they leave is what they leave one after the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from programs import program_of

from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.engine import run
from circuitkit.engine.backends import compiled_backend
from circuitkit.engine.backends.c import fusion
from circuitkit.engine.operations import Map, Sum

pytestmark = pytest.mark.usefixtures("no_fallback", "quick_builds")
N_INPUTS, N_ROWS, COUNT = 4, 60, 10


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Even small programs become loops, and even short ones are shared."""
    monkeypatch.setattr(compiled_backend, "_MAX_UNROLLED", -1)
    monkeypatch.setattr(fusion, "_MANY_ROWS", 1)


def some_map(rng, first):
    """One to two results that stay where they are or go elsewhere; constants, and rows picked from inputs."""
    starts = rng.choice(first, size=3, replace=False).tolist()
    texts = rng.choice(["x + c", "y - x * c", "p + y", "tanh(x) + p"], size=rng.integers(1, 3))
    results = [(starts[k], parse_expression(text, ("x", "y", "c", "p"))) for k, text in enumerate(texts)]
    pick = rng.integers(1, 1 + N_INPUTS, size=COUNT).astype(np.int32)
    constant = rng.normal(size=COUNT) if rng.random() < 0.5 else np.array(rng.normal())
    rows = {"x": starts[int(rng.integers(0, 3))], "y": starts[2]}
    return Map(COUNT, tuple(results), rows, {"p": pick}, {"c": constant})


def some_sum(rng, first):
    """Sums of one term each, or of two."""
    start, base = rng.choice(first, size=2, replace=False).tolist()
    sources = np.arange(COUNT, dtype=np.int32)
    if rng.random() < 0.3:
        sources = np.sort(np.concatenate([sources, sources[::-1]]))
    indptr = np.linspace(0, len(sources), COUNT + 1).astype(np.int64)
    weights = rng.normal(size=len(sources)) if rng.random() < 0.5 else np.array(rng.normal())
    return Sum(start, start + COUNT, indptr, sources, weights, add=bool(rng.integers(2)), base=base)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**31), batch=st.sampled_from([1, 3]), threads=st.sampled_from(["1", "2"]))
def test_any_maps_and_sums_leave_what_they_leave_one_after_the_other(seed, batch, threads):
    """Rows of two grids, of which one is shifted: ranges that are the same, apart, or overlap."""
    rng = np.random.default_rng(seed)
    grids = [np.arange(5, 50, COUNT), np.arange(8, 50, COUNT)]
    operations = []
    for _ in range(12):
        make = some_sum if rng.random() < 0.3 else some_map
        operations.append(make(rng, grids[int(rng.random() < 0.2)]))
    program = program_of(operations, N_ROWS, n_inputs=N_INPUTS, lasting=range(5, N_ROWS), backend="compiled")
    inputs = rng.normal(size=(3, batch, N_INPUTS))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CIRCUITKIT_THREADS", threads)
        found = run(program, inputs, states=True).states
        patch.setattr(fusion, "_MANY_ROWS", 10**9)
        apart = run(replace(program), inputs, states=True).states
    assert found.tobytes() == apart.tobytes()
    wanted = run(replace(program, backend="numpy"), inputs, states=True).states
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


def plus_one(source_row, target):
    return Map(COUNT, ((target, parse_expression("x + 1", ("x",))),), {"x": source_row})


def loops(*operations):
    """Indices of the maps of every loop."""
    return [[operations.index(each) for each in loop.maps] for loop in fusion.fused(operations)]


def test_maps_join_the_last_loop_that_nothing_keeps_them_from():
    chain = plus_one(5, 15), plus_one(15, 5)
    assert loops(*chain) == [[0, 1]]
    assert loops(plus_one(5, 15), plus_one(16, 30)) == [[0], [1]]  # reads what others of the first one write
    assert loops(plus_one(5, 15), plus_one(30, 16)) == [[0], [1]]  # writes what others of the first one write
    assert loops(plus_one(16, 30), plus_one(40, 15)) == [[0], [1]]  # writes what others of the first one read


def test_maps_pass_operations_that_have_nothing_to_do_with_them():
    two = Sum(
        30, 40, np.arange(0, 21, 2), np.repeat(np.arange(10, dtype=np.int32), 2), np.array(2.0), base=15
    )
    free, bound = plus_one(5, 5), plus_one(30, 5)
    assert [type(each) for each in fusion.fused([plus_one(5, 15), two, free])] == [fusion.Loop, Sum]
    assert [type(each) for each in fusion.fused([plus_one(5, 15), two, bound])] == [
        fusion.Loop,
        Sum,
        fusion.Loop,
    ]
