"""What `simulate` gives back: a recording, and what it was judged to be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from circuitkit.base.units import Unit
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.formulas import Value
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
        """How it ended, in words.

        A robot of which a block of its file says that it stands has stood or fallen. Any other one ran to the
        end, or was ended by `until`; where the scenario judges by a measure `survived` of its own, the run
        passed or failed.
        """
        recording = self.recording
        stands = any(getattr(block, "stands", False) for block in recording.robot.blocks.values())
        if recording.interrupted and recording.ended_s() is None:
            stopped = f"interrupted at {recording.ticks * recording.step_s:.2f} s"
            return "stood until interrupted" if stands else stopped
        if (ended := recording.ended_s()) is not None and recording.lost[0]:
            return f"became unstable at {ended:.2f} s"
        if ended is not None:
            word = "ended" if self.survived else "fell" if stands else "ended" if self._plain else "failed"
            return f"{word} at {ended:.2f} s"
        if not self._plain:
            return "passed" if self.survived else "failed"
        return "stood" if stands else "ran to the end"

    @property
    def _plain(self) -> bool:
        """Whether surviving means no more than not to be ended by `until`."""
        return self.scenario.formulas["survived"].split() == ["not", "ended"]

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
            **self.measures,
            "interrupted": self.recording.interrupted,
            "notes": list(self.notes),
            "recording": None if self.path is None else str(self.path),
        }
