"""The closed loop: scenarios, disturbances, recordings, verdicts, pictures and films."""

from circuitkit.simulation.recording import Recording
from circuitkit.simulation.run import CONTROLLERS, Plan, Result, compare, make_plan, simulate
from circuitkit.simulation.scenario import Push, Scenario, load_scenario, parse_push
from circuitkit.biped.thresholds import Verdict, judge, threshold_lines

__all__ = [
    "CONTROLLERS",
    "Plan",
    "Push",
    "Recording",
    "Result",
    "Scenario",
    "Verdict",
    "compare",
    "judge",
    "load_scenario",
    "make_plan",
    "parse_push",
    "simulate",
    "threshold_lines",
]
