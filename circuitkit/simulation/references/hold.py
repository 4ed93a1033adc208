"""A posture that is held."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import Document
from circuitkit.base.source.fields import AnyQuantity
from circuitkit.robots import RobotModel
from circuitkit.robots.start import hold_joints
from circuitkit.simulation.reference import Motion, Reference


class Hold(Reference):
    """Holds joints at angles or positions, beside what the robot's file holds."""

    kind: ClassVar[str] = "hold"
    settings = Mapping[str, AnyQuantity]

    def __init__(self, joints: Mapping[str, str]) -> None:
        """Name the joints with their targets, as text with unit."""
        self.joints = dict(joints)

    @classmethod
    def read(cls, value: Mapping[str, str], beside: Document) -> Hold:  # noqa: ARG003 - names no file
        """Take the joints."""
        return cls(value)

    def motion(self, robot: RobotModel, ticks: int, step_s: float) -> Motion:  # noqa: ARG002 - it does not move
        """The posture.

        Raises:
            InputError: The robot lacks a joint, or its unit is another; lists all that is wrong.
        """
        qpos, ctrl = robot.start_qpos.copy(), robot.held.copy()
        start = replace(robot.start, act=robot.start.act.copy())
        problems: list[Problem] = []

        def complain(name: str, message: str, hint: str = "") -> None:
            problems.append(Problem("", 0, 0, f"reference.hold.{name}", message, hint))

        hold_joints(robot.model, self.joints, qpos, ctrl, start.act, complain)
        if problems:
            raise InputError(*problems)
        return Motion(ctrl[np.newaxis], qpos, start=start)
