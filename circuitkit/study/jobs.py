"""Jobs: batches of runs that a worker steps together, and what comes back of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

import circuitkit
from circuitkit.base.errors import CircuitkitError
from circuitkit.simulation import Plan, Push
from circuitkit.simulation.disturbance import Trial
from circuitkit.simulation.run import PreparedWalk, prepare_walk
from circuitkit.biped.thresholds import Judged, run_and_judge
from circuitkit.study.points import Point

_KEPT_WALKS = 16  # robots with their walks that a worker keeps


@dataclass(frozen=True)
class Outcome:
    """What became of one run.

    Attributes:
        seed: Its seed.
        survived: Whether the robot stood at the end.
        time_of_fall_s: When it fell; None if it did not.
        max_zmp_excursion_m: How far the ZMP was outside the thresholds after the push began, at most.
        recovery_time_s: From the first time outside to being back inside; None if never out or never back.
        rms: Root mean square of every command of the controller up to the fall or the end, [SI unit].
    """

    seed: int
    survived: bool
    time_of_fall_s: float | None
    max_zmp_excursion_m: float
    recovery_time_s: float | None
    rms: Mapping[str, float] = field(default_factory=dict)

    def row(self) -> dict[str, Any]:
        """The outcome as columns: those above, and `rms_COMMAND` for every command."""
        columns = {
            "seed": self.seed,
            "survived": self.survived,
            "time_of_fall_s": self.time_of_fall_s,
            "max_zmp_excursion_m": self.max_zmp_excursion_m,
            "recovery_time_s": self.recovery_time_s,
        }
        return columns | {f"rms_{name}": value for name, value in self.rms.items()}


@dataclass(frozen=True)
class Job:
    """Runs of points that share everything but their pushes.

    Attributes:
        number: Tells it from others.
        point: One of the points.
        trials: The runs.
    """

    number: int
    point: Point
    trials: tuple[Trial, ...]


def versions() -> dict[str, str]:
    """The packages on which the bits of a run depend, with their versions."""
    return {
        "circuitkit": circuitkit.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
    }


@dataclass(frozen=True)
class Done:
    """A job that is done.

    Attributes:
        number: The job's.
        outcomes: One for each trial, or what keeps that trial's point from being run.
        versions: Where it was done.
    """

    number: int
    outcomes: tuple[Outcome | CircuitkitError, ...]
    versions: Mapping[str, str] = field(default_factory=versions)


def run_job(job: Job) -> Done:
    """Do a job with one thread.

    A trial gets the same outcome, to the last bit, whatever the other trials of its job are.

    Raises:
        KeyboardInterrupt: Ctrl-C came; nothing is kept.
    """
    return Done(job.number, _outcomes(job.point, job.trials))


def _outcomes(point: Point, trials: tuple[Trial, ...]) -> tuple[Outcome | CircuitkitError, ...]:
    try:
        plan = plan_of(point)
        setup = plan.setup(point.controller, trials)
        judged = run_and_judge(setup, plan.scenario.thresholds, threads=1)
    except CircuitkitError as error:
        by_pushes: dict[tuple[Push, ...], None] = dict.fromkeys(trial.pushes for trial in trials)
        if len(by_pushes) == 1:
            return (error,) * len(trials)
        found: dict[Trial, Outcome | CircuitkitError] = {}  # whose fault is it?
        for pushes in by_pushes:
            some = tuple(trial for trial in trials if trial.pushes == pushes)
            found |= dict(zip(some, _outcomes(point, some), strict=True))
        return tuple(found[trial] for trial in trials)
    return tuple(_outcome(trial.seed, each) for trial, each in zip(trials, judged, strict=True))


def _outcome(seed: int, judged: Judged) -> Outcome:
    verdict = judged.verdict
    return Outcome(
        seed=seed,
        survived=verdict.survived,
        time_of_fall_s=None if verdict.time_of_fall_s is None else float(verdict.time_of_fall_s),
        max_zmp_excursion_m=float(verdict.max_zmp_excursion_m),
        recovery_time_s=None if verdict.recovery_time_s is None else float(verdict.recovery_time_s),
        rms={name: float(value) for name, value in judged.rms.items()},
    )


def plan_of(point: Point) -> Plan:
    """The plan of a point; robots and walks are made once, as long as they are in use."""
    scenario = point.scenario
    used = scenario.model_dump(mode="json", include={"servo_profile", "plant", "duration"})
    robot = tuple(said for name, said in point.inputs.items() if name.startswith("robot "))
    body = _prepared(_Keyed((robot, str(used), point.gait), lambda: prepare_walk(scenario, point.gait)))
    return Plan(
        scenario, body.robot, body.walk, body.targets, point.circuit, point.yardstick, plant=body.plant
    )


@dataclass(frozen=True)
class _Keyed:
    """How to make something, and what it depends on."""

    key: Hashable
    make: Callable[[], PreparedWalk] = field(compare=False)


@lru_cache(maxsize=_KEPT_WALKS)
def _prepared(wanted: _Keyed) -> PreparedWalk:
    return wanted.make()
