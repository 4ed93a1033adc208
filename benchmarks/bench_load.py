"""How long it takes from a file to a program that can step."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.script import number_of, scratch
from circuitkit.circuit import load_circuit
from circuitkit.engine import compile_circuit
from circuitkit.study.bench import Amount, AnyCase

_FIRST_STEP = """
import sys, time
from circuitkit.circuit import load_circuit
from circuitkit.engine import Stepper, compile_circuit
graph = load_circuit(sys.argv[1])
Stepper(compile_circuit(graph, backend="numpy"), 1).step()
begin = time.perf_counter()
Stepper(compile_circuit(graph, backend="compiled"), 1).step()
print(time.perf_counter() - begin)
"""
_IMPORT = "import time; t = time.perf_counter(); import circuitkit; print(time.perf_counter() - t)"
_HEAD = """circuit: lines
control_step: 10 ms
timing: ordered
inputs:
  u: {unit: "1", range: [0, 1]}
neurons:
"""
_WIDTH = 100  # neurons of a layer
# Neurons, as many synapses, and the limit, [s].
_SIZES = {1_000: 0.1, 20_000: 3.0}


def cases() -> tuple[AnyCase, ...]:
    """Loading, checking and compiling; building; importing."""
    return (
        Amount("load, check and compile: the BiNN", "s", _binn, 0.020),
        *(
            Amount(f"load, check and compile: {n} + {n} lines of YAML", "s", _lines(n), limit)
            for n, limit in _SIZES.items()
        ),
        Amount("compiled: the BiNN, first build without a cache", "s", lambda: _built("binn_lateral"), 3.0),
        Amount("compiled: the BiNN, from the cache", "s", lambda: _built("binn_lateral", cached=True), 0.1),
        *(
            Amount(
                f"compiled: {n} + {n} lines, first build without a cache",
                "s",
                lambda n=n: _built(_file(n)),
                3.0,
            )
            for n in _SIZES
        ),
        Amount("import circuitkit", "s", lambda: lambda: number_of(_IMPORT), 0.150),
    )


def _seconds_of(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def _binn() -> Callable[[], float]:
    return _compiled("binn_lateral")


def _lines(n: int) -> Callable[[], Callable[[], float]]:
    return lambda: _compiled(_file(n))


def _compiled(circuit: str | Path) -> Callable[[], float]:
    def work() -> object:
        return compile_circuit(load_circuit(circuit))

    work()  # builds what `auto` may have to build, and imports what is imported late
    return lambda: _seconds_of(work)


def _file(n: int) -> Path:
    """A file of n neurons in layers and n synapses, every one with numbers of its own."""
    neurons = (
        f"  n{i}: {{model: sigmoid, role: excitatory, slope: {1 + i % 97}, shift: 0.{i % 89}}}\n"
        for i in range(n)
    )
    sources = ["u"] * _WIDTH + [f"n{i}" for i in range(n - _WIDTH)]
    synapses = (f"  - {{from: {source}, to: n{i}, weight: 1.{i % 83}}}\n" for i, source in enumerate(sources))
    readout = ", ".join(f"n{i}: 1" for i in range(n - _WIDTH, n))
    outputs = f'outputs:\n  y: {{unit: "1", readout: {{{readout}}}}}\n'
    path = scratch() / "lines.yaml"
    path.write_text("".join((_HEAD, *neurons, "synapses:\n", *synapses, outputs)), encoding="utf-8")
    return path


def _built(circuit: str | Path, *, cached: bool = False) -> Callable[[], float]:
    """The first step in a process of its own, with a cache of its own."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            if cached:
                number_of(_FIRST_STEP, str(circuit), CIRCUITKIT_CACHE=folder)
            return number_of(_FIRST_STEP, str(circuit), CIRCUITKIT_CACHE=folder)

    return once
