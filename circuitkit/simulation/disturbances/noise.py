"""Noise in what the controller reads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import AnyQuantity, Seconds
from circuitkit.control import Array
from circuitkit.robots.sensors import sensor_at
from circuitkit.simulation.disturbance import Disturbance, Start
from circuitkit.simulation.effects import Effects, Hook


class Noise(Disturbance):
    """Adds noise to what the controller reads of channels: white, or a drift with a time constant.

    White noise is n_k = s z_k with z_k from the normal distribution. A drift is the Ornstein-Uhlenbeck
    process n_k = a n_(k-1) + s sqrt(1 - a^2) z_k with a = exp(-dt / drift), whose deviation is s as well.
    """

    kind: ClassVar[str] = "noise"

    channel: str | None = Field(
        default=None, description="Name of a channel or sensor, with * for any letters."
    )
    std: AnyQuantity | Mapping[str, AnyQuantity] = Field(
        description="Standard deviation of each; or several, by names like those of `channel` that share no "
        "reading."
    )
    drift: Seconds | None = Field(
        default=None, gt=0, description="Time constant; without it the noise is white."
    )
    start: Start = Field(default=0.0, description="A time such as 5 s, or a moment of the reference.")
    duration: Seconds | None = Field(default=None, gt=0, description="To the end of the run if absent.")
    stream: int = Field(
        default=0, ge=0, le=1000, description="Noises of other streams do not change the numbers of this one."
    )

    @model_validator(mode="after")
    def _names_once(self) -> Noise:
        if (self.channel is None) != isinstance(self.std, Mapping):
            found = "a channel and names in std" if self.channel else "neither a channel nor names in std"
            message = f"found {found}; allowed: channel: NAME with std: AMOUNT, or std: {{NAME: AMOUNT}}"
            raise ValueError(message)
        return self

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:
        """Draw the noise of the whole run, and have it added."""
        amounts = self.std if isinstance(self.std, Mapping) else {str(self.channel): self.std}
        named: dict[int | str, str] = {}
        columns: list[int] = []
        others: list[str] = []
        deviations: list[float] = []
        further: list[float] = []
        for pattern, text in amounts.items():
            some, names = effects.columns_of(pattern, f"{where}.channel")
            amount = self._amount(effects, pattern, text, where)
            readings: list[int | str] = [*some, *names]
            for each in readings:
                if (other := named.setdefault(each, pattern)) != pattern:
                    self._complain_of_two(effects, each, (other, pattern), where)
            columns += some
            deviations += [amount] * len(some)
            others += names
            further += [amount] * len(names)
        values = np.zeros((effects.ticks, effects.batch, len(columns) + len(others)))
        deviation = np.array([*deviations, *further])
        for i in robots:
            drawn = effects.generator(i, self.stream).normal(0.0, 1.0, values.shape[::2])
            values[:, i] = self._coloured(drawn, effects.step_s) * deviation
        first, last = effects.window(self.start, self.duration, where)
        if self.start != 0.0 or self.duration is not None:
            words = f"noise on {', '.join(amounts)}"
            effects.spans.append((words, first * effects.step_s, last * effects.step_s))
        if columns:
            effects.on_readings.append(_adding(values[..., : len(columns)], columns, first, last))
        seen = [
            (effects.observed.index(name), k) for k, name in enumerate(others) if name in effects.observed
        ]
        if seen:
            places, picked = [place for place, _ in seen], [len(columns) + k for _, k in seen]
            effects.on_computed.append(_adding(values[..., picked], places, first, last))

    def _amount(self, effects: Effects, pattern: str, text: str, where: str) -> float:
        """A standard deviation in SI units, if its unit is that of what it is added to."""
        amount = effects.amount_for(pattern, text, f"{where}.std")
        if amount < 0:
            raise InputError(Problem("", 0, 0, f"{where}.std", f"found '{text}'; allowed: 0 or more"))
        return amount

    def _complain_of_two(
        self, effects: Effects, what: int | str, patterns: tuple[str, str], where: str
    ) -> None:
        """Refuse two deviations of one reading: neither would be its own."""
        channels, model = effects.robot.channels, effects.robot.model
        name = next((each for each, channel in channels.items() if what in {each, channel.value.bare}), None)
        shown = (
            f"the sensor '{model.sensor(sensor_at(model, int(what))).name}'" if name is None else f"'{name}'"
        )
        message = (
            f"found two deviations of {shown}, by '{patterns[0]}' and by '{patterns[1]}'; allowed: one in "
            "each noise; noises of their own add up"
        )
        raise InputError(Problem("", 0, 0, f"{where}.std", message))

    def _coloured(self, white: Array, step_s: float) -> Array:
        """White noise of standard deviation 1, or the drift made of it; shape (T, k)."""
        if self.drift is None:
            return white
        keep = math.exp(-step_s / self.drift)
        drifting = np.empty_like(white)
        drifting[0] = white[0]
        for k in range(1, len(white)):
            drifting[k] = keep * drifting[k - 1] + math.sqrt(1 - keep * keep) * white[k]
        return drifting


def _adding(values: Array, places: Sequence[int], first: int, last: int) -> Hook:
    """Add rows of values to columns; neighbouring columns are a slice, which is quicker."""
    run = list(range(places[0], places[0] + len(places))) == list(places)
    where: slice | list[int] = slice(places[0], places[0] + len(places)) if run else list(places)

    def act(tick: int, readings: Array) -> None:
        readings[:, where] += values[tick]

    return Hook(first, last, act)
