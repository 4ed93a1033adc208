"""What reaches the actuators: commands within their limits and rates, controls within their ranges."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.patterns import matches
from circuitkit.robots.channels import Array
from circuitkit.robots.mjcf import HINGE, SLIDE
from circuitkit.robots.model import RobotModel
from circuitkit.robots.start import drives_position, of_joint

Flags = NDArray[np.bool_]
# Beyond it, or with one that is no number, MuJoCo sets all controls of a robot to zero.
_LARGEST = float(mujoco.mjMAXVAL)


class TickLog:
    """In which ticks something befell what has a name, of B robots; ticks without anything take no room.

    Attributes:
        names: Of the n columns.
    """

    def __init__(self, names: Sequence[str] = ()) -> None:
        """Begin with nothing."""
        self.names = tuple(names)
        self._ticks: list[int] = []
        self._flags: list[Flags] = []

    def add(self, tick: int, flags: Flags) -> None:
        """It befell these in a tick, which is later than those before; shape (B, n), kept as it is."""
        self._ticks.append(tick)
        self._flags.append(flags)

    def of(self, robot: int, ticks: int) -> Flags:
        """What befell one robot in the first so many ticks, shape (ticks, n)."""
        found = np.zeros((ticks, len(self.names)), dtype=bool)
        for tick, flags in zip(self._ticks, self._flags, strict=True):
            if tick < ticks:
                found[tick] = flags[robot]
        return found

    def shares(self, ticks: NDArray[np.int64]) -> Array:
        """In which part of its first ticks it befell any of a robot's columns; shape (B,).

        Args:
            ticks: How many ticks count, of each robot; shape (B,).
        """
        if not self._ticks:
            return np.zeros(len(ticks))
        befell = np.array([flags.any(axis=1) for flags in self._flags])
        counted = befell & (np.array(self._ticks)[:, np.newaxis] < ticks)
        return np.asarray(counted.sum(axis=0) / np.maximum(ticks, 1), dtype=np.float64)


def control_ranges(robot: RobotModel) -> tuple[Array, Array]:
    """Least and largest control of each actuator; shape (nu,) each.

    That is its `ctrlrange` where the MJCF limits it by one; else, of a position servo, its joint's range, and
    the servo's `reach` beyond. As force = k (a - length) + b of the length gear * position, a target
    is gear * position - b / k. Others are bound by what MuJoCo takes at all.
    """
    model = robot.model
    low, high = np.full(model.nu, -_LARGEST), np.full(model.nu, _LARGEST)
    binding = not int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    limited = model.actuator_ctrllimited.astype(bool) & binding
    low[limited], high[limited] = model.actuator_ctrlrange[limited].T
    for i in range(model.nactuator):
        place, joint = int(model.actuator_ctrladr[i]), int(model.actuator_trnid[i, 0])
        if limited[place] or not of_joint(model, i) or not drives_position(model, i):
            continue
        if model.jnt_limited[joint] and int(model.jnt_type[joint]) in {HINGE, SLIDE}:
            reach = _reach(robot, model.joint(joint).name)
            ends = model.jnt_range[joint] + np.array([-reach, reach])
            lengths = ends * model.actuator_gear[model.actuator_outadr[i], 0]
            low[place], high[place] = np.sort(
                lengths - model.actuator_biasprm[i, 0] / -model.actuator_biasprm[i, 1]
            )
    return np.maximum(low, -_LARGEST), np.minimum(high, _LARGEST)


def _reach(robot: RobotModel, joint: str) -> float:
    """How far beyond its range the target of a joint's servo may be, [rad or m]."""
    if joint in robot.servo_joints:
        for servo in robot.robot.servos_in_use:
            if any(matches(joint, pattern) for pattern in servo.joints):
                return 0.0 if servo.reach is None else servo.reach.value_si
    return 0.0


