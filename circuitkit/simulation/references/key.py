"""A keyframe of the MJCF that is held."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import Document
from circuitkit.robots import RobotModel
from circuitkit.robots.model import hold_at
from circuitkit.robots.start import no_keyframe, start_state
from circuitkit.simulation.reference import Motion, Reference


class Key(Reference):
    """Starts from a keyframe and holds its controls."""

    kind: ClassVar[str] = "key"
    settings = str

    def __init__(self, key: str) -> None:
        """Name the keyframe."""
        self.name = key

    @classmethod
    def read(cls, value: str, beside: Document) -> Key:  # noqa: ARG003 - names no file
        """Take the name."""
        return cls(value)

    def motion(self, robot: RobotModel, ticks: int, step_s: float) -> Motion:  # noqa: ARG002 - it does not move
        """The keyframe.

        Raises:
            InputError: The MJCF has no such keyframe; lists those it has.
        """
        model = robot.model
        names = [model.key(i).name for i in range(model.nkey)]
        if self.name not in names:
            raise InputError(Problem("", 0, 0, "reference.key", *no_keyframe(self.name, names)))
        key, start = model.key(self.name), start_state(model, self.name)
        return Motion(hold_at(robot, key.qpos, key.ctrl, start.act)[np.newaxis], key.qpos.copy(), start=start)
