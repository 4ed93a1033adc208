"""Extreme numbers in circuits of all kinds: all backends answer alike, by numbers or by a divergence.

The structure of a circuit decides about its C, numbers are data: so one structure is tried with many numbers.
What one gets may hang on the last bit, as the difference of two large numbers does: a case in which the numpy
backend itself answers otherwise to numbers that are changed far behind the point is passed over, and counted.
`pytest tests/engine/test_extremes.py --cases N` tries N of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import CASES
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from random_circuits import any_circuits

from circuitkit.base.errors import DivergedError
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.backends import compiled_backend
from circuitkit.engine.backends.c import fusion
from circuitkit.engine.operations import Map, Noise, Sum

pytestmark = pytest.mark.usefixtures("no_fallback", "quick_builds")
OF_A_STRUCTURE = 50
LARGEST = 3.4e38  # of inputs and initial values, which are finite in either precision
EXTREMES = np.array([
    0.0, -0.0, 1.0, -1.0, 0.5, 1e308, -1e308, 1.7976931348623157e308, 5e-324, -5e-324, 2e-308, 1e154, -1e154,
    1e-154, 3.4028234663852886e38, 3.5e38, -3.5e38, 1.2e-38, 1e-45, 1e19, 1e-19, 88.0, 104.0, 709.0, 710.0,
    -745.0, 800.0, -800.0, 2.0**53, 2.0**24, 1e16,
])  # fmt: skip
COUNTS = {"alike": 0, "diverged": 0, "passed over": 0}


def extreme(rng, shape):
    """Usual numbers, with some extreme ones among them."""
    usual = rng.normal(size=shape)
    return np.where(rng.random(shape) < rng.choice([0.02, 0.1, 0.5]), rng.choice(EXTREMES, size=shape), usual)


def changed(program, change):
    """The program with every array of numbers changed, the limits of outputs left as they are."""

    def of(operation):
        if isinstance(operation, Sum):
            return replace(operation, weights=np.asarray(change(operation.weights)))
        if isinstance(operation, Noise):
            return replace(operation, scale=np.asarray(change(operation.scale)))
        if isinstance(operation, Map):
            kept = {"low", "high"} if operation in program.after else set()
            constants = {n: v if n in kept else np.asarray(change(v)) for n, v in operation.constants.items()}
            return replace(operation, constants=constants)
        return operation

    parts = {part: tuple(map(of, getattr(program, part))) for part in ("before", "substep", "after")}
    initial = np.clip(np.asarray(change(program.initial), np.float64), -LARGEST, LARGEST)
    return replace(program, **parts, initial=initial)


def answer(program, inputs):
    """What comes out: the divergence in words, or all numbers."""
    try:
        trace = run(program, inputs, states=True)
    except DivergedError as error:
        return str(error).partition(" became ")[0]
    return np.concatenate([trace.activation, trace.output, trace.readout, trace.states], axis=-1)


def rounding(program):
    """What the dense backend may leave out of an activation: it holds its distance from the shift."""
    shifts = [m.constants["shift"] for m in program.before if isinstance(m, Map) and "shift" in m.constants]
    largest = max((np.abs(shift).max() for shift in shifts), default=0.0)
    return 4 * np.finfo(program.precision).eps * float(largest)


def alike(one, other, tolerance, floor=0.0):
    if isinstance(one, str) or isinstance(other, str):
        return isinstance(one, str) and isinstance(other, str) and one == other
    scale = np.maximum(np.abs(one), np.abs(other))
    return bool((np.abs(one / 2 - other / 2) <= tolerance * np.maximum(scale, 1e-30) + floor).all())


def check(program, rng, batch):
    dtype = np.dtype(program.precision)
    inputs = extreme(rng, (4, batch, len(program.input_names)))
    if dtype == np.float32:
        inputs = np.clip(inputs, -LARGEST, LARGEST)
    with np.errstate(over="ignore"):
        tried = changed(program, lambda values: extreme(rng, values.shape).astype(dtype))
    wanted = answer(tried, inputs)
    tolerance = 1e-7 if dtype == np.float64 else 1e-2
    for size in (1e-12, -3e-13) if dtype == np.float64 else (1e-4, -3e-5):
        with np.errstate(over="ignore"):
            moved = changed(tried, lambda v: (v * (1 + size * rng.random(v.shape))).astype(dtype))  # noqa: B023
        if not alike(answer(moved, inputs), wanted, tolerance):
            COUNTS["passed over"] += 1
            return
    COUNTS["diverged" if isinstance(wanted, str) else "alike"] += 1
    others = {
        "dense": replace(tried, reproducible=False),
        "compiled": replace(tried, backend="compiled"),
    }
    for name, other in others.items():
        found = answer(other, inputs)
        floor = np.zeros(1 if isinstance(wanted, str) else wanted.shape[-1])
        floor[: len(tried.neuron_names)] = rounding(tried) if name == "dense" else 0.0
        assert alike(found, wanted, tolerance, floor), (name, found, wanted)


@settings(
    max_examples=max(1, CASES // OF_A_STRUCTURE),
    deadline=None,
    suppress_health_check=list(HealthCheck),
    derandomize=CASES <= 300,
    phases=[Phase.generate],  # structures are large: shrinking them takes longer than reading one
)
@given(
    graph=any_circuits(),
    seed=st.integers(0, 2**31),
    unrolled=st.sampled_from([10**6, -1]),
    precision=st.sampled_from(["float64", "float32"]),
    batch=st.sampled_from([1, 3, 9]),
)
def test_backends_answer_alike_to_extreme_numbers(graph, seed, unrolled, precision, batch):
    rng = np.random.default_rng(seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_backend, "_MAX_UNROLLED", unrolled)
        patch.setattr(fusion, "_MANY_ROWS", 1)
        program = compile_circuit(graph, "numpy", precision, reproducible=True)
        for _ in range(OF_A_STRUCTURE):
            check(program, rng, batch)


def test_enough_of_the_cases_decide():
    """Of those above; passed over are most of those with many extreme numbers."""
    assert COUNTS["alike"] > 0.1 * sum(COUNTS.values())
    assert COUNTS["diverged"] > 0.1 * sum(COUNTS.values())
