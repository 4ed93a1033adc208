"""What `simulate` gives back: a recording, and what it was judged to be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.measures import Value
from circuitkit.simulation.recording import Recording
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
    """

    scenario: Scenario
    recording: Recording
    measures: Mapping[str, Value]
    path: Path | None = None
    notes: tuple[str, ...] = ()
    backend: str = ""

    @property
    def survived(self) -> bool:
        """Whether the robot got through."""
        return bool(self.measures["survived"])

    @property
    def push(self) -> Push | None:
        """The first push, if there is one."""
        pushes = [each for each in self.recording.specs[0].disturbances if isinstance(each, Push)]
        return pushes[0] if pushes else None

    @property
    def outcome(self) -> str:
        """How it ended, in words."""
        recording = self.recording
        ended = recording.ended_s()
        if ended is not None and recording.lost[0]:
            return f"became unstable at {ended:.2f} s"
        if ended is not None:
            return f"{'ended' if self.survived else 'fell' if _falls(recording) else 'ended'} at {ended:.2f} s"
        return "stood until interrupted" if recording.interrupted else "stood" if _falls(recording) else "ran to the end"

    def row(self) -> dict[str, Any]:
        """The result for a table or for JSON."""
        push = self.push
        return {
            "scenario": self.scenario.scenario,
            "controller": self.recording.controller,
            "seed": self.recording.specs[0].seed,
            "push": push
            and {"force_n": push.force, "duration_s": push.duration, "direction": push.direction},
            **self.measures,
            "interrupted": self.recording.interrupted,
            "notes": list(self.notes),
            "recording": None if self.path is None else str(self.path),
        }


def _falls(recording: Recording) -> bool:
    """Whether `until` says that the robot fell, rather than that something was reached."""
    return any(getattr(block, "stands", False) for block in recording.robot.blocks.values())
