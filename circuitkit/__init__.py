"""Neural circuits as data: compiled to fast vectorised updates, and run in closed loop with a robot.

Importing this package is light; every name below is imported when it is first used.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from circuitkit.circuit import (
        CircuitGraph,
        CircuitSpec,
        check,
        circuit_schema,
        load_circuit,
        parse_circuit,
    )
    from circuitkit.control import CircuitController
    from circuitkit.draw import draw_activations, draw_circuit, draw_traces
    from circuitkit.engine import Program, State, Stepper, Trace, compile_circuit, run, step
    from circuitkit.robots import Robot, load_robot
    from circuitkit.simulation import Recording, Scenario, compare, load_scenario, simulate

__version__ = "0.1.0"

__all__ = [
    "CircuitController",
    "CircuitGraph",
    "CircuitSpec",
    "Program",
    "Recording",
    "Robot",
    "Scenario",
    "State",
    "Stepper",
    "Trace",
    "__version__",
    "check",
    "circuit_schema",
    "compare",
    "compile_circuit",
    "draw_activations",
    "draw_circuit",
    "draw_traces",
    "load_circuit",
    "load_robot",
    "load_scenario",
    "parse_circuit",
    "run",
    "simulate",
    "step",
]

_NAMES = {
    "circuit": "CircuitGraph CircuitSpec check circuit_schema load_circuit parse_circuit",
    "control": "CircuitController",
    "draw": "draw_activations draw_circuit draw_traces",
    "engine": "Program State Stepper Trace compile_circuit run step",
    "robots": "Robot load_robot",
    "simulation": "Recording Scenario compare load_scenario simulate",
}
_PACKAGE_OF = {name: f"{__name__}.{package}" for package, names in _NAMES.items() for name in names.split()}

if os.environ.get("MUJOCO_GL"):
    from circuitkit.base.graphics import import_mujoco

    import_mujoco()


def __getattr__(name: str) -> object:
    if name not in _PACKAGE_OF:
        message = f"module 'circuitkit' has no attribute '{name}'"
        raise AttributeError(message)
    return getattr(importlib.import_module(_PACKAGE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_PACKAGE_OF})
