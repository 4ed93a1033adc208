"""Controllers: a neural circuit, and the baselines that it is measured against."""

from circuitkit.control.circuit import CircuitController
from circuitkit.control.controller import Controller
from circuitkit.control.open_loop import OpenLoop

__all__ = ["CircuitController", "Controller", "OpenLoop"]
