"""Readings and commands that come late."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.base.patterns import matches
from circuitkit.base.source.fields import Seconds
from circuitkit.control import Array
from circuitkit.simulation.disturbance import Disturbance
from circuitkit.simulation.effects import Effects, Hook, placed


class Delay(Disturbance):
    """Lets the controller read old values, or its commands come late, by whole control steps."""

    kind: ClassVar[str] = "delay"

    channel: str | None = Field(default=None, description="Name of a channel, with * for any letters.")
    command: str | None = Field(default=None, description="Name of a command, with * for any letters.")
    by: Seconds = Field(ge=0, description="By how much; whole control steps.")

    @model_validator(mode="after")
    def _one_of_them(self) -> Delay:
        if (self.channel is None) == (self.command is None):
            message = "found both channel and command, or neither; allowed: one of them"
            raise ValueError(message)
        return self

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:  # noqa: ARG002 - all robots
        """Keep the last values, and hand on old ones."""
        ticks = round(self.by / effects.step_s)
        if abs(self.by - ticks * effects.step_s) > 1e-9:  # noqa: PLR2004 - rounding
            step = f"{effects.step_s * 1e3:g} ms"
            message = f"found {self.by * 1e3:g} ms; allowed: a multiple of the control step of {step}"
            raise InputError(Problem("", 0, 0, f"{where}.by", message))
        if ticks >= effects.ticks:
            message = (
                f"found {self.by:g} s; allowed: less than the run of {effects.ticks * effects.step_s:g} s"
            )
            raise InputError(Problem("", 0, 0, f"{where}.by", message))
        if ticks == 0:
            return
        if self.channel is not None:
            places = _places(self.channel, effects.observed, effects.robot.channels, "channel", where)
            effects.on_channels.append(Hook(0, effects.ticks, _Late(ticks, places, effects.batch)))
        else:
            every = effects.robot.commands
            places = _places(str(self.command), effects.commanded, every, "command", where)
            effects.on_commands.append(Hook(0, effects.ticks, _Late(ticks, places, effects.batch)))


def _places(pattern: str, used: Sequence[str], there: Iterable[str], kind: str, where: str) -> list[int]:
    """Where the names that match a pattern stand among those in use."""
    if not any(matches(name, pattern) for name in (*there, *used)) and pattern != "*":
        with placed(f"{where}.{kind}"):
            raise UnknownNameError(kind, pattern, dict.fromkeys((*there, *used)))
    return [i for i, name in enumerate(used) if matches(name, pattern)]


class _Late:
    """Hands on what was there some ticks ago; before there is anything so old, what was there at first."""

    def __init__(self, ticks: int, places: list[int], batch: int) -> None:
        self._ticks = ticks
        self._places = places
        self._past = np.empty((ticks + 1, batch, len(places)))

    def __call__(self, tick: int, values: Array) -> None:
        past = self._past
        past[tick % len(past)] = values[:, self._places]
        values[:, self._places] = past[max(tick - self._ticks, 0) % len(past)]
