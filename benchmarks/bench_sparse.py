"""Sparse random circuits of sigmoid neurons, ten synapses each, against scipy's compressed sparse rows.

By hand it is the same as for the BiNN, with W a `csr_array`: scipy's product runs on one core.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse

from benchmarks.plain import loop, threads
from circuitkit.circuit import parse_circuit
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine import Program, Stepper, compile_circuit
from circuitkit.study.bench import AnyCase, AnyWork, Case, Loop

AGAINST = "scipy CSR"
SLOPE, SHIFT = 4.0, 0.5
# Neurons, and the limit of the compiled backend on one core; no backend may be slower than scipy.
_SIZES = {1_000: 0.4, 10_000: 0.7, 100_000: 0.85}
_SECOND_THREAD = 1 / 1.6
_CIRCUIT = """
circuit: sparse
control_step: 1 ms
timing: synchronous
seed: 3
inputs:
  u: {unit: "1", range: [0, 1]}
populations:
  cells: {size: %d, model: sigmoid, role: excitatory, slope: %g, shift: %g}
projections:
  - {from: cells, to: cells, connect: {in_degree: 10}, weight: {uniform: [0.05, 0.15]}}
synapses:
  - {from: u, to: "cells[0]", weight: 1}
outputs:
  y: {unit: "1", readout: {"cells[0]": 1}}
"""


def cases() -> tuple[AnyCase, ...]:
    """One core against scipy, and two against one."""
    largest = max(_SIZES)
    return (
        *(
            Case(f"{backend}: sparse, {size} neurons", AGAINST, _sparse(backend, size), limit)
            for size, of_compiled in _SIZES.items()
            for backend, limit in (("numpy", 1.0), ("compiled", of_compiled))
        ),
        Case(
            f"compiled: sparse, {largest} neurons, a second core",
            "the same on one core",
            lambda: _two_cores(largest),
            _SECOND_THREAD,
        ),
    )


def sparse_circuit(size: int) -> CircuitGraph:
    """A random circuit of so many neurons; one of them sees the input."""
    return parse_circuit(_CIRCUIT % (size, SLOPE, SHIFT))


def by_hand(graph: CircuitGraph) -> tuple[Callable[[], None], np.ndarray]:
    """A step in scipy with the input at zero, and the outputs it leaves."""
    (projection,) = graph.projections
    n = len(projection.indptr) - 1
    csr = (projection.weights, projection.sources, projection.indptr.astype(np.int32))
    weights = scipy.sparse.csr_array(csr, shape=(n, n))
    outputs = np.zeros(n)

    def step() -> None:
        outputs[...] = 1 / (1 + np.exp(-SLOPE * (weights @ outputs - SHIFT)))

    return step, outputs


def checked(graph: CircuitGraph, backend: str, cores: int) -> Program:
    """The program, after its first steps were compared with those by hand."""
    program = compile_circuit(graph, backend=backend, reproducible=False)
    step, outputs = by_hand(graph)
    with threads(cores):
        stepper = Stepper(program, 1)
    for _ in range(3):
        stepper.step(np.zeros((1, 1)))
        step()
    np.testing.assert_allclose(stepper.state.output[0], outputs, rtol=0, atol=1e-12)
    return program


def steps(program: Program, cores: int) -> Loop:
    """Steps of a program, each a call from Python."""
    with threads(cores):
        stepper = Stepper(program, 1)
    inputs = np.zeros((1, 1))
    return loop(lambda: stepper.step(inputs))


def _sparse(backend: str, size: int) -> Callable[[], tuple[AnyWork, AnyWork]]:
    def prepare() -> tuple[AnyWork, AnyWork]:
        graph = sparse_circuit(size)
        return steps(checked(graph, backend, 1), 1), loop(by_hand(graph)[0])

    return prepare


def _two_cores(size: int) -> tuple[AnyWork, AnyWork]:
    program = checked(sparse_circuit(size), "compiled", 2)
    return steps(program, 2), steps(program, 1)
