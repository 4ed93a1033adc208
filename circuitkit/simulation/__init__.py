"""The closed loop: scenarios, references, disturbances, measures, recordings, plots and films."""

from circuitkit.simulation.disturbance import Disturbance, RunSpec
from circuitkit.simulation.plan import Plan, make_plan
from circuitkit.simulation.recording import Recording
from circuitkit.simulation.reference import Moment, Motion, Reference
from circuitkit.simulation.result import Result
from circuitkit.simulation.run import compare, simulate
from circuitkit.simulation.scenario import Scenario, load_scenario, parse_push

__all__ = [
    "Disturbance",
    "Moment",
    "Motion",
    "Plan",
    "Recording",
    "Reference",
    "Result",
    "RunSpec",
    "Scenario",
    "compare",
    "load_scenario",
    "make_plan",
    "parse_push",
    "simulate",
]
