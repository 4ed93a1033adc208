"""A channel or sensor that fails."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from circuitkit.base.source.fields import AnyQuantity, Ratio, Seconds
from circuitkit.control import Array
from circuitkit.simulation.disturbance import Disturbance, Start
from circuitkit.simulation.effects import Effects, Hook


class Fault(Disturbance):
    """Lets channels fail: what the controller reads is missing, zero, stuck, a spike, or dropped."""

    kind: ClassVar[str] = "fault"

    channel: str = Field(description="Name of a channel or sensor, with * for any letters.")
    reading: Literal["missing", "zero", "stuck", "spike", "dropped"] = Field(
        description="missing: not a number; zero; stuck: as it was when the fault began; spike: `value` "
        "more; dropped: each tick is missing with `chance`."
    )
    value: AnyQuantity | None = Field(default=None, description="Size of a spike.")
    chance: Ratio | None = Field(default=None, gt=0, le=1, description="Chance of a tick to be dropped.")
    start: Start = Field(default=0.0, description="A time such as 5 s, or a moment of the reference.")
    duration: Seconds | None = Field(default=None, gt=0, description="To the end of the run if absent.")
    stream: int = Field(default=0, ge=0, le=1000, description="Stream of random numbers, as for noise.")

    @model_validator(mode="after")
    def _complete(self) -> Fault:
        for reading, key in (("spike", "value"), ("dropped", "chance")):
            if (self.reading == reading) != (getattr(self, key) is not None):
                word = "without" if self.reading == reading else "with"
                message = f"found the reading {self.reading} {word} {key}"
                allowed = f"{key} with the reading {reading}, and only there"
                raise ValueError(f"{message}; allowed: {allowed}")  # noqa: EM102, TRY003 - built above
        return self

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:  # noqa: ARG002 - all robots
        """Change what the controller reads from the first tick of the fault to the last."""
        first, last = effects.window(self.start, self.duration, where)
        columns, names = effects.columns_of(self.channel, f"{where}.channel")
        spike = 0.0
        if self.value is not None:
            spike = effects.amount_for(self.channel, str(self.value), f"{where}.value")
        effects.spans.append(
            (f"{self.channel} {self.reading}", first * effects.step_s, last * effects.step_s)
        )
        if columns:
            effects.on_clipped.append(Hook(first, last, self._changing(effects, columns, spike)))
        seen = [effects.observed.index(name) for name in names if name in effects.observed]
        if seen:
            effects.on_channels.append(Hook(first, last, self._changing(effects, seen, spike)))

    def _changing(self, effects: Effects, places: list[int], spike: float) -> Any:  # noqa: ANN401 - a hook's function
        if self.reading in {"missing", "zero"}:
            factor = np.nan if self.reading == "missing" else 0.0

            def scale(_: int, values: Array) -> None:
                values[:, places] *= factor

            return scale
        if self.reading == "stuck":
            return _Stuck(places)
        if self.reading == "spike":

            def add(_: int, values: Array) -> None:
                values[:, places] += spike

            return add
        chance = self.chance or 0.0
        draws = [
            effects.generator(i, self.stream).random(effects.ticks) < chance for i in range(effects.batch)
        ]
        dropped = np.stack(draws, axis=1)

        def drop(tick: int, values: Array) -> None:
            values[np.ix_(dropped[tick], places)] = np.nan

        return drop


class _Stuck:
    """Keeps what the columns were when the fault began."""

    def __init__(self, places: list[int]) -> None:
        self._places = places
        self._kept: Array | None = None

    def __call__(self, _: int, values: Array) -> None:
        if self._kept is None:
            self._kept = values[:, self._places].copy()
        values[:, self._places] = self._kept
