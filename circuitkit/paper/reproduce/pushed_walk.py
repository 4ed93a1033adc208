"""Records the pushed walk of the paper's first simulation study, and measures what becomes of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from circuitkit.biped.anatomy import BipedSpec
from circuitkit.biped.gait.lipm import natural_frequency
from circuitkit.biped.sensing import SETTLED_S, BipedView, support_edges_m
from circuitkit.biped.thresholds import ThresholdMeasure
from circuitkit.paper.runs import push_moment, record
from circuitkit.simulation import Recording, RunSpec, Scenario, load_scenario, make_plan
from circuitkit.simulation.disturbances.jitter import Jitter

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SCENARIO = "nao_push"
SEEDS, QUICK_SEEDS = range(20), range(5)
NEAR_M = 0.005  # to its limit cycle
WATCHED_S = 6.0  # after the end of the push


@dataclass(frozen=True)
class PushedWalk:
    """Robots that walk and are pushed, one for each seed.

    Attributes:
        scenario: What was run.
        recording: Every tick of all of them.
        survived: Which stood at the end; shape (B,).
    """

    scenario: Scenario
    recording: Recording
    survived: Flags

    @cached_property
    def view(self) -> BipedView:
        """The recording as a biped's."""
        return BipedView(self.recording)

    @cached_property
    def thresholds(self) -> ThresholdMeasure:
        """The scenario's thresholds of the ZMP."""
        return next(each for each in self.recording.judge.kinds if isinstance(each, ThresholdMeasure))

    def push_s(self, robot: int) -> tuple[float, float]:
        """Say when the push on a robot began and ended, [s]."""
        start, end = self.recording.effects.windows_s[robot]
        return float(start), float(end)

    def end_tick(self, robot: int) -> int:
        """Count the ticks until a robot fell, or all."""
        last = int(self.recording.end_tick[robot])
        return self.recording.ticks if last < 0 else last + 1

    @property
    def step_s(self) -> float:
        """The control step."""
        return self.recording.step_s

    @property
    def pace_ticks(self) -> int:
        """Ticks of a step of the walk."""
        return round(self.recording.motion.pace_s / self.step_s)


def record_pushed_walk(controller: str, seeds: Sequence[int]) -> PushedWalk:
    """Run the scenario of section 5.2 for several seeds, until six seconds after the push.

    Args:
        controller: As in a scenario.
        seeds: Of noise and jitter.

    Raises:
        InputError: A name is unknown.
    """
    scenario = load_scenario(SCENARIO)
    shorter = scenario.model_copy(
        update={"duration": min(scenario.duration, float(_watched_until_s(scenario)))}
    )
    plan = make_plan(shorter)
    specs = [RunSpec(seed, scenario.befalling) for seed in seeds]
    recording = record(plan, controller, specs)
    return PushedWalk(shorter, recording, np.array([bool(each["survived"]) for each in recording.measures]))


def _watched_until_s(scenario: Scenario) -> int:
    """Find the whole second at which the push has been over for long enough, however late it begins."""
    late = max((each.start for each in scenario.befalling if isinstance(each, Jitter)), default=0.0)
    begin = push_moment(scenario, scenario.made_reference()).time_s
    return math.ceil(begin + late + scenario.pushes[0].duration + WATCHED_S)


@dataclass(frozen=True)
class Excursions:
    """How long a ZMP was beyond thresholds after a push, in one run; [s], nothing if it never was.

    Attributes:
        first: From the first crossing to being back inside, for a moment at least.
        longest: The longest time outside at a stretch.
        total: All time outside.
        until_calm: From the first crossing until it stays inside for a whole step; nothing if it never does.
    """

    first: float | None
    longest: float | None
    total: float
    until_calm: float | None


