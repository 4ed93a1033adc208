"""What `simulate` gives back: a recording, what it was judged to be, and what plots and films tell of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Unit
from circuitkit.control import Array
from circuitkit.simulation.disturbances.push import DIRECTIONS, Push
from circuitkit.simulation.effects import BodyForce
from circuitkit.simulation.formulas import Value
from circuitkit.simulation.measures import SURVIVED
from circuitkit.simulation.recording import Recording
from circuitkit.simulation.reference import percent
from circuitkit.simulation.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Result:
    """One run.

    Attributes:
        scenario: The scenario.
        recording: Every tick.
        measures: The scenario's measures by name, in SI units; None for what has no value.
        path: Where the recording was written; None if nowhere.
        notes: What was asked for and could not be had, such as a film where nothing can draw one.
        backend: Which backend ran the circuit, and why that one; empty without a circuit.
        interrupted: Whether Ctrl-C came when the run was done, so that something, such as a film, is missing.
    """

    scenario: Scenario
    recording: Recording
    measures: Mapping[str, Value]
    path: Path | None = None
    notes: tuple[str, ...] = ()
    backend: str = ""
    interrupted: bool = False

    @property
    def invalid(self) -> str | None:
        """When and why the physics became invalid, which ended the run; None if it did not.

        Nobody knows then what a robot would have done, and no measure has a value.
        """
        return self.recording.invalid[0]

    @property
    def survived(self) -> bool:
        """Whether the robot got through; not if that is not known: it has no value, or the run is invalid."""
        return bool(self.measures[SURVIVED])

    @property
    def units(self) -> Mapping[str, Unit | None]:
        """The unit of each measure; None for true and false."""
        known = self.recording.judge.units
        return {name: known.get(name) for name in self.measures}

    @property
    def pushes(self) -> tuple[Push, ...]:
        """The pushes, in the order of the scenario."""
        return tuple(each for each in self.recording.specs[0].disturbances if isinstance(each, Push))

    @property
    def outcome(self) -> str:
        """How it ended, in words; that it is invalid, if it is.

        A block of the robot's file may have words for a run that got to its end and for one that `until`
        ended; where the scenario judges by a measure `survived` of its own, the run passed or failed.
        """
        recording, words = self.recording, self._words
        if (ended := recording.ended_s()) is not None:
            why = "" if self.invalid else self._why
            return f"{self.ending} at {ended:.2f} s{why}"
        if recording.interrupted:
            stopped = f"interrupted at {recording.ticks * recording.step_s:.2f} s"
            return f"{words[0]} until interrupted" if words else stopped
        if not self._plain:
            return "passed" if self.survived else f"failed{self._why}"
        return words[0] if words else "ran to the end"

    @property
    def _why(self) -> str:
        """Why a run failed that may not have: nothing tells whether it survived."""
        return ", as survived has no value" if self.measures[SURVIVED] is None else ""

    @property
    def ending(self) -> str:
        """What happened when it ended early, in a word such as `fell` or `invalid`; empty if it did not."""
        if self.recording.ended_s() is None:
            return ""
        if self.invalid:
            return "invalid"
        if self.survived:
            return "ended"
        return self._words[1] if self._words else "ended" if self._plain else "failed"

    @property
    def _words(self) -> tuple[str, str] | None:
        """What a block of the robot's file calls a run that got to its end, and one that did not."""
        blocks = self.recording.robot.blocks.values()
        return next((block.outcomes for block in blocks if hasattr(block, "outcomes")), None)

    @property
    def _plain(self) -> bool:
        """Whether surviving means no more than not to be ended by `until`."""
        return self.scenario.formulas[SURVIVED].split() == ["not", "ended"]

    @cached_property
    def interventions(self) -> Mapping[str, Mapping[str, tuple[float, float]]]:
        """What was cut, missing, held and replaced; see `Recording.interventions`."""
        return self.recording.interventions()

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader of the verdict must know of commands and readings; each a line."""
        lasted_s = self.recording.ended_s() or self.recording.ticks * self.recording.step_s
        fallback = self.scenario.fallback
        found = []
        for kind, by_name in self.interventions.items():
            for name, (first_s, total_s) in by_name.items():
                spell = f"for {total_s:.4g} s, first at {first_s:.4g} s"
                found.append(
                    {
                        "clamped": f"{name} was at its limit in {percent(total_s / lasted_s)} of the run",
                        "missing": f"{name} was missing {spell}",
                        "held": f"{name} was not commanded {spell}: the last command was held",
                        "fallback": f"{name} was not commanded {spell}: fallback {fallback}",
                    }[kind]
                )
        return tuple(found)

    def row(self) -> dict[str, Any]:
        """The result for a table or for JSON."""
        first = self.pushes[0] if self.pushes else None
        return {
            "scenario": self.scenario.scenario,
            "controller": self.recording.controller,
            "seed": self.recording.specs[0].seed,
            "push": first
            and {
                "force_n": first.force,
                "torque_nm": first.torque,
                "duration_s": first.duration,
                "direction": first.direction,
                "pushes": len(self.pushes),
            },
            "invalid": self.invalid,
            "warnings": dict(self.recording.warnings[0]),
            **self.measures,
            "interventions": {
                kind: {
                    name: {"first_s": first_s, "total_s": total_s}
                    for name, (first_s, total_s) in by_name.items()
                }
                for kind, by_name in self.interventions.items()
            },
            "interrupted": self.interrupted or self.recording.interrupted,
            "notes": list(self.notes),
            "recording": None if self.path is None else str(self.path),
        }


_BEFORE_PUSH_S, _AFTER_PUSH_S = 2.0, 4.0
_AFTER_END_S = 0.15
_SHORTEST_ARROW_S = 0.2


@dataclass(frozen=True)
class PushSpan:
    """A push as it was applied.

    Attributes:
        body: Number of the body in the robot's model.
        start_s: Its beginning.
        end_s: Its end.
        force: Largest force in it, world frame; shape (3,), [N].
        point_m: Where it acts, from the body's centre of mass; shape (3,).
        turns: Whether that point turns with the body; else it lies along the world's axes.
        way: What the scenario calls its direction, if that is not one of the plain words; else empty.
    """

    body: int
    start_s: float
    end_s: float
    force: Array
    point_m: Array
    turns: bool = False
    way: str = ""

    @property
    def size_n(self) -> float:
        """Its size."""
        return float(np.linalg.norm(self.force))

    def shown_at(self, time_s: float) -> bool:
        """Whether its arrow is shown at a time; a push too short to be seen is shown for longer."""
        return self.start_s <= time_s < max(self.end_s, self.start_s + _SHORTEST_ARROW_S)

    @property
    def text(self) -> str:
        """In words, such as `20 N to the left`, with the scenario's own word as in `(inward)`."""
        axis = int(np.argmax(np.abs(self.force)))
        words = (("forward", "backward"), ("to the left", "to the right"), ("upward", "downward"))[axis]
        own = f" ({self.way})" if self.way else ""
        return f"{self.size_n:.3g} N {words[int(self.force[axis] < 0)]}{own}"


