"""Neural circuits as data: compiled to fast vectorised updates, and run in closed loop with a robot.

Importing this package is light; every name below is imported when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from circuitkit.circuit.graph import CircuitGraph

_HOME_OF_NAME = {
    "CircuitGraph": "circuitkit.circuit.graph",
}

__all__ = ["CircuitGraph", "__version__"]


def __getattr__(name: str) -> object:
    if name not in _HOME_OF_NAME:
        message = f"module 'circuitkit' has no attribute '{name}'"
        raise AttributeError(message)
    return getattr(importlib.import_module(_HOME_OF_NAME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME_OF_NAME])
