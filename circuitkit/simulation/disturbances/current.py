"""Water or air that moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field

from circuitkit.base.source.fields import MetresPerSecond, Seconds
from circuitkit.robots import RobotModel, Worlds
from circuitkit.simulation.disturbance import Disturbance, Effects, Hook, Start


class Current(Disturbance):
    """Moves the water or air around everything, MuJoCo's `wind`; the MJCF needs a density or viscosity."""

    kind: ClassVar[str] = "current"

    velocity: tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond] = Field(description="Along x, y and z.")
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
        if self.changes_model:
            return
        first, last = effects.window(self.start, self.duration, where)
        before = np.array(effects.robot.model.opt.wind)
        effects.spans.append(("current", first * effects.step_s, last * effects.step_s))

        def blow(velocity: object) -> Hook:
            def act(_: int, worlds: Worlds) -> None:
                worlds.physics.expand("opt.wind")[:] = velocity

            return Hook(0, 0, act)

        effects.on_worlds.append(blow(self.velocity)._replace(first=first, last=first + 1))
        if last < effects.ticks:
            effects.on_worlds.append(blow(before)._replace(first=last, last=last + 1))
