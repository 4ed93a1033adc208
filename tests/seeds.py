"""Runs of a scenario with many seeds, stepped together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from circuitkit.simulation import Recording, RunSpec, Scenario, load_scenario, make_plan
from circuitkit.simulation.disturbance import Disturbance
from circuitkit.simulation.loop import run_loop


def changed(name: str, disturbances: Iterable[Disturbance] | None = None, **fields: Any) -> Scenario:
    """A shipped scenario with other disturbances or fields; what begins after a shorter run is left out."""
    loaded = load_scenario(name)
    if "duration" in fields:
        every = loaded.befalling if disturbances is None else disturbances
        disturbances = [
            each for each in every if not isinstance(each.begins, float) or each.begins < fields["duration"]
        ]
    if disturbances is not None:
        item = type(loaded.disturbances[0])
        fields["disturbances"] = tuple(item(**{each.kind: each}) for each in disturbances)
    return loaded.model_copy(update=fields)


def disturbances_of(name: str) -> tuple[Disturbance, ...]:
    """What befalls the robot in a shipped scenario."""
    return load_scenario(name).befalling


def run_seeds(
    scenario: Scenario | str, seeds: Iterable[int] = range(20), controller: Any = None,
    settings: Mapping[str, str] | None = None,
) -> Recording:  # fmt: skip
    """The runs of these seeds."""
    plan = make_plan(load_scenario(scenario) if isinstance(scenario, str) else scenario, None, settings)
    specs = [RunSpec(seed, plan.scenario.befalling) for seed in seeds]
    return run_loop(plan.setup(plan.controller(controller), specs))


def measured(recording: Recording, name: str) -> np.ndarray:
    """A measure of all runs."""
    return np.array([measures[name] for measures in recording.measures])
