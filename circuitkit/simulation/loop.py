"""The closed loop: observe, control, apply, advance; B robots at once, once a control step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit import CircuitGraph
from circuitkit.control import Array, Controller, checked_step
from circuitkit.robots import Channel, Observer, RobotModel, Worlds
from circuitkit.robots.validity import counts_by_kind
from circuitkit.simulation.disturbance import RunSpec
from circuitkit.simulation.effects import Effects, Hook
from circuitkit.simulation.fallback import Fallback, MissingCommands
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
        fallback: What takes the place of commands that do not come.
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
    fallback: Fallback = field(default_factory=Fallback)

    @property
    def trace_names(self) -> tuple[str, ...]:
        """What the controller records of itself."""
        return tuple(getattr(self.controller, "trace_names", ()))


class _Rows:
    """Arrays that take one row a tick; for runs by the thousand only those since the last look.

    Attributes:
        length: L: all ticks, or as many as there are between two looks. Tick t has row t modulo L.
        readings: Sensor readings after the tick, of the beginning of its last time step; shape (L, B, s).
        qpos: Positions after the tick, shape (L, B, nq).
        observations: What the controller read, shape (L, B, k).
        commands: What it wrote, as late as delays let it, or what was sent for it; shape (L, B, m).
        trace: What it tells of itself, shape (L, B, n).
    """

    def __init__(self, setup: Setup, worlds: Worlds, *, keep: bool) -> None:
        length = self.length = setup.ticks if keep else min(_LOOK_EVERY, setup.ticks)
        controller, batch = setup.controller, worlds.batch
        self.readings = np.empty((length, *worlds.readings.shape))
        self.qpos = np.empty((length, *worlds.qpos.shape))
        self.observations = np.empty((length, batch, len(controller.observations)))
        self.commands = np.empty((length, batch, len(controller.commands)))
        self.trace = np.full((length, batch, len(setup.trace_names)), np.nan)  # it may leave some out

    def since(self, begin: int, end: int) -> tuple[Array, Array, Array]:
        """Readings, commands and positions of the ticks from `begin` to before `end`, at most L of them."""
        every = (self.readings, self.commands, self.qpos)
        if end <= self.length:
            return every[0][begin:end], every[1][begin:end], every[2][begin:end]
        rows = np.arange(begin, end) % self.length
        return every[0][rows], every[1][rows], every[2][rows]

    def keep_up_to(self, tracker: Tracker) -> int:
        """Leave out what comes after a robot's physics has become invalid: it is no number from then on.

        Returns:
            How many ticks there are of the robot with the most.
        """
        lasts = [tracker.last_valid(robot) for robot in range(len(tracker.ended))]
        for robot in np.flatnonzero(tracker.broken).tolist():
            for each in (self.readings, self.qpos, self.observations, self.commands, self.trace):
                each[lasts[robot] : tracker.done, robot] = np.nan
        return max(lasts)


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
    tracker = _tracker(setup, worlds)
    gaps = _gaps(setup)
    done, interrupted = 0, False
    try:
        for done in _ticks(setup, worlds, rows, tracker, gaps):
            if progress is not None and done % _LOOK_EVERY == 0:
                progress(done)
    except KeyboardInterrupt:
        interrupted = True
    tracker.look(*rows.since(tracker.done, done))
    done = rows.keep_up_to(tracker)
    return Recording(
        robot=setup.robot, motion=setup.motion, specs=setup.specs, effects=setup.effects,
        controller=controller.name, circuit=setup.circuit, step_s=setup.step_s, judge=setup.judge,
        readings=rows.readings[:done], qpos=rows.qpos[:done], observations=rows.observations[:done],
        commands=rows.commands[:done], trace=rows.trace[:done],
        observation_names=tuple(controller.observations), command_names=tuple(controller.commands),
        trace_names=setup.trace_names, interrupted=interrupted,
        measures=tracker.measures(), end_tick=tracker.end_tick, invalid=tuple(tracker.invalid),
        warnings=tuple(map(counts_by_kind, worlds.warnings)), cut=worlds.limits.cut, held=gaps.held,
        replaced=gaps.replaced,
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
    tracker = _tracker(setup, worlds)
    for done in _ticks(setup, worlds, rows, tracker, _gaps(setup), to_the_end=True):
        if progress is not None and done % _LOOK_EVERY == 0:
            progress(done)
    return tracker


def _tracker(setup: Setup, worlds: Worlds) -> Tracker:
    return Tracker(
        setup.robot, setup.motion, setup.effects, setup.judge, setup.controller.commands,
        step_s=setup.step_s, ticks=setup.ticks, cut=worlds.limits.cut,
    )  # fmt: skip


def _gaps(setup: Setup) -> MissingCommands:
    return MissingCommands(setup.fallback, setup.controller.commands, len(setup.specs), setup.step_s)


def _start(setup: Setup, threads: int | None) -> Worlds:
    worlds = Worlds(
        setup.robot, setup.step_s, setup.motion.targets, setup.motion.start_qpos,
        setup.controller.commands, len(setup.specs), threads,
    )  # fmt: skip
    if setup.motion.start is not None:
        worlds.start_from(setup.motion.start)
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
    that of the others, when they part; only the physics, which is most of the work, is done once. Where
    bodies may sleep nobody follows, for who sleeps is no part of the state that one who parts takes along.
    """

    def __init__(self, setup: Setup, worlds: Worlds) -> None:
        self._worlds = worlds
        self._leaders = np.arange(worlds.batch)
        self._own_tick = setup.effects.own_tick
        by_seed: dict[int, list[int]] = {}
        for i, spec in enumerate(setup.specs):
            if self._own_tick[i] > 0 and not worlds.sleeps:
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
    gaps: MissingCommands,
    *,
    to_the_end: bool = False,
) -> Iterator[int]:
    """Do one tick after the other; yields how many are done.

    Args:
        setup: What runs.
        worlds: The robots.
        rows: Takes what is recorded.
        tracker: Finds out who has ended.
        gaps: Sends something where the controller gives no command.
        to_the_end: What comes after the end does not count: time stands still for who has ended, and the
            controller misses their readings, so that it need not work for them.
    """
    starts = _CommonStarts(setup, worlds)
    sense, controller = _Senses(setup, worlds), setup.controller
    control, advance = checked_step(controller, worlds.batch), worlds.advance
    store = getattr(controller, "store_trace", None) if setup.trace_names else None
    reads, writes = bool(controller.observations), bool(controller.commands)
    on_worlds, on_commands = setup.effects.on_worlds, setup.effects.on_commands
    watch = _Watch(setup, worlds, rows, tracker, to_the_end=to_the_end)
    for tick in range(setup.ticks):
        row = tick % rows.length
        observation = rows.observations[row]
        if reads:
            sense(tick, observation)
            if watch.still is not None:
                observation[watch.still] = np.nan
        commands = rows.commands[row]
        commands[...] = control(observation)
        if store is not None:
            store(rows.trace[row])
        if on_commands:
            _do(on_commands, tick, commands)
        if writes:
            gaps(tick, commands, watch.still)
        starts.part(tick)
        if on_worlds:
            _do(on_worlds, tick, worlds)
        advance(tick, commands)
        rows.readings[row] = worlds.readings
        rows.qpos[row] = worlds.qpos
        yield tick + 1
        if watch.is_over(tick):
            return


