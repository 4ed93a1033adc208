"""Times a step of the network and a solve of the MPC on one core of this machine.

Times are the processor's time of this process, not the clock's: what else the machine does counts less.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle, islice

import numpy as np
from numpy.typing import NDArray

from circuitkit.biped.control.jerk_mpc import JerkMpc
from circuitkit.biped.control.reference import WalkReference
from circuitkit.biped.control.wieber_mpc import WieberMpcSpec
from circuitkit.circuit import load_circuit
from circuitkit.control import Controller, load_controller
from circuitkit.engine import Stepper, compile_circuit
from circuitkit.simulation import Plan
from circuitkit.simulation.loop import run_loop

Array = NDArray[np.float64]

_ROWS = 1000  # different inputs, over and over
_WARM = 2000  # steps before the clock starts
_PUSHED_M, _PUSHED_M_S = 0.015, 0.1  # spread of what pushes do to the pendulum's state


@dataclass(frozen=True)
class Times:
    """Mean times of a step in several runs.

    Attributes:
        steps: In each run.
        means_s: Mean time of a step, for each run.
    """

    steps: int
    means_s: tuple[float, ...]

    @property
    def mean_s(self) -> float:
        """Mean over the runs."""
        return statistics.fmean(self.means_s)

    @property
    def variation(self) -> float:
        """Coefficient of variation of the runs: standard deviation over mean; not a number for one run."""
        return statistics.stdev(self.means_s) / self.mean_s if len(self.means_s) > 1 else math.nan


def time_in_turns(works: Mapping[str, tuple[Callable[[int], object], int]], runs: int) -> dict[str, Times]:
    """Time several pieces of work, which take turns, so that what else the machine does hits all of them.

    Args:
        works: For each name a function that does the number of steps that it gets, and how many those are.
        runs: How often each is timed.
    """
    for work, steps in works.values():
        work(min(_WARM, steps))
    means: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(runs):
        for name, (work, steps) in works.items():
            begin = time.process_time()
            work(steps)
            means[name].append((time.process_time() - begin) / steps)
    return {name: Times(works[name][1], tuple(found)) for name, found in means.items()}


def network_steps(circuit: str, backend: str) -> Callable[[int], object]:
    """Prepare steps of a circuit, each a call from Python that hands over other inputs.

    Args:
        circuit: Name of the circuit, with the inputs `force_difference` and `zmp_y`.
        backend: `numpy` or `compiled`.

    Raises:
        CircuitkitError: This backend does not work here.
    """
    program = compile_circuit(load_circuit(circuit), backend)
    stepper = Stepper(program, 1)
    rng = np.random.default_rng(0)
    walk = np.sin(np.linspace(0.0, 40 * math.pi, _ROWS))
    table = {
        "force_difference": np.clip(3.0 * walk, -1.0, 1.0),
        "zmp_y": 0.06 * walk + rng.normal(0.0, 0.01, _ROWS),
    }
    rows = np.stack([table[name] for name in program.input_names], axis=-1)[:, None, :]

    def steps(count: int) -> None:
        step = stepper.step
        for row in islice(cycle(rows), count):
            step(row)

    return steps


def mpc_solves(controller: str, plan: Plan) -> Callable[[int], object]:
    """Prepare solves of the MPC's quadratic program along a walk, from states that pushes have moved.

    Args:
        controller: Name of a controller file of the kind `wieber_mpc`.
        plan: The scenario's plan.

    Raises:
        TypeError: The file is of another kind.
        MissingDependencyError: The solver is not installed.
    """
    spec = load_controller(controller)
    if not isinstance(spec, WieberMpcSpec):
        message = f"{controller} is no wieber_mpc"
        raise TypeError(message)
    reference: WalkReference = plan.body.motion.knowledge
    mpc = JerkMpc(reference.com_height_m, spec.preview_step, spec.preview_steps, spec.zmp_weight, spec.solver)
    rng = np.random.default_rng(0)
    stride = round(spec.preview_step / reference.step_s)
    ahead = stride * np.arange(1, spec.preview_steps + 1)
    problems = []
    for tick in rng.integers(0, len(reference.zmp_m) - ahead[-1], _ROWS):
        moved = rng.normal(0.0, 1.0, 2) * (_PUSHED_M, _PUSHED_M_S)
        columns = (reference.com_m, reference.com_velocity, reference.com_acceleration)
        state = np.array([values[tick, 1] for values in columns])
        state[:2] += moved
        rows = tick + ahead
        low, high = reference.low_m[rows, 1] + spec.margin, reference.high_m[rows, 1] - spec.margin
        problems.append((state, reference.zmp_m[rows, 1], low, high))

    def solves(count: int) -> None:
        for problem in islice(cycle(problems), count):
            mpc.solve_all(*problem)

    return solves


@dataclass
class TimedController:
    """A controller whose steps are timed.

    Attributes:
        inner: The controller.
        durations_s: Of its steps so far.
    """

    inner: Controller
    durations_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Take over names of the controller."""
        self.name = self.inner.name
        self.observations, self.commands = self.inner.observations, self.inner.commands

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self.inner.reset(batch)

    def step(self, observation: Array) -> Array:
        """Time the step; commands of this control step."""
        begin = time.process_time()
        command = self.inner.step(observation)
        self.durations_s.append(time.process_time() - begin)
        return command


def time_in_the_loop(plan: Plan, controllers: Sequence[str], seeds: Sequence[int]) -> dict[str, Times]:
    """Time a controller's step while it holds the pushed robot, one run a seed.

    Args:
        plan: The scenario's plan.
        controllers: Names.
        seeds: Of noise and jitter.
    """
    found = {}
    for name in controllers:
        means, steps = [], 0
        for seed in seeds:
            timed = TimedController(plan.controller(name))
            run_loop(plan.setup(timed, [plan.own_spec(seed)]), threads=1)
            means.append(statistics.fmean(timed.durations_s))
            steps = max(steps, len(timed.durations_s))
        found[name] = Times(steps, tuple(means))
    return found
