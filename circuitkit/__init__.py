"""Neural circuits as data: compiled to fast vectorised updates, and run in closed loop with a robot.

Importing this package is light; every name below is imported when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from circuitkit.circuit import (
        CircuitGraph,
        CircuitSpec,
        check,
        circuit_schema,
        load_circuit,
        parse_circuit,
        resolve,
    )
    from circuitkit.engine import Program, State, Trace, compile_circuit, run, step

__version__ = "0.1.0"

_HOME = {
    "CircuitGraph": "circuitkit.circuit",
    "CircuitSpec": "circuitkit.circuit",
    "check": "circuitkit.circuit",
    "circuit_schema": "circuitkit.circuit",
    "load_circuit": "circuitkit.circuit",
    "parse_circuit": "circuitkit.circuit",
    "resolve": "circuitkit.circuit",
    "Program": "circuitkit.engine",
    "State": "circuitkit.engine",
    "Trace": "circuitkit.engine",
    "compile_circuit": "circuitkit.engine",
    "run": "circuitkit.engine",
    "step": "circuitkit.engine",
}

__all__ = [
    "CircuitGraph",
    "CircuitSpec",
    "Program",
    "State",
    "Trace",
    "__version__",
    "check",
    "circuit_schema",
    "compile_circuit",
    "load_circuit",
    "parse_circuit",
    "resolve",
    "run",
    "step",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        message = f"module 'circuitkit' has no attribute '{name}'"
        raise AttributeError(message)
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
