"""What carries a robot through the world."""

from __future__ import annotations

import mujoco
import numpy as np

from circuitkit.robots.channels import Array
from circuitkit.robots.mjcf import HINGE, SLIDE, flex_bodies
from circuitkit.robots.model import RobotModel, moving_parts

_ALONG = 0.99  # cosine to an axis from which on a joint goes along it or about it


class MobileBase:
    """What carries a robot through the world: a free joint, or slides along x and y and a hinge about z.

    The axes are the world's at the robot's start. Slides may stand on each other, as those of a gantry do.

    Attributes:
        free: Number of the free joint, if any.
        dofs: Places in `qvel` of the velocity along x (0) and y (1), as far as there are any.
        places: Places in `qpos` of the same.
        signs: 1, or -1 where the slide counts backwards.
        turn: Number of the hinge about z, if it stands on one.
        turn_sign: 1, or -1 where that counts to the right.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Find it."""
        model, self.free = robot.model, robot.base
        self.turn: int | None = None
        self.turn_sign = 1.0
        self.dofs: dict[int, int] = {}
        self.places: dict[int, int] = {}
        self.signs = {0: 1.0, 1: 1.0}
        if self.free is not None:
            start, place = int(model.jnt_dofadr[self.free]), int(model.jnt_qposadr[self.free])
            self.dofs, self.places = {0: start, 1: start + 1}, {0: place, 1: place + 1}
            return
        data = mujoco.MjData(model)
        data.qpos[:] = robot.start_qpos
        mujoco.mj_kinematics(model, data)
        carriages, soft, root = {0}, flex_bodies(model), 0
        moving = moving_parts(model)
        for body in sorted(range(1, model.nbody), key=lambda each: -moving[model.body_rootid[each]]):
            if int(model.body_parentid[body]) not in carriages or body in soft:
                continue
            if root != model.body_rootid[body] and (self.dofs or self.turn is not None):
                break  # it is one of them that is the robot
            root = int(model.body_rootid[body])
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            found = [self._take(model, joint, data.xaxis[joint]) for joint in range(first, first + count)]
            if count and all(found):
                carriages.add(body)

    def _take(self, model: mujoco.MjModel, joint: int, axis: Array) -> bool:
        """Take a joint that moves along x or y, or turns about z; says whether it is a slide of the base."""
        way = int(np.abs(axis).argmax())
        if abs(axis[way]) <= _ALONG:
            return False
        if model.jnt_type[joint] == SLIDE and way != 2 and way not in self.dofs:  # noqa: PLR2004 - z
            self.dofs[way], self.places[way] = int(model.jnt_dofadr[joint]), int(model.jnt_qposadr[joint])
            self.signs[way] = float(np.sign(axis[way]))
            return True
        if model.jnt_type[joint] == HINGE and way == 2 and self.turn is None:  # noqa: PLR2004 - z
            self.turn, self.turn_sign = joint, float(np.sign(axis[way]))
        return False