class _Watch:
    """Looks from time to time at who has ended, and at once where MuJoCo warns that physics is invalid.

    Attributes:
        still: For whom time stands still, since only the measures count or their physics has become invalid;
            None for nobody.
    """

    def __init__(
        self, setup: Setup, worlds: Worlds, rows: _Rows, tracker: Tracker, *, to_the_end: bool
    ) -> None:
        self._worlds, self._rows, self._tracker, self._to_the_end = worlds, rows, tracker, to_the_end
        # Where nothing but becoming invalid ends a run, looking may wait, as long as the rows are kept.
        self._every = _LOOK_EVERY if setup.judge.until is not None else rows.length
        self._last = setup.ticks - 1
        self._after = 0 if to_the_end else round(_AFTER_END_S / setup.step_s)
        self.still: NDArray[np.bool_] | None = None

    def is_over(self, tick: int) -> bool:
        """Whether this was the last tick."""
        if faults := self._worlds.new_faults():
            self._tracker.invalidate(faults, tick)
        if faults or tick % self._every == 0 or tick == self._last:
            self._look(tick)
        return tick >= self._last

    def _look(self, tick: int) -> None:
        tracker = self._tracker
        tracker.look(*self._rows.since(tracker.done, tick + 1))
        still = tracker.broken
        if self._to_the_end:
            still |= tracker.ended
        if still.any() and (self.still is None or (still != self.still).any()):
            self.still = still
            self._worlds.stop(still)
        if tracker.ended.all():
            shown = np.where(tracker.broken, 0, self._after)
            self._last = min(self._last, int((tracker.seen_tick + shown).max()))


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
    """What the controller gets to read: with noise and faults, within its ranges.

    A range is one of the channel that is read: no other channel is clipped by it, whatever sensor they share.
    Only where it is the sensor's own (`Channel.of_sensor`) all that is computed from the sensor is.
    """

    def __init__(self, setup: Setup, worlds: Worlds) -> None:
        effects, channels = setup.effects, setup.robot.channels
        self._on_readings, self._on_clipped = effects.on_readings, effects.on_clipped
        self._on_computed, self._on_channels = effects.on_computed, effects.on_channels
        known = dict(channels)
        names = setup.controller.observations
        self._observer = Observer(known, names)
        columns, of_channels = _ranges([known[name] for name in names], known.values())
        self._changes = bool(self._on_readings or self._on_clipped or columns)
        self._true = worlds.readings
        self._seen = worlds.readings.copy() if self._changes else worlds.readings
        self._clips = _clips(self._seen, columns)
        ends = [of_channels.get(i, (-np.inf, np.inf)) for i in range(len(names))]
        # Of the shape of what they bound: arrays of one shape are clipped in a quarter of the time.
        self._bounds = [np.tile([end[side] for end in ends], (worlds.batch, 1)) for side in (0, 1)]
        self._bounded = bool(of_channels)
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
        if self._missing and any(first <= tick < last for first, last in self._missing):
            observation[...] = self._observer.where_some_are_missing(self._seen)
        else:
            self._observe(observation)
        _do(self._on_computed, tick, observation)
        if self._bounded:
            np.maximum(observation, self._bounds[0], out=observation)
            np.minimum(observation, self._bounds[1], out=observation)
        _do(self._on_channels, tick, observation)


def _ranges(
    read: Sequence[Channel], known: Iterable[Channel]
) -> tuple[dict[int, tuple[float, float]], dict[int, tuple[float, float]]]:
    """Which columns of readings are clipped, and which of the channels that are read.

    The column is clipped where that is the same: the range is the sensor's, or nobody reads the column but
    channels that are no more than it and have this range. Faults of the sensor then come after.

    Args:
        read: The channels that the controller reads, in order.
        known: All channels.

    Returns:
        Bounds by column of readings, and by place among the channels that are read.
    """
    users: dict[int, list[Channel]] = {}
    for channel in read:
        for column in channel.value.used:
            users.setdefault(column, []).append(channel)
    columns = {
        c.value.bare: c.range
        for c in known
        if c.of_sensor and c.range is not None and c.value.bare is not None and c.value.bare in users
    }
    places = {}
    for place, channel in enumerate(read):
        bare, ends = channel.value.bare, channel.range
        if ends is None or (bare is not None and columns.get(bare) == ends):
            continue
        alone = bare is not None and all(c.value.bare == bare and c.range == ends for c in users[bare])
        if bare is not None and alone and bare not in columns:
            columns[bare] = ends
        else:
            places[place] = ends
    return columns, places


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