@dataclass(frozen=True, eq=False)
class RunSummary:
    """One robot's run; T ticks, row t is the end of tick t.

    Attributes:
        scenario: Name of the scenario.
        controller: Name of the controller.
        outcome: How it ended, in words.
        step_s: The control step.
        time_s: Shape (T,).
        missing: Whether the controller lacked a reading; shape (T,).
        pushes: In the order of their beginning.
        spans: Further disturbances: what, from when, to when, [s].
        ended_s: When `until` ended it; None if it did not.
        good: Whether the robot got through.
        ending: What happened at `ended_s`, in a word such as `fell`; empty if nothing did.
    """

    scenario: str
    controller: str
    outcome: str
    step_s: float
    time_s: Array
    missing: NDArray[np.bool_]
    pushes: tuple[PushSpan, ...]
    spans: tuple[tuple[str, float, float], ...]
    ended_s: float | None
    good: bool
    ending: str = ""

    @property
    def title(self) -> str:
        """Controller and outcome."""
        return f"{self.controller}: {self.outcome}"

    @property
    def end_s(self) -> float:
        """When the recording ends, or a moment after the run did."""
        last = float(self.time_s[-1])
        return last if self.ended_s is None else min(last, self.ended_s + _AFTER_END_S)

    @property
    def window_s(self) -> tuple[float, float]:
        """The time around the first push that is worth a closer look; without a push, all of it."""
        if not self.pushes:
            return 0.0, self.end_s
        start = self.pushes[0].start_s
        return max(start - _BEFORE_PUSH_S, 0.0), min(start + _AFTER_PUSH_S, self.end_s)

    def before_end(self) -> NDArray[np.bool_]:
        """Ticks up to the end; shape (T,)."""
        return self.time_s <= (np.inf if self.ended_s is None else self.ended_s)

    def pushed(self) -> NDArray[np.bool_]:
        """Ticks from the first push on; shape (T,)."""
        if not self.pushes:
            return np.zeros(len(self.time_s), dtype=bool)
        return self.time_s >= self.pushes[0].start_s


