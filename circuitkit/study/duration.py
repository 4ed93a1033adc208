"""How long the runs of a case last, and whether what befalls the robot begins before the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.simulation import Reference, Scenario
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.scenario import LONGEST_S

WATCH = "watch"  # the key of a study
_HORIZONS_S = (60.0, 600.0, LONGEST_S)  # in which moments of the reference are looked for, the cheapest first


def watched(scenario: Scenario, reference: Reference, step_s: float, watch_s: float) -> Scenario:
    """The scenario that ends so long after the end of its last push; as it is without a push.

    Args:
        scenario: The scenario.
        reference: Its reference.
        step_s: The control step.
        watch_s: How long.

    Raises:
        InputError: A push starts at no moment of the reference, or the run would last too long.
    """
    if not scenario.pushes:
        return scenario
    ticks = int(np.ceil(round((max(_ends_s(scenario, reference)) + watch_s) / step_s, 6)))
    duration = round(ticks * step_s, 9)
    if duration > LONGEST_S:
        message = f"found {watch_s:g} s, so that a run lasts {duration:g} s; allowed: {LONGEST_S:g} s in all"
        raise InputError(Problem("", 0, 0, WATCH, message))
    for each in scenario.befalling:
        if isinstance(each, Fault) and isinstance(each.start, float) and each.start >= duration:
            message = f"the fault of {each.channel} starts after the end; allowed: before {duration:g} s"
            raise InputError(Problem("", 0, 0, WATCH, message))
    return scenario.model_copy(update={"duration": duration})


def require_moments(scenario: Scenario, reference: Reference) -> None:
    """See whether everything that starts at a moment of the reference does so before the end.

    Raises:
        InputError: There is no such moment.
    """
    for k, each in enumerate(scenario.befalling):
        if isinstance(start := getattr(each, "start", None), Mapping):
            _start_s(reference, start, f"disturbances[{k}].{each.kind}", (scenario.duration,))


def _ends_s(scenario: Scenario, reference: Reference) -> Iterator[float]:
    """When each push ends, [s]."""
    for k, each in enumerate(scenario.befalling):
        if isinstance(each, Push):
            start = _start_s(reference, each.start, f"disturbances[{k}].{each.kind}", _HORIZONS_S)
            yield start + each.duration


def _start_s(reference: Reference, start: Any, where: str, horizons_s: Sequence[float]) -> float:  # noqa: ANN401 - as files have it
    """When a disturbance starts, [s]: at a time, or at a moment of the reference.

    Args:
        reference: Knows moments.
        start: The time, or the words of the moment.
        where: The disturbance, for complaints.
        horizons_s: Ends of the runs in which it is looked for, one after the other.

    Raises:
        InputError: There is no such moment.
    """
    if not isinstance(start, Mapping):
        return float(start)
    for horizon_s in horizons_s:
        try:
            return reference.moment(start, horizon_s).time_s
        except InputError as error:
            problems = error.problems
    raise InputError(*(replace(each, where=f"{where}.{each.where}") for each in problems))
