"""The BiNN of 11 neurons: a call a step, many steps in a call, many robots, many different circuits.

Plain numpy leaves the order of additions to its matrix product. So may we here (`reproducible=False`), but
for the lines that say otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

import numpy as np

from benchmarks.plain import (
    AGAINST,
    INPUTS,
    PlainBinn,
    binn,
    compiled_binn,
    require_equal,
    steps_of,
    threads,
    varied,
)
from circuitkit.circuit.graph import Timing
from circuitkit.engine import compile_circuit, run
from circuitkit.study.bench import AnyCase, AnyWork, Case, Loop
from circuitkit.study.processes import environment

_STEPS = 2000
_SWEEP = 1000
# Of a batch, the limit of the compiled backend; that of numpy is never to be slower.
_BATCHES = {100: 0.12, 1_000: 0.25, 10_000: 0.30}
_LIMITS = {"numpy": 0.30, "compiled": 0.04}

Prepare = Callable[[], tuple[AnyWork, AnyWork]]


def cases() -> tuple[AnyCase, ...]:
    """All of them."""
    return (
        *(
            Case(f"{backend}: a call a step, {timing}", AGAINST, _one(backend, timing), limit)
            for backend, limit in _LIMITS.items()
            for timing in get_args(Timing)
        ),
        Case(
            "numpy: a call a step, bits as in a batch",
            AGAINST,
            _one("numpy", "ordered", reproducible=True),
        ),
        Case("auto: a call a step, without a C compiler", AGAINST, _without_compiler, 0.25),
        Case("compiled: inside run, recorded", AGAINST, _inside_run, 0.02, steps=_STEPS),
        *(
            Case(f"{backend}: a batch of {batch}", f"{AGAINST}, the batch", _batch(backend, batch), limit)
            for batch, of_compiled in _BATCHES.items()
            for backend, limit in (("numpy", 1.0), ("compiled", of_compiled))
        ),
        *(
            Case(
                f"{backend}: a batch of 1000, bits as alone",
                f"{AGAINST}, the batch",
                _batch(backend, 1000, reproducible=True),
            )
            for backend in _LIMITS
        ),
        *(
            Case(
                f"{backend}: a sweep of {_SWEEP}, per core", f"{AGAINST}, one by one", _sweep(backend), limit
            )
            for backend, limit in (("numpy", None), ("compiled", 1 / 40))
        ),
    )


def _one(backend: str, timing: Timing, *, reproducible: bool = False) -> Prepare:
    def prepare() -> tuple[AnyWork, AnyWork]:
        program = compiled_binn(backend, timing, reproducible=reproducible)
        return steps_of(program, 1), Loop(PlainBinn(binn()).steps)

    return prepare


def _without_compiler() -> tuple[AnyWork, AnyWork]:
    with environment(PATH="", CC=""):
        program = compiled_binn("auto")
    assert program.backend == "numpy", program.note
    return steps_of(program, 1), Loop(PlainBinn(binn()).steps)


def _inside_run() -> tuple[AnyWork, AnyWork]:
    program, plain = compiled_binn("compiled"), PlainBinn(binn())
    inputs = np.tile(INPUTS, (_STEPS, 1, 1))
    return lambda: run(program, inputs), lambda: plain.steps(_STEPS)


def _batch(backend: str, batch: int, *, reproducible: bool = False) -> Prepare:
    def prepare() -> tuple[AnyWork, AnyWork]:
        with threads(1):
            measured = steps_of(compiled_binn(backend, batch=batch, reproducible=reproducible), batch)
        return measured, Loop(PlainBinn(binn(), batch).steps)

    return prepare


def _sweep(backend: str) -> Prepare:
    def prepare() -> tuple[AnyWork, AnyWork]:
        graphs = [varied(number) for number in range(_SWEEP)]
        plain = [PlainBinn(graph) for graph in graphs]
        for number in (0, _SWEEP - 1):
            require_equal(compile_circuit(graphs[number], backend=backend), PlainBinn(graphs[number]), 1)
        with threads(1):
            measured = steps_of(compile_circuit(graphs, backend=backend), _SWEEP)

        def one_by_one(times: int) -> None:
            for _ in range(times):
                for one in plain:
                    one.steps(1)

        return measured, Loop(one_by_one)

    return prepare
