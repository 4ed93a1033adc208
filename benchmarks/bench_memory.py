"""A million neurons and ten million synapses: memory and time from the file to the first step."""

from __future__ import annotations

import functools
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from circuitkit.study.bench import Amount, AnyCase

_NEURONS, _IN_DEGREE = 1_000_000, 10
_CIRCUIT = f"""
circuit: large
control_step: 10 ms
timing: synchronous
seed: 1
inputs:
  u: {{unit: "1", range: [0, 1]}}
populations:
  cells: {{size: {_NEURONS}, model: sigmoid, role: excitatory, slope: 4, shift: 0.5}}
projections:
  - {{from: cells, to: cells, connect: CONNECT, weight: WEIGHT}}
synapses:
  - {{from: u, to: "cells[0]", weight: 1}}
outputs:
  y: {{unit: "1", readout: {{"cells[0]": 1}}}}
"""
# Prints seconds from the file to the compiled circuit, and growth of the peak over that of a small circuit.
_SCRIPT = """
import resource, sys, time
from circuitkit.circuit import load_circuit
from circuitkit.engine import Stepper, compile_circuit

def peak():
    if sys.platform == "linux":  # where ru_maxrss begins with what the process had that started this one
        (line,) = (line for line in open("/proc/self/status") if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)

Stepper(compile_circuit(load_circuit("binn_lateral"), backend="compiled"), 1).step()
before = peak()
begin = time.perf_counter()
program = compile_circuit(load_circuit(sys.argv[1]), backend=sys.argv[2])
seconds = time.perf_counter() - begin
Stepper(program, 1).step()
print(seconds, peak() - before)
"""
_MATRIX = """
import sys
import numpy, scipy.sparse
n, degree = int(sys.argv[2]), int(sys.argv[3])
sources = numpy.random.default_rng(0).integers(0, n, (n, degree), dtype=numpy.int32)
sources.sort(axis=1)
pointers = numpy.arange(0, n * degree + 1, degree)
weights = numpy.random.default_rng(1).uniform(0.05, 0.15, n * degree)
matrix = scipy.sparse.csr_array((weights, sources.ravel(), pointers), shape=(n, n))
matrix.sum_duplicates()
scipy.sparse.save_npz(sys.argv[1], matrix, compressed=False)
"""
# Connections and weights: one weight for all, or one for each.
_RULES = {"by rule": (f"{{in_degree: {_IN_DEGREE}}}", "0.1"), "from NPZ": ("{matrix: w.npz}", "1")}


def cases() -> tuple[AnyCase, ...]:
    """By rule and from a file, with each backend."""
    what = "1e7 synapses"
    return tuple(
        case
        for how in _RULES
        for backend in ("numpy", "compiled")
        for case in (
            Amount(f"{backend}: memory, {what} {how}", "bytes a synapse", _part(how, backend, 1), 20.0),
            Amount(f"{backend}: load and compile, {what} {how}", "s", _part(how, backend, 0), 20.0),
        )
    )


def _part(how: str, backend: str, part: int) -> Callable[[], Callable[[], float]]:
    return lambda: lambda: _measured(how, backend)[part]


@functools.cache
def _measured(how: str, backend: str) -> tuple[float, float]:
    """Seconds, and bytes a synapse; measured once, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.yaml"
        connect, weight = _RULES[how]
        text = _CIRCUIT.replace("CONNECT", connect).replace("WEIGHT", weight)
        path.write_text(text, encoding="utf-8")
        if how == "from NPZ":
            matrix = [
                sys.executable,
                "-c",
                _MATRIX,
                str(path.with_name("w.npz")),
                str(_NEURONS),
                str(_IN_DEGREE),
            ]
            subprocess.run(matrix, check=True)
        script = [sys.executable, "-c", _SCRIPT, str(path), backend]
        done = subprocess.run(script, check=True, stdout=subprocess.PIPE, text=True)
    seconds, size = map(float, done.stdout.split())
    return seconds, size / (_NEURONS * _IN_DEGREE)
