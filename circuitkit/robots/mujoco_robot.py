"""B robots in MuJoCo, stepped together: targets in, sensor readings out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.gait import LEG_JOINTS, GaitSpec, Walk, plan_walk
from circuitkit.biped.dynamics import BodyDynamics, generalised_positions, joint_targets
from circuitkit.robots.model import RobotModel
from circuitkit.biped.sensing import Channel, Observer, channels

Array = NDArray[np.float64]

_NO_SENSORS = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)


def plan_robot_walk(robot: RobotModel, gait: GaitSpec, ticks: int) -> tuple[Walk, Array]:
    """A walk that is right for this robot's whole body, and what to send to its servos.

    A servo of stiffness k that must hold a torque stays behind its target by torque / k. The torques along
    the walk are known beforehand, so the targets are set ahead by as much: the joints then follow the walk,
    but for a lag of damping / stiffness times their rate, 1.8 degrees (root mean square) in the rolls.

    Args:
        robot: The robot.
        gait: The walk's numbers.
        ticks: T.

    Returns:
        The walk, and the targets of all servos, shape (T, n), [rad].

    Raises:
        InputError: The gait's control step is no multiple of the model's time step.
        SimulationError: A leg cannot reach its foot.
    """
    substeps = gait.control_step / robot.model.opt.timestep
    if abs(substeps - round(substeps)) > 1e-6:  # noqa: PLR2004 - far below a step
        found = f"control_step is {gait.control_step * 1e3:g} ms"
        message = f"{found}; allowed: a multiple of the model's {robot.model.opt.timestep * 1e3:g} ms"
        raise InputError(Problem("", 1, 1, f"gait {gait.gait}", message))
    body = BodyDynamics(robot)
    walk, torques = plan_walk(gait, robot.spec.legs.geometry(), ticks, body.zmp, body.torques)
    if torques is None:  # never: `then` was given
        torques = np.zeros((ticks, len(robot.actuated)))
    return walk, joint_targets(robot, walk) + torques / robot.stiffness


class MujocoRobot:
    """B robots of one kind that follow walks; a controller adds angles to the walk's joints.

    Attributes:
        model: What they are.
        batch: B.
        readings: Sensor readings after the last `advance`, live; shape (B, s).
        qpos: Positions after the last `advance`, live; shape (B, nq).
    """

    def __init__(
        self,
        model: RobotModel,
        walk: Walk,
        targets: Array,
        commands: Sequence[str] = (),
        batch: int = 1,
        threads: int | None = None,
    ) -> None:
        """Set B robots on their feet at the start of the walk.

        Args:
            model: What they are.
            walk: Where they start, and the control step.
            targets: Of all servos: (T, n) for all robots alike, or (T, B, n), [rad].
            commands: Channels that the columns of `advance`'s commands are.
            batch: B.
            threads: Threads that step them; by default as many as there are processors, one for one robot.

        Raises:
            UnknownNameError: A channel that the robot does not have.
        """
        self.model = model
        self.batch = batch
        count = min(batch, threads) if threads else (1 if batch == 1 else 0)
        self._worlds = Batch(model.model, batch, nthread=count)
        self._substeps = round(walk.gait.control_step / model.model.opt.timestep)
        self._targets = targets
        self._mixing = self._command_matrix(commands)
        self._ctrl = self._worlds.bind("ctrl")
        self._force = self._worlds.bind("xfrc_applied")
        self.qpos = self._worlds.bind("qpos")
        self._qvel = self._worlds.bind("qvel")
        self.readings = self._worlds.bind("sensordata")
        self._flags = self._worlds.expand("opt.disableflags")
        self._seeing = int(model.model.opt.disableflags)
        self._stepped: NDArray[np.int32] | None = None
        self.qpos[:] = generalised_positions(model, walk)[0]
        self._worlds.forward()

    @cached_property
    def observations(self) -> dict[str, Channel]:
        """Channels that a controller may read."""
        return robot_channels(self.model)

    def observer(self, names: Sequence[str]) -> Observer:
        """Computes the named channels from `readings`.

        Raises:
            UnknownNameError: There is no such channel; lists those there are.
        """
        return Observer(self.model.layout, self.observations, names)

    def set_base_velocity(self, velocity: Array) -> None:
        """Velocity of the torso, forward and left; shape (B, 2), [m/s]."""
        self._qvel[:, :2] = velocity

    def push(self, body: int, force: Array, torque: Array | None = None) -> None:
        """Push a body from now on, with forces at its centre of mass and torques; world frame.

        Args:
            body: Its number.
            force: Shape (B, 3), [N].
            torque: Shape (B, 3), [N m]; as it was if None.
        """
        self._force[:, body, :3] = force
        if torque is not None:
            self._force[:, body, 3:] = torque

    def stop(self, robots: NDArray[np.bool_]) -> None:
        """From now on time stands still for these robots, of all of them; shape (B,).

        Their readings stay what they are, and `advance` costs less.
        """
        going = np.flatnonzero(~robots)
        self._stepped = None if len(going) == self.batch else going.astype(np.int32)

    def advance(self, tick: int, commands: Array) -> None:
        """Send the targets of a tick plus the commands, and let one control step pass.

        Sensors have no memory here, and nobody reads them between two control steps: they are worked out in
        the last time step only, which leaves every bit as it is and saves a fifth of the time.

        Args:
            tick: Row of the walk.
            commands: Shape (B, m), SI units.
        """
        np.vecdot(commands[:, None], self._mixing, self._ctrl)
        np.add(self._ctrl, self._targets[tick], self._ctrl)
        if self._substeps > 1:
            self._flags[:] = self._seeing | _NO_SENSORS
            self._worlds.step(self._stepped, self._substeps - 1)
            self._flags[:] = self._seeing
        self._worlds.step(self._stepped)

    def _command_matrix(self, names: Sequence[str]) -> Array:
        """Weights of the commands for each servo; shape (n, m)."""
        matrix = np.zeros((len(self.model.actuated), len(names)))
        for row, name in zip(matrix.T, names, strict=True):
            if name not in self.model.spec.commands:
                kind = "command of the robot"
                raise UnknownNameError(kind, name, self.model.spec.commands)
            for joint, factor in self.model.spec.commands[name].joints.items():
                row[self.model.leg_index[LEG_JOINTS.index(joint)]] = factor
        return matrix


def robot_channels(model: RobotModel) -> dict[str, Channel]:
    """Channels that a controller of this robot may read."""
    feet = model.spec.feet
    cells = np.array([*feet.left.cells.values(), *feet.right.cells.values()])
    return channels(model.layout, cells, model.spec.legs.hip_offset_y)


def command_units(model: RobotModel) -> dict[str, Unit]:
    """Channels that a controller of this robot may write, with their units."""
    return {name: parse_unit(command.unit) for name, command in model.spec.commands.items()}


def body_number(model: RobotModel, name: str) -> int:
    """Number of a body: torso, left_foot and right_foot as the robot file says, others by their MJCF name.

    Raises:
        UnknownNameError: The robot has no such body; lists those it has.
    """
    roles = {"torso": model.torso_id, "left_foot": model.feet_id[0], "right_foot": model.feet_id[1]}
    bodies = {model.model.body(index).name: index for index in range(1, model.model.nbody)} | roles
    if name not in bodies:
        kind = "body"
        raise UnknownNameError(kind, name, roles | bodies)
    return bodies[name]
