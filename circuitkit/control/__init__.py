"""Controllers: the protocol, neural circuits, no feedback, and files of other kinds."""

from circuitkit.control.circuit import BoundCircuit, CircuitController
from circuitkit.control.controller import (
    Array,
    Controller,
    Interface,
    OpenLoop,
    PlannedChannel,
    checked_step,
    require_controller,
    require_instance,
)
from circuitkit.control.spec import ControllerSpec, load_controller, shipped_controllers

__all__ = [
    "Array",
    "BoundCircuit",
    "CircuitController",
    "Controller",
    "ControllerSpec",
    "Interface",
    "OpenLoop",
    "PlannedChannel",
    "checked_step",
    "load_controller",
    "require_controller",
    "require_instance",
    "shipped_controllers",
]
