"""Runs a plan with a controller by its name or without pushes, and finds the moment of a push."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from circuitkit.base.errors import SimulationError
from circuitkit.control import ControllerSpec
from circuitkit.simulation import Moment, Plan, Recording, Reference, RunSpec, Scenario
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.loop import run_loop
from circuitkit.study import CaseBuilder, Study
from circuitkit.study.spec import Settings


def record(plan: Plan, controller: str | ControllerSpec, specs: Sequence[RunSpec]) -> Recording:
    """Run the robots of a plan under one controller and record every tick.

    Args:
        plan: The scenario's plan.
        controller: As in a scenario, or the numbers of a controller file.
        specs: What is special to each robot.

    Raises:
        InputError: A name is unknown, or the controller does not fit the robot.
        SimulationError: A run is invalid: it can show nothing.
    """
    recording = run_loop(plan.setup(plan.controller(controller), specs))
    for spec, why in zip(recording.specs, recording.invalid, strict=True):
        if why is not None:
            message = f"the run of '{plan.scenario.scenario}' with seed {spec.seed} is invalid {why}"
            raise SimulationError(message)
    return recording


def without_pushes(plan: Plan, seed: int | None = None) -> RunSpec:
    """Describe a run with everything that befalls the scenario's robot, except its pushes.

    Args:
        plan: The scenario's plan.
        seed: Of noise and jitter; the scenario's by default.
    """
    scenario = plan.scenario
    kept = tuple(each for each in scenario.befalling if not isinstance(each, Push))
    return RunSpec(scenario.seed if seed is None else seed, kept)


def push_moment(scenario: Scenario, reference: Reference) -> Moment:
    """Find the moment at which the first push begins, without jitter.

    Args:
        scenario: The scenario.
        reference: Its reference.

    Raises:
        InputError: The reference has no such moment.
    """
    start = scenario.pushes[0].start
    if isinstance(start, Mapping):
        return reference.moment(start, scenario.duration)
    return reference.at(float(start))


def plan_of(study: Study, settings: Settings | None = None) -> Plan:
    """Plan the runs of a study's scenario.

    Args:
        study: The study.
        settings: Fields by path that differ from it, such as `{"push.force": "20 N"}`.

    Raises:
        InputError: Fields do not exist, or their values do not fit.
    """
    return CaseBuilder(study).case(settings).plan()
