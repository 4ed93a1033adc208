"""Jobs: batches of runs that a worker steps together, and what comes back of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

import circuitkit
from circuitkit.base.errors import CircuitkitError, UnknownNameError
from circuitkit.simulation import Disturbance, Plan, RunSpec
from circuitkit.simulation.formulas import Value
from circuitkit.simulation.loop import run_and_watch
from circuitkit.simulation.plan import Body
from circuitkit.study.cases import Case
from circuitkit.study.spec import RMS

_KEPT_BODIES = 16  # robots with their motions that a worker keeps


@dataclass(frozen=True)
class Outcome:
    """What became of one run.

    Attributes:
        seed: Its seed.
        values: The scenario's measures, and `rms_COMMAND`, the root mean square of every command of the
            controller up to the end, [SI unit]; None for what has no value.
    """

    seed: int
    values: Mapping[str, Value]

    @property
    def survived(self) -> bool:
        """Whether the robot got through."""
        return self.holds("survived")

    def holds(self, measure: str) -> bool:
        """Whether a measure is true.

        Raises:
            UnknownNameError: There is no such measure; lists those there are.
            CircuitkitError: It is a number.
        """
        if measure not in self.values:
            kind = "measure"
            raise UnknownNameError(kind, measure, (name for name in self.values if not name.startswith(RMS)))
        value = self.values[measure]
        if value is not None and not isinstance(value, bool):
            message = f"found the measure '{measure}', which is a number; allowed: one that is true or false"
            raise CircuitkitError(message)
        return bool(value)

    def row(self) -> dict[str, Any]:
        """The outcome as columns."""
        return {"seed": self.seed, **self.values}


@dataclass(frozen=True)
class Job:
    """Runs of cases that share everything but what may differ in a batch.

    Attributes:
        case: One of the cases.
        specs: The runs.
    """

    case: Case
    specs: tuple[RunSpec, ...]


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
        outcomes: One for each run, or what keeps that run's case from being run.
        versions: Where it was done.
    """

    outcomes: tuple[Outcome | CircuitkitError, ...]
    versions: Mapping[str, str] = field(default_factory=versions)


def run_job(job: Job) -> Done:
    """Do a job with one thread.

    A run gets the same outcome, to the last bit, whatever the other runs of its job are.

    Raises:
        KeyboardInterrupt: Ctrl-C came; nothing is kept.
    """
    return Done(_outcomes(job.case, job.specs))


def _outcomes(case: Case, specs: tuple[RunSpec, ...]) -> tuple[Outcome | CircuitkitError, ...]:
    try:
        plan = plan_of(case)
        tracker = run_and_watch(plan.setup(plan.controller(case.controller), specs), threads=1)
    except CircuitkitError as error:
        kinds: list[tuple[Disturbance, ...]] = []
        for spec in specs:
            if spec.disturbances not in kinds:
                kinds.append(spec.disturbances)
        if len(kinds) == 1:
            return (error,) * len(specs)
        found: dict[int, Outcome | CircuitkitError] = {}  # whose fault is it?
        for disturbances in kinds:
            chosen = [i for i, spec in enumerate(specs) if spec.disturbances == disturbances]
            some = _outcomes(case, tuple(specs[i] for i in chosen))
            found |= dict(zip(chosen, some, strict=True))
        return tuple(found[i] for i in range(len(specs)))
    each = zip(specs, tracker.measures(), tracker.effort(), strict=True)
    return tuple(Outcome(spec.seed, {**measures, **_named(effort)}) for spec, measures, effort in each)


def _named(effort: Mapping[str, float]) -> dict[str, float]:
    return {f"{RMS}{name}": value for name, value in effort.items()}


def plan_of(case: Case) -> Plan:
    """The plan of a case; robots and their motions are made once, as long as they are in use."""
    return case.plan(_body(_Keyed(case.body_key, lambda: case.plan().body)))


@dataclass(frozen=True)
class _Keyed:
    """How to make something, and what it depends on."""

    key: str
    make: Callable[[], Body] = field(compare=False)


@lru_cache(maxsize=_KEPT_BODIES)
def _body(wanted: _Keyed) -> Body:
    return wanted.make()
