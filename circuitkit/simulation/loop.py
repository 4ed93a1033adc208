"""The closed loop: observe, control, apply, advance; B robots at once, once a control step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit import CircuitGraph
from circuitkit.control import Array, Controller
from circuitkit.robots import Observer, RobotModel, Worlds
from circuitkit.simulation.disturbance import Effects, Hook, RunSpec
from circuitkit.simulation.measures import Judge, Tracker
from circuitkit.simulation.recording import Recording
from circuitkit.simulation.reference import Motion

_LOOK_EVERY = 20  # ticks between two looks at who has ended
_AFTER_END_S = 0.6  # is still recorded once all have ended, so that films show what came of it


@dataclass(frozen=True, eq=False)
class Setup:
    """Everything that a run needs, made beforehand.

    Attributes:
        robot: The robot as it is simulated.
        motion: What the reference wants.
        controller: What adds to it.
        circuit: The circuit, in use or not; None without one.
        specs: What is special to each of the B robots.
        effects: What befalls them.
        judge: Measures, and what ends a run.
        step_s: The control step.
        ticks: T.
    """

    robot: RobotModel
    motion: Motion
    controller: Controller
    circuit: CircuitGraph | None
    specs: tuple[RunSpec, ...]
    effects: Effects
    judge: Judge
    step_s: float
    ticks: int

    @property
    def trace_names(self) -> tuple[str, ...]:
        """What the controller records of itself."""
        return tuple(getattr(self.controller, "trace_names", ()))


class _Rows:
    """Arrays that take one row a tick; or only seem to, and keep the last one, for runs by the thousand."""

    def __init__(self, setup: Setup, worlds: Worlds, *, keep: bool) -> None:
        def rows(*shape: int) -> Array:
            if keep:
                return np.empty((setup.ticks, *shape))
            last = np.empty(shape)
            return np.lib.stride_tricks.as_strided(last, (setup.ticks, *shape), (0, *last.strides))

        batch = worlds.batch
        self.readings = rows(*worlds.readings.shape)
        self.qpos = rows(*worlds.qpos.shape)
        self.observations = rows(batch, len(setup.controller.observations))
        self.commands = rows(batch, len(setup.controller.commands))
        self.trace = rows(batch, len(setup.trace_names))


def run_loop(
    setup: Setup, progress: Callable[[int], object] | None = None, threads: int | None = None
) -> Recording:
    """Run all robots to the end, or until all have ended, or until Ctrl-C, and record everything.

    Args:
        setup: What runs.
        progress: Is told the number of ticks that are done.
        threads: For the physics; by default all processors, one for one robot.

    Returns:
        What was recorded; after Ctrl-C, as far as it got.
    """
    controller = setup.controller
    worlds = _start(setup, threads)
    rows = _Rows(setup, worlds, keep=True)
    tracker = _tracker(setup)
    done, interrupted = 0, False
    try:
        for done in _ticks(setup, worlds, rows, tracker):
            if progress is not None and done % _LOOK_EVERY == 0:
                progress(done)
    except KeyboardInterrupt:
        interrupted = True
    tracker.look(rows.readings[tracker.done : done], rows.commands[tracker.done : done])
    return Recording(
        robot=setup.robot, motion=setup.motion, specs=setup.specs, effects=setup.effects,
        controller=controller.name, circuit=setup.circuit, step_s=setup.step_s, judge=setup.judge,
        readings=rows.readings[:done], qpos=rows.qpos[:done], observations=rows.observations[:done],
        commands=rows.commands[:done], trace=rows.trace[:done],
        observation_names=tuple(controller.observations), command_names=tuple(controller.commands),
        trace_names=setup.trace_names, interrupted=interrupted,
        measures=tracker.measures(), end_tick=tracker.end_tick, lost=tracker.lost,
    )  # fmt: skip


def run_and_watch(
    setup: Setup, progress: Callable[[int], object] | None = None, threads: int | None = None
) -> Tracker:
    """The same without a recording, but for what the measures need; who has ended stands still.

    Args:
        setup: What runs.
        progress: Is told the number of ticks that are done.
        threads: For the physics; by default all processors, one for one robot.
    """
    worlds = _start(setup, threads)
    rows = _Rows(setup, worlds, keep=False)
    tracker = _tracker(setup)
    for done in _ticks(setup, worlds, rows, tracker, to_the_end=True):
        if progress is not None and done % _LOOK_EVERY == 0:
            progress(done)
    return tracker


def _tracker(setup: Setup) -> Tracker:
    return Tracker(
        setup.robot, setup.motion, setup.effects, setup.judge, setup.controller.commands,
        step_s=setup.step_s, ticks=setup.ticks,
    )  # fmt: skip


def _columns(robot: RobotModel, names: Sequence[str]) -> set[int]:
    """The columns of `sensordata` that channels depend on."""
    return {column for name in names if name in robot.channels for column in robot.channels[name].value.used}


def _start(setup: Setup, threads: int | None) -> Worlds:
    worlds = Worlds(
        setup.robot, setup.step_s, setup.motion.targets, setup.motion.start_qpos,
        setup.controller.commands, len(setup.specs), threads,
    )  # fmt: skip
    if setup.motion.start_act is not None and len(setup.motion.start_act):
        worlds.physics.bind("act")[:] = setup.motion.start_act
    for place in setup.effects.at_rest:
        place(worlds)
    worlds.begin()
    for kick in setup.effects.at_once:
        kick(worlds)
    setup.controller.reset(worlds.batch)
    if (seed_noise := getattr(setup.controller, "seed_noise", None)) is not None:
        seed_noise([spec.seed for spec in setup.specs])
    return worlds


class _CommonStarts:
    """Robots with the same seed do the same until something befalls one of them: one is simulated for all.

    The controller, the noise and the measures go on for every robot, so that each has its own state, equal to
    that of the others, when they part; only the physics, which is most of the work, is done once.
    """

    def __init__(self, setup: Setup, worlds: Worlds) -> None:
        self._worlds = worlds
        self._leaders = np.arange(worlds.batch)
        self._own_tick = setup.effects.own_tick
        by_seed: dict[int, list[int]] = {}
        for i, spec in enumerate(setup.specs):
            if self._own_tick[i] > 0:
                by_seed.setdefault(spec.seed, []).append(i)
        for robots in by_seed.values():
            self._leaders[robots] = max(robots, key=lambda i: int(self._own_tick[i]))
        self._partings = sorted(
            {int(self._own_tick[i]) for i in np.flatnonzero(self._following)}, reverse=True
        )
        if self._partings:
            worlds.follow(self._leaders)

    @property
    def _following(self) -> NDArray[np.bool_]:
        following: NDArray[np.bool_] = self._leaders != np.arange(len(self._leaders))
        return following

    def part(self, tick: int) -> None:
        """Before a tick: let those go on by themselves whom something befalls in it."""
        if self._partings and tick == self._partings[-1]:
            self._partings.pop()
            parting = self._own_tick == tick
            self._leaders[parting] = np.flatnonzero(parting)
            self._worlds.follow(self._leaders)


def _ticks(
    setup: Setup,
    worlds: Worlds,
    rows: _Rows,
    tracker: Tracker,
    *,
    to_the_end: bool = False,
) -> Iterator[int]:
    """Do one tick after the other; yields how many are done.

    Args:
        setup: What runs.
        worlds: The robots.
        rows: Takes what is recorded.
        tracker: Finds out who has ended.
        to_the_end: What comes after the end does not count: time stands still for who has ended, and the
            controller misses their readings, so that it need not work for them.
    """
    starts = _CommonStarts(setup, worlds)
    sense, controller = _Senses(setup, worlds), setup.controller
    control, advance = controller.step, worlds.advance
    store = getattr(controller, "store_trace", None) if setup.trace_names else None
    reads = bool(controller.observations)
    on_worlds, on_commands = setup.effects.on_worlds, setup.effects.on_commands
    watch = _Watch(setup, worlds, tracker, to_the_end=to_the_end)
    for tick in range(setup.ticks):
        observation = rows.observations[tick]
        if reads:
            sense(tick, observation)
            if watch.still is not None:
                observation[watch.still] = np.nan
        rows.commands[tick] = commands = control(observation)
        if store is not None:
            store(rows.trace[tick])
        if on_commands:
            _do(on_commands, tick, commands := rows.commands[tick])
        starts.part(tick)
        if on_worlds:
            _do(on_worlds, tick, worlds)
        advance(tick, commands)
        rows.readings[tick] = worlds.readings
        rows.qpos[tick] = worlds.qpos
        watch.keep(tick, commands)
        yield tick + 1
        if watch.is_over(tick):
            return


class _Watch:
    """Looks from time to time at who has ended.

    Attributes:
        still: For whom time stands still, since only the measures count; None for nobody.
    """

    def __init__(self, setup: Setup, worlds: Worlds, tracker: Tracker, *, to_the_end: bool) -> None:
        self._worlds, self._tracker, self._to_the_end = worlds, tracker, to_the_end
        self._last = setup.ticks - 1
        self._after = 0 if to_the_end else round(_AFTER_END_S / setup.step_s)
        self._readings = np.empty((_LOOK_EVERY, *worlds.readings.shape))
        self._commands = np.empty((_LOOK_EVERY, worlds.batch, len(setup.controller.commands)))
        self.still: NDArray[np.bool_] | None = None

    def keep(self, tick: int, commands: Array) -> None:
        """Keep what the next look needs, and see at once whom MuJoCo has lost."""
        if (lost := self._worlds.newly_lost()) is not None:
            self._tracker.lose(lost, tick)
        self._readings[tick % _LOOK_EVERY] = self._worlds.readings
        self._commands[tick % _LOOK_EVERY] = commands

    def is_over(self, tick: int) -> bool:
        """Whether this was the last tick."""
        if tick % _LOOK_EVERY == 0 or tick == self._last:
            self._look(tick)
        return tick >= self._last

    def _look(self, tick: int) -> None:
        seen = np.arange(self._tracker.done, tick + 1) % _LOOK_EVERY
        newly = self._tracker.look(self._readings[seen], self._commands[seen])
        if self._to_the_end and newly.any():
            self.still = self._tracker.ended
            self._worlds.stop(self.still)
        if self._tracker.ended.all():
            self._last = min(self._last, int(self._tracker.seen_tick.max()) + self._after)


def _do(hooks: Sequence[Hook], tick: int, what: Any) -> None:  # noqa: ANN401 - worlds or an array
    for first, last, act in hooks:
        if first <= tick < last:
            act(tick, what)


@dataclass(eq=False)
class _Clip:
    """Bounds of neighbouring columns of readings."""

    view: Array
    low: Array
    high: Array
    columns: list[int] = field(default_factory=list)


class _Senses:
    """What the controller gets to read: with noise and faults, within the sensors' ranges."""

    def __init__(self, setup: Setup, worlds: Worlds) -> None:
        effects, channels = setup.effects, setup.robot.channels
        self._on_readings, self._on_clipped = effects.on_readings, effects.on_clipped
        self._on_channels = effects.on_channels
        known = dict(channels)
        self._observer = Observer(known, setup.controller.observations)
        ranges = {c.value.bare: c.range for c in channels.values() if c.range and c.value.bare is not None}
        wanted = _columns(setup.robot, setup.controller.observations)
        ranges = {column: bounds for column, bounds in ranges.items() if column in wanted}
        self._changes = bool(self._on_readings or self._on_clipped or ranges)
        self._true = worlds.readings
        self._seen = worlds.readings.copy() if self._changes else worlds.readings
        self._clips = _clips(self._seen, ranges)
        self._observe = self._observer.bound(self._seen)
        self._missing = [(hook.first, hook.last) for hook in self._on_clipped]

    def __call__(self, tick: int, observation: Array) -> None:
        """Write the channels at the start of a tick; shape (B, k)."""
        if self._changes:
            seen = self._seen
            np.copyto(seen, self._true)
            _do(self._on_readings, tick, seen)
            for clip in self._clips:
                np.maximum(clip.view, clip.low, out=clip.view)
                np.minimum(clip.view, clip.high, out=clip.view)
            _do(self._on_clipped, tick, seen)
        if any(first <= tick < last for first, last in self._missing):
            observation[...] = self._observer.where_some_are_missing(self._seen)
        else:
            self._observe(observation)
        _do(self._on_channels, tick, observation)


def _clips(readings: Array, ranges: dict[int, tuple[float, float]]) -> list[_Clip]:
    """Views of neighbouring columns with their bounds, as few as there can be."""
    runs: list[list[int]] = []
    for column in sorted(ranges):
        if runs and runs[-1][-1] == column - 1:
            runs[-1].append(column)
        else:
            runs.append([column])
    found = []
    for run in runs:
        view = readings[:, run[0] : run[-1] + 1]
        low, high = (np.array([ranges[column][end] for column in run]) for end in (0, 1))
        shape = view.shape
        found.append(
            _Clip(view, np.broadcast_to(low, shape).copy(), np.broadcast_to(high, shape).copy(), run)
        )
    return found