def excursions(outside: Flags, step_s: float, calm_ticks: int) -> Excursions:
    """Measure the times outside.

    Args:
        outside: Whether the ZMP is beyond a threshold, from the push on; shape (T,).
        step_s: Time between ticks.
        calm_ticks: Ticks of a step.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], outside, [False]])))
    if len(edges) == 0:
        return Excursions(None, None, 0.0, None)
    begins, ends = edges[::2], edges[1::2]
    calm = np.append(begins[1:], len(outside) + (0 if outside[-1] else 1)) - ends > calm_ticks
    until = float((ends[calm.argmax()] - begins[0]) * step_s) if calm.any() else None
    lengths = (ends - begins) * step_s
    return Excursions(float(lengths[0]), float(lengths.max()), float(lengths.sum()), until)


def thresholds_for_cells_m(walk: PushedWalk) -> Array:
    """Find where the circuit's thresholds stand in each tick of each robot: right, left; shape (T, B, 2)."""
    return np.asarray(walk.thresholds.lines_m[walk.view.support])


def thresholds_for_pressure_m(walk: PushedWalk) -> Array:
    """Put thresholds as far inside the soles' edges as the circuit's are in the cells'; shape (T, B, 2)."""
    block = walk.view.block
    moved = walk.thresholds.lines_m + support_edges_m(block) - cell_edges_m(block)
    return np.asarray(moved[walk.view.support])


def cell_edges_m(block: BipedSpec) -> Array:
    """Find the edges of the force cells' hull, as `support_edges_m` does for the soles; shape (3, 2)."""
    offset = block.legs.hip_offset_y
    left = [offset + place[1] for place in block.feet.left.cells.values()]
    right = [-offset + place[1] for place in block.feet.right.cells.values()]
    return np.array([(min(left), max(left)), (min(right), max(right)), (min(right), max(left))])


def zmp_as_read_m(walk: PushedWalk) -> Array:
    """Take ZMP_y as the controller read it, with the cells' noise; without, if it read none; shape (T, B)."""
    recording, channel = walk.recording, walk.thresholds.channel
    if channel in recording.observation_names:
        return np.asarray(recording.observations[:, :, recording.observation_names.index(channel)])
    return recording.channel(channel)


def beyond(values: Array, lines: Array) -> Flags:
    """See whether values are outside of lines by more than rounding; shapes (T, B) and (T, B, 2)."""
    return np.asarray((values < lines[..., 0] - 1e-9) | (values > lines[..., 1] + 1e-9))


def measure_excursions(walk: PushedWalk, values: Array, lines: Array) -> tuple[Excursions, ...]:
    """Measure the times outside of every robot, from its push to its fall or the end."""
    outside = beyond(values, lines)
    found = []
    for robot in range(outside.shape[1]):
        begin, end = round(walk.push_s(robot)[0] / walk.step_s), walk.end_tick(robot)
        found.append(excursions(outside[begin:end, robot], walk.step_s, walk.pace_ticks))
    return tuple(found)


def time_to_limit_cycle_s(walk: PushedWalk) -> tuple[float | None, ...]:
    """Measure the time from the push until the CoM stays near its limit cycle.

    The cycle is the mean of the double steps before the push, in the plane of y and y'/omega. Near is 5 mm,
    a small part of its width of some 60 mm.

    Returns:
        Seconds for each robot, nothing for one that fell or had not returned at the end.
    """
    view = walk.view
    heights = view.com_m[:100, :, 2].mean(axis=0)
    omega = np.array([natural_frequency(float(height)) for height in heights])  # each robot for itself
    points = np.stack([view.com_m[..., 1], view.com_velocity[..., 1] / omega], axis=-1)
    return tuple(_return_s(walk, points[:, robot], robot) for robot in range(points.shape[1]))


def _return_s(walk: PushedWalk, points: Array, robot: int) -> float | None:
    if not walk.survived[robot]:
        return None
    cycle_ticks = 2 * walk.pace_ticks
    begin = round(walk.push_s(robot)[0] / walk.step_s)
    cycles = (begin - round(SETTLED_S / walk.step_s)) // cycle_ticks
    before = points[begin - cycles * cycle_ticks : begin]
    cycle = before.reshape(cycles, cycle_ticks, 2).mean(axis=0)
    away = np.flatnonzero(_distances(points[begin:], cycle) > NEAR_M)
    if len(away) == 0:
        return 0.0
    back = away[-1] + 1
    return float(back * walk.step_s) if begin + back < len(points) else None


def _distances(points: Array, cycle: Array) -> Array:
    """Measure the distance from every point to the nearest of the cycle; shape (T,)."""
    return np.asarray(np.linalg.norm(points[:, None] - cycle[None], axis=-1).min(axis=1))
