"""Water or air that moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import MetresPerSecond, Seconds
from circuitkit.robots import RobotModel, Worlds
from circuitkit.simulation.disturbance import Disturbance, Start
from circuitkit.simulation.effects import Effects, Hook


class Current(Disturbance):
    """Moves the water or air around everything, MuJoCo's `wind`; the MJCF needs a density or viscosity."""

    kind: ClassVar[str] = "current"

    velocity: tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond] = Field(
        description="Along x, y and z."
    )
    start: Start = Field(default=0.0, description="A time such as 5 s, or a moment of the reference.")
    duration: Seconds | None = Field(default=None, gt=0, description="To the end of the run if absent.")

    @property
    def changes_model(self) -> bool:
        """If it lasts for the whole run."""
        return self.start == 0.0 and self.duration is None

    def change(self, robot: RobotModel) -> None:
        """Set the wind of the compiled model."""
        if self.changes_model:
            robot.model.opt.wind = self.velocity

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:  # noqa: ARG002 - all robots
        """Set the wind of every world when it begins, and back when it ends."""
        option = effects.robot.model.opt
        if not option.density and not option.viscosity:
            message = "the MJCF has neither density nor viscosity, so that nothing feels a current"
            allowed = (
                'an MJCF with <option density="1000" viscosity="0.0009"/> for water, 1.2 and 0.00002 for air'
            )
            raise InputError(Problem("", 0, 0, where, f"{message}; allowed: {allowed}"))
        if self.changes_model:
            return
        first, last = effects.window(self.start, self.duration, where)
        spells: list[tuple[int, int, Current]] = effects.collected("currents", list)
        spells.append((first, last, self))
        effects.spans.append(("current", first * effects.step_s, last * effects.step_s))

        def change(tick: int, worlds: Worlds) -> None:
            """Of several at a time the last one of the file counts; without any, that of the whole run."""
            velocity = worlds.robot.model.opt.wind
            for begin, end, each in spells:
                if begin <= tick < end:
                    velocity = each.velocity
            worlds.physics.expand("opt.wind")[:] = velocity

        effects.on_worlds += [Hook(tick, tick + 1, change) for tick in (first, last) if tick < effects.ticks]
