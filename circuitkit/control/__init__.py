"""Controllers: a neural circuit, and the baselines that it is measured against."""

from circuitkit.control.circuit import CircuitController
from circuitkit.control.controller import Controller
from circuitkit.control.open_loop import OpenLoop
from circuitkit.biped.control.planned import PlannedChannel, planned_channels
from circuitkit.biped.control.reference import Body, Footstep, WalkReference, walk_reference
from circuitkit.control.spec import ControllerSpec, load_controller, shipped_controllers

__all__ = [
    "Body",
    "CircuitController",
    "Controller",
    "ControllerSpec",
    "Footstep",
    "OpenLoop",
    "PlannedChannel",
    "WalkReference",
    "load_controller",
    "planned_channels",
    "shipped_controllers",
    "walk_reference",
]
