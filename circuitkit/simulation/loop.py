"""The closed loop: observe, control, apply, advance; B robots at once, once a control step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit import CircuitGraph
from circuitkit.control import Controller
from circuitkit.biped.gait import Walk
from circuitkit.robots import MujocoRobot, RobotModel
from circuitkit.simulation.disturbance import Fates, Trial
from circuitkit.simulation.recording import Recording

Array = NDArray[np.float64]

_LOOK_EVERY = 20  # ticks between two looks at who has fallen
_AFTER_FALL = 60  # ticks that are still recorded once all have fallen
_FALLEN_TILT = 0.7  # vertical part of the torso's axis: leans by more than 45 degrees
_FALLEN_HEIGHT = 0.6  # of the height that the CoM had at first


@dataclass(frozen=True)
class Setup:
    """Everything that a run needs, made beforehand.

    Attributes:
        robot: What walks, as it is simulated.
        walk: The walk.
        targets: Of its servos; shape (T, n).
        controller: What adds to the walk.
        circuit: The circuit, in use or not.
        trials: B robots' fates.
        fates: The same as arrays.
        cell_factors: For ticks with a fault, what force cells let through.
        yardstick: The circuit whose thresholds count if this one has none.
        delay: How many ticks old is what the controller reads.
    """

    robot: RobotModel
    walk: Walk
    targets: Array
    controller: Controller
    circuit: CircuitGraph
    trials: tuple[Trial, ...]
    fates: Fates
    cell_factors: dict[int, Array]
    yardstick: CircuitGraph | None = None
    delay: int = 0


def has_fallen(readings: Array, robot: RobotModel, first: Array) -> NDArray[np.bool_]:
    """Who lies, or leans by more than 45 degrees; shape (..., B).

    Args:
        readings: Sensor readings; shape (..., B, s).
        robot: What they are.
        first: Readings at the start; shape (B, s).
    """
    layout = robot.layout
    upright = readings[..., layout.torso_up.start + 2]
    height = readings[..., layout.com.start + 2]
    fallen: NDArray[np.bool_] = (upright < _FALLEN_TILT) | (
        height < _FALLEN_HEIGHT * first[..., layout.com.start + 2]
    )
    return fallen


class _Recorder:
    """Arrays that take one row a tick; or only seem to, and keep the last one, for runs by the thousand."""

    def __init__(self, ticks: int, robot: MujocoRobot, controller: Controller, *, keep: bool) -> None:
        def rows(*shape: int) -> Array:
            if keep:
                return np.empty((ticks, *shape))
            last = np.empty(shape)
            return np.lib.stride_tricks.as_strided(last, (ticks, *shape), (0, *last.strides))

        batch = robot.batch
        self.readings = rows(*robot.readings.shape)
        self.qpos = rows(*robot.qpos.shape)
        self.observations = rows(batch, len(controller.observations))
        self.commands = rows(batch, len(controller.commands))
        self.trace = rows(batch, len(controller.trace_names))
        self.fallen_tick = np.full(batch, -1)


def run_loop(
    setup: Setup, progress: Callable[[int], object] | None = None, threads: int | None = None
) -> Recording:
    """Walk all robots to the end, or until all have fallen, or until Ctrl-C, and record everything.

    Args:
        setup: What runs.
        progress: Is told the number of ticks that are done.
        threads: For the physics; by default all processors, one for one robot.

    Returns:
        What was recorded; after Ctrl-C, as far as it got.
    """
    controller = setup.controller
    robot, record = _start(setup, threads, keep=True)
    done, interrupted = 0, False
    try:
        for done in _ticks(setup, robot, record):
            if progress is not None and done % _LOOK_EVERY == 0:
                progress(done)
    except KeyboardInterrupt:
        interrupted = True
    return Recording(
        setup.walk, setup.robot, setup.trials, setup.fates, controller.name, setup.circuit,
        record.readings[:done], record.qpos[:done], record.observations[:done],
        record.commands[:done], record.trace[:done],
        controller.observations, controller.commands, controller.trace_names, interrupted, setup.yardstick,
    )  # fmt: skip


def run_to_see_who_stands(
    setup: Setup, progress: Callable[[int], object] | None = None, threads: int | None = None
) -> NDArray[np.bool_]:
    """The same without a recording: which of the B robots stand at the end; shape (B,)."""
    robot, record = _start(setup, threads, keep=False)
    for done in _ticks(setup, robot, record, to_the_fall=True):
        if progress is not None and done % _LOOK_EVERY == 0:
            progress(done)
    standing: NDArray[np.bool_] = record.fallen_tick < 0
    return standing


@dataclass(frozen=True)
class Watched:
    """What is kept of a run of B robots over T ticks if it is only to be judged; see `Recording`.

    Attributes:
        readings: Some columns of the true readings at the end of each tick; shape (T, B, c). Where a robot
            has fallen they may be those of a moment soon after the fall.
        commands: What the controller wrote; shape (T, B, m).
        first: True readings at the end of the first tick; shape (B, s).
    """

    readings: Array
    commands: Array
    first: Array


def run_and_watch(
    setup: Setup,
    columns: Sequence[int],
    progress: Callable[[int], object] | None = None,
    threads: int | None = None,
) -> Watched:
    """The same without a recording, but for some columns of the readings and the commands.

    Args:
        setup: What runs.
        columns: The columns.
        progress: Is told the number of ticks that are done.
        threads: For the physics; by default all processors, one for one robot.
    """
    robot, record = _start(setup, threads, keep=False)
    ticks, chosen = setup.walk.ticks, np.array(columns)
    kept = np.empty((ticks, robot.batch, len(columns)))
    commands = np.empty((ticks, robot.batch, len(setup.controller.commands)))
    first, done = robot.readings, 0
    for done in _ticks(setup, robot, record, to_the_fall=True):
        robot.readings.take(chosen, axis=1, out=kept[done - 1])
        commands[done - 1] = record.commands[done - 1]
        if done == 1:
            first = robot.readings.copy()
        if progress is not None and done % _LOOK_EVERY == 0:
            progress(done)
    return Watched(kept[:done], commands[:done], first)


def _start(setup: Setup, threads: int | None, *, keep: bool) -> tuple[MujocoRobot, _Recorder]:
    robot = MujocoRobot(
        setup.robot, setup.walk, setup.targets, setup.controller.commands, len(setup.trials), threads
    )
    robot.set_base_velocity(setup.fates.base_velocity)
    setup.controller.reset(robot.batch)
    return robot, _Recorder(setup.walk.ticks, robot, setup.controller, keep=keep)


def _ticks(
    setup: Setup, robot: MujocoRobot, record: _Recorder, *, to_the_fall: bool = False
) -> Iterator[int]:
    """Do one tick after the other; yields how many are done.

    Args:
        setup: What runs.
        robot: The robots.
        record: Takes what is recorded.
        to_the_fall: What comes after a fall does not count: time stands still for who has fallen, and the
            controller misses their readings, so that it need not work for them.
    """
    sense = _sense(setup, robot)
    control, advance = setup.controller.step, robot.advance
    readings, qpos = robot.readings, robot.qpos
    first = readings.copy()
    reads = bool(setup.controller.observations)
    last = setup.walk.ticks - 1
    pushes = setup.fates.pushes
    still: NDArray[np.bool_] | None = None
    for tick in range(setup.walk.ticks):
        observation = record.observations[tick]
        if reads:
            sense(tick, observation)
            if still is not None:
                observation[still] = np.nan
        record.commands[tick] = commands = control(observation, record.trace[tick])
        for push in pushes:
            row = tick - push.first_tick
            if 0 <= row < len(push.forces):
                robot.push(push.body, push.forces[row], None if push.torques is None else push.torques[row])
        advance(tick, commands)
        record.readings[tick] = readings
        record.qpos[tick] = qpos
        yield tick + 1
        if tick % _LOOK_EVERY == 0 or tick == last:
            newly = has_fallen(readings, setup.robot, first) & (record.fallen_tick < 0)
            record.fallen_tick[newly] = tick
            down = record.fallen_tick >= 0
            if to_the_fall and newly.any():
                still = down
                robot.stop(down)
            if down.all():
                last = min(last, int(record.fallen_tick.max()) + (0 if to_the_fall else _AFTER_FALL))
        if tick >= last:
            return


class _Senses:
    """Sensors as the controller gets them: with noise and faults, within the cells' range."""

    def __init__(self, setup: Setup, robot: MujocoRobot) -> None:
        cells = setup.robot.layout.forces
        self._seen = robot.readings.copy()
        self._seen_cells, self._true_cells = self._seen[:, cells], robot.readings[:, cells]
        self._seen_others, self._true_others = self._seen[:, cells.stop :], robot.readings[:, cells.stop :]
        silence = np.zeros_like(self._true_cells)
        noise = setup.fates.cell_noise
        self._noise = np.broadcast_to(silence, (setup.walk.ticks, *silence.shape)) if noise is None else noise
        self._com_noise = setup.fates.com_noise
        self._seen_com = self._seen[:, setup.robot.layout.com.start : setup.robot.layout.com_velocity.stop]
        self._factors = setup.cell_factors
        self._missing = {tick for tick, row in self._factors.items() if np.isnan(row).any()}
        self._low, self._high = (np.full_like(silence, end) for end in setup.robot.spec.force_cells.range)
        self._observer = robot.observer(setup.controller.observations)
        self._observe = self._observer.bound(self._seen)

    def __call__(self, tick: int, observation: Array) -> None:
        """Write the channels at the start of a tick; shape (B, k)."""
        cells = self._seen_cells
        np.add(self._true_cells, self._noise[tick], cells)
        np.maximum(cells, self._low, out=cells)
        np.minimum(cells, self._high, out=cells)
        self._seen_others[...] = self._true_others
        if self._com_noise is not None:
            self._seen_com += self._com_noise[tick]
        if tick in self._factors:
            cells *= self._factors[tick]
        if tick in self._missing:
            observation[...] = self._observer.where_some_are_missing(self._seen)
        else:
            self._observe(observation)


def _sense(setup: Setup, robot: MujocoRobot) -> Callable[[int, Array], object]:
    """What writes the channels that the controller reads at a tick: those of now, or of some ticks ago.

    Before there is anything so old, it reads what was there at first.
    """
    senses = _Senses(setup, robot)
    if setup.delay == 0:
        return senses
    past = np.empty((setup.delay + 1, robot.batch, len(setup.controller.observations)))

    def sense(tick: int, observation: Array) -> None:
        senses(tick, past[tick % len(past)])
        observation[...] = past[max(tick - setup.delay, 0) % len(past)]

    return sense