class Limits:
    """Turns the commands for B robots into controls, and cuts what is beyond a limit, a rate or a range.

    Attributes:
        cut: When it had to: a column for each command, then one for each control.
    """

    def __init__(
        self, robot: RobotModel, commands: Sequence[str], batch: int, step_s: float, targets: Array
    ) -> None:
        """Find the bounds.

        Args:
            robot: What they are.
            commands: Which commands there are, in order.
            batch: B.
            step_s: The control step, which makes a rate a change.
            targets: All that the reference will want of the controls; shape (T, nu).

        Raises:
            UnknownNameError: The robot does not have one of the commands.
        """
        for name in commands:
            if name not in robot.commands:
                kind = "command of the robot"
                raise UnknownNameError(kind, name, robot.commands)
        chosen = [robot.commands[name] for name in commands]
        self._mixing = np.zeros((robot.model.nu, len(chosen)))
        for i, command in enumerate(chosen):
            self._mixing[:, i] = command.factors
        ends = [command.limits or (-_LARGEST, _LARGEST) for command in chosen]
        change = [np.inf if command.rate is None else command.rate * step_s for command in chosen]

        # Arrays of one shape are added and compared in a quarter of the time that broadcasting takes.
        def tiled(row: Sequence[float] | Array) -> Array:
            return np.tile(np.asarray(row, dtype=np.float64), (batch, 1))

        self._ends = tiled([low for low, _ in ends]), tiled([high for _, high in ends])
        self._change = tiled(change)
        self._is_slow = bool(np.isfinite(change).any())
        self._sent = np.clip(tiled([0.0] * len(chosen)), *self._ends)
        self._wanted = tiled([0.0] * robot.model.nu)
        ranges = control_ranges(robot)
        self._low, self._high = (tiled(each) for each in ranges)
        self._never_cuts_controls = self._stay_within(ranges, targets)
        self.cut = TickLog((*commands, *control_names(robot.model)))
        self._tick = 0

    def _stay_within(self, ranges: tuple[Array, Array], targets: Array) -> bool:
        """Whether no commands within their limits, with no targets, take a control out of its range."""
        parts = [self._mixing * end[0] for end in self._ends]
        least = np.minimum(*parts).sum(axis=1) + targets.min(axis=0)
        most = np.maximum(*parts).sum(axis=1) + targets.max(axis=0)
        return bool(((least >= ranges[0]) & (most <= ranges[1])).all())

    def restart(self, robots: NDArray[np.int64]) -> None:
        """Forget what was sent to some robots, which start again."""
        self._sent[robots] = np.clip(0.0, *(each[robots] for each in self._ends))

    def __call__(self, commands: Array, targets: Array, ctrl: Array) -> None:
        """Write the controls of a tick: what the reference wants plus the commands times their factors.

        Args:
            commands: Shape (B, m), SI units.
            targets: What the reference wants; shape (B, nu) or (1, nu).
            ctrl: Takes the controls; shape (B, nu).
        """
        low, high = self._ends
        if self._is_slow:
            low = np.maximum(low, self._sent - self._change)
            high = np.minimum(high, self._sent + self._change)
        sent = np.maximum(commands, low, out=self._sent)
        np.minimum(sent, high, out=sent)  # in two steps: a quarter of the time of `np.clip`
        if self._never_cuts_controls:
            np.vecdot(sent[:, None], self._mixing, ctrl)
            np.add(ctrl, targets, ctrl)
            if sent.tobytes() != commands.tobytes():
                self._wanted[:] = ctrl
                self._note(commands, sent, ctrl)
            self._tick += 1
            return
        np.vecdot(sent[:, None], self._mixing, self._wanted)
        np.add(self._wanted, targets, self._wanted)
        np.fmax(self._wanted, self._low, out=ctrl)  # as quick as `maximum`, and leaves nothing but numbers
        np.fmin(ctrl, self._high, out=ctrl)
        # Comparing bytes costs a tenth of looking into the arrays.
        if self._wanted.tobytes() != ctrl.tobytes() or sent.tobytes() != commands.tobytes():
            self._note(commands, sent, ctrl)
        self._tick += 1

    def _note(self, commands: Array, sent: Array, ctrl: Array) -> None:
        """Note what was cut; of commands also those that take part in a control that was."""
        controls = self._wanted != ctrl
        takes_part = (controls @ (self._mixing != 0)) & (sent != 0)
        flags = np.hstack([(commands != sent) | takes_part, controls])
        if flags.any():  # zero may have got another sign, which is no cut
            self.cut.add(self._tick, flags)


def control_names(model: mujoco.MjModel) -> list[str]:
    """The name of each control: that of its actuator; shape (nu,)."""
    names = [""] * model.nu
    for i in range(model.nactuator):
        first = int(model.actuator_ctrladr[i])
        for place in range(first, first + int(model.actuator_ctrlnum[i])):
            names[place] = model.actuator(i).name or f"actuator {i}"
    return names