def summarise(result: Result, robot: int = 0) -> RunSummary:
    """The summary of one robot of a result; its recording has at least one tick."""
    recording = result.recording
    missing: NDArray[np.bool_] = np.any(~np.isfinite(recording.observations[:, robot]), axis=1)
    last = float(recording.time_s[-1])
    found = [*recording.effects.spans, *_turns(recording, robot)]
    spans = [(text, begin, min(end, last)) for text, begin, end in found if begin < last]
    return RunSummary(
        scenario=result.scenario.scenario,
        controller=recording.controller,
        outcome=result.outcome,
        step_s=recording.step_s,
        time_s=recording.time_s,
        missing=missing,
        pushes=find_pushes(recording, robot),
        spans=tuple(spans),
        ended_s=recording.ended_s(robot),
        good=result.survived,
        ending=result.ending,
    )


def find_pushes(recording: Recording, robot: int) -> tuple[PushSpan, ...]:
    """The pushes on one robot that began before the end of the recording."""
    found = []
    for push in recording.effects.forces:
        forces = push.forces[:, robot]
        for begin, end in _stretches(np.linalg.norm(forces, axis=1) > 0):
            if push.first_tick + begin < recording.ticks:
                found.append(_span(push, robot, begin, end, recording.step_s))
    return tuple(sorted(found, key=lambda span: span.start_s))


def _stretches(active: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Where something is the case: first row, and one past the last."""
    padded = np.concatenate([[False], active, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        yield int(begin), int(end)


def _turns(recording: Recording, robot: int) -> Iterator[tuple[str, float, float]]:
    """Torques without a force, which have no arrow: in words, from when, to when."""
    for push in recording.effects.forces:
        if push.torques is not None:
            sizes = np.linalg.norm(push.torques[:, robot], axis=1)
            for begin, end in _stretches((sizes > 0) & ~push.forces[:, robot].any(axis=1)):
                text = f"{sizes[begin:end].max():.3g} N m"
                yield text, *_window_s(sizes[begin:end], push.first_tick + begin, recording.step_s)


def _window_s(size: Array, first_tick: int, step_s: float) -> tuple[float, float]:
    """From when to when something of a size by ticks acts; of the first and last tick it may cover a part."""
    share = size / size.max()
    start_s = (first_tick + 1 - share[0]) * step_s
    return float(start_s), float(start_s + share.sum() * step_s)


def _span(push: BodyForce, robot: int, begin: int, end: int, step_s: float) -> PushSpan:
    forces = push.forces[begin:end, robot]
    size = np.linalg.norm(forces, axis=1)
    start_s, end_s = _window_s(size, push.first_tick + begin, step_s)
    ways = (way for i, at, way in push.ways if i == robot and start_s - step_s < at < end_s)
    return PushSpan(
        push.body, start_s, end_s, forces[np.argmax(size)],
        push.point_m[robot], bool(push.turns[robot]),
        ", ".join(dict.fromkeys(way for way in ways if way not in DIRECTIONS)),
    )  # fmt: skip
