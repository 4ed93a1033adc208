"""Neural circuits as data: compiled to fast vectorised updates, and run in closed loop with a robot.

Importing this package is light; every name below is imported when it is first used.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
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
    from circuitkit.draw import draw_activations, draw_circuit, draw_traces
    from circuitkit.engine import Program, State, Stepper, Trace, compile_circuit, run, step
    from circuitkit.simulation import Recording, Scenario, compare, load_scenario, simulate

__version__ = "0.1.0"

__all__ = [
    "CircuitGraph",
    "CircuitSpec",
    "Program",
    "Recording",
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
    "load_scenario",
    "parse_circuit",
    "run",
    "simulate",
    "step",
]

_ROOMS = {
    "circuit": "CircuitGraph CircuitSpec check circuit_schema load_circuit parse_circuit",
    "draw": "draw_activations draw_circuit draw_traces",
    "engine": "Program State Stepper Trace compile_circuit run step",
    "simulate": "Recording Scenario compare load_scenario simulate",
}
_ROOM_OF_NAME = {name: f"circuitkit.{room}" for room, names in _ROOMS.items() for name in names.split()}


def __getattr__(name: str) -> object:
    if name not in _ROOM_OF_NAME:
        message = f"module 'circuitkit' has no attribute '{name}'"
        raise AttributeError(message)
    return getattr(importlib.import_module(_ROOM_OF_NAME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_ROOM_OF_NAME})


class _CallableRoom(ModuleType):
    """A room that can be called like the function of the same name in it."""

    def __call__(self, *args: object, **kwargs: object) -> object:
        return getattr(self, self.__name__.rpartition(".")[2])(*args, **kwargs)


class _Package(ModuleType):
    """Makes `simulate` callable: it is a room and a function, and importing the room hides the function."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "simulate" and isinstance(value, ModuleType):
            value.__class__ = _CallableRoom
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
