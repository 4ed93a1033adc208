"""B robots in MuJoCo, stepped together: commands in, sensor readings out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch
from mujoco.batch import SimulationError as StepError
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.robots.channels import Array
from circuitkit.robots.limits import Limits
from circuitkit.robots.model import RobotModel
from circuitkit.robots.start import StartState
from circuitkit.robots.validity import INVALIDATES, KINDS, first_fault

_NO_SENSORS = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_WHOLE = 1e-6  # far below a time step


def substeps_of(robot: RobotModel, step_s: float) -> int:
    """How many time steps of the model a control step has.

    Raises:
        InputError: It is no whole number of them.
    """
    timestep = float(robot.model.opt.timestep)
    count = step_s / timestep
    if abs(count - round(count)) > _WHOLE or round(count) == 0:
        below = np.floor(count) * timestep
        steps = [f"{step * 1e3:g} ms" for step in (below, below + timestep) if step > 0]
        message = (
            f"found a control step of {step_s * 1e3:g} ms; allowed: a multiple of the model's time step of "
            f"{timestep * 1e3:g} ms, such as {' or '.join(steps)}; or set timestep: "
            f"{_fitting(step_s, count):g} ms "
            f"in the robot file"
        )
        raise InputError(Problem("", 0, 0, "control_step", message))
    return round(count)


def _fitting(step_s: float, count: float) -> float:
    """The largest time step below the model's own that divides a control step and is short to write, [ms]."""
    first = max(int(np.ceil(count)), 1)
    exact = (step_s / n * 1e3 for n in range(first, first + 20))
    return next((ms for ms in exact if abs(ms - float(f"{ms:.3g}")) < 1e-9), step_s / first * 1e3)  # noqa: PLR2004


class Worlds:
    """B worlds with a robot each; a controller adds its commands to what a reference holds.

    MuJoCo works out sensors at the beginning of a time step, before it moves. After `advance`, readings are
    therefore one time step of the model older than positions and velocities; after `begin` they are not.

    Attributes:
        robot: What they are.
        batch: B.
        readings: Sensor readings at the beginning of the last time step, live; shape (B, s).
        qpos: Positions after the last `advance`, live; shape (B, nq).
        qvel: Velocities, live; shape (B, nv).
        limits: Turns commands into controls within their ranges, and knows what it had to cut.
        physics: MuJoCo's batch, for what disturbances change.
        sleeps: Whether bodies at rest may sleep; a world then remembers more than its state.
    """

    def __init__(
        self,
        robot: RobotModel,
        step_s: float,
        targets: Array,
        start_qpos: Array,
        commands: Sequence[str] = (),
        batch: int = 1,
        threads: int | None = None,
    ) -> None:
        """Set up B robots at their start.

        Args:
            robot: What they are.
            step_s: The control step.
            targets: Controls that the reference wants: (T, nu), or (1, nu) for all ticks alike.
            start_qpos: Positions at the start; shape (nq,).
            commands: Which commands the columns of `advance`'s are.
            batch: B.
            threads: Threads that step them; by default as many as there are processors, one for one robot.

        Raises:
            UnknownNameError: The robot does not have one of the commands.
            InputError: The control step is no multiple of the model's time step.
        """
        model = robot.model
        self.robot = robot
        self.batch = batch
        self._substeps = substeps_of(robot, step_s)
        count = min(batch, threads) if threads else (1 if batch == 1 else 0)
        self.sleeps = bool(model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP))
        self.physics = Batch(model, batch, nthread=count, persistent=self.sleeps)
        self._warned = self.physics.warning.tobytes()
        self._inherited = np.zeros((batch, len(KINDS)), dtype=np.int64)
        self._failed: dict[int, str] = {}
        self._targets, self._last_target = targets[:, np.newaxis], len(targets) - 1
        self.limits = Limits(robot, commands, batch, step_s, targets)
        self._ctrl = self.physics.bind("ctrl")
        self._force = self.physics.bind("xfrc_applied")
        self.qpos, self.qvel = self.physics.bind("qpos"), self.physics.bind("qvel")
        self._sensed = self.physics.bind("sensordata") if model.nsensordata else np.zeros((batch, 0))
        self.readings = self._sensed
        self._skips = self._substeps > 1 and not _sensors_remember(model)
        if self._skips:
            self._flags = self.physics.expand("opt.disableflags")
        self._seeing = int(model.opt.disableflags)
        self._stopped: NDArray[np.bool_] = np.zeros(batch, dtype=bool)
        self._leaders: NDArray[np.int64] | None = None
        self._stepped: NDArray[np.int32] | None = None
        self._pose: mujoco.MjData | None = None
        self.qpos[:] = start_qpos
        self.start_from(robot.start)

    def start_from(self, start: StartState) -> None:
        """Give all robots the velocities, states of actuators and mocap bodies of a start."""
        self.qvel[:] = start.qvel
        for name, values in (
            ("act", start.act), ("mocap_pos", start.mocap_pos), ("mocap_quat", start.mocap_quat),
        ):  # fmt: skip
            if values.size:
                self.physics.bind(name)[:] = values

    def begin(self) -> None:
        """Work out the readings at the start, once the state is what it shall be."""
        self._run(self.physics.forward)

    def start_state(self) -> Array:
        """The state of every world now, right after `begin`; for `restart`. Shape (B, n)."""
        state: Array = self.physics.state.copy()
        return state

    def restart(self, robots: NDArray[np.int64], start: Array) -> None:
        """Put some robots back to their start, while the others go on; each then is at a tick of its own.

        Args:
            robots: Their numbers.
            start: What `start_state` gave.
        """
        self.physics.state[robots] = start[robots]
        self.limits.restart(robots)
        self.physics.forward(robots.astype(np.int32))

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

    def rotation(self, body: int, robot: int) -> Array:
        """A body's own axes in the world's frame now, as columns, of one robot; shape (3, 3)."""
        if self._pose is None:
            self._pose = mujoco.MjData(self.robot.model)
        self._pose.qpos[:] = self.qpos[robot]
        mujoco.mj_kinematics(self.robot.model, self._pose)
        turned: Array = self._pose.xmat[body].reshape(3, 3).copy()
        return turned

    def new_faults(self) -> Mapping[int, str] | None:
        """Whose physics has become invalid since the last call, and why; see `validity`.

        Returns:
            By the robots' numbers; None if MuJoCo has warned of nothing since the last call.
        """
        warned = self.physics.warning.tobytes()  # comparing bytes costs a tenth of looking into the array
        if warned == self._warned and not self._failed:
            return None
        now = self.physics.warning
        known = np.frombuffer(self._warned, dtype=now.dtype).reshape(now.shape)[..., 1]
        self._warned = warned
        faulty = ((now[..., 1] > known) & INVALIDATES).any(axis=1)
        model = self.robot.model
        faults = {int(i): first_fault(model, now[i], known[i]) for i in np.flatnonzero(faulty)}
        faults |= self._failed
        self._failed = {}
        if self._leaders is not None:
            led = {i: faults[leader] for i, leader in enumerate(self._leaders.tolist()) if leader in faults}
            faults = led | faults
        return faults

    @property
    def warnings(self) -> NDArray[np.int64]:
        """How often MuJoCo has warned of each robot so far, by kind; shape (B, K), see `validity.KINDS`."""
        own: NDArray[np.int64] = self.physics.warning[..., 1] + self._inherited
        return own if self._leaders is None else own[self._leaders]

    def stop(self, robots: NDArray[np.bool_]) -> None:
        """From now on time stands still for these robots, of all of them; shape (B,).

        Their readings stay what they are, and `advance` costs less.
        """
        self._stopped = robots.copy()
        self._choose()

    def follow(self, leaders: NDArray[np.int64]) -> None:
        """From now on a robot is simulated by its leader; one that is its own leader is simulated itself.

        A robot that did the same as its leader until now and does so from now on has the same positions and
        readings. When it gets another leader, which may be itself, it goes on from the state of the one that
        it followed. Call it before somebody takes `readings`, which are another array afterwards.

        Args:
            leaders: Of each robot, shape (B,); a leader is its own leader.
        """
        if self._leaders is None:
            self.readings = self._sensed.copy()
        else:
            moved, counts = leaders != self._leaders, self.warnings
            self._inherited[moved] = (counts - self.physics.warning[..., 1])[moved]
            self.physics.state[moved] = self.physics.state[self._leaders[moved]]
        self._leaders = leaders.copy()
        self._choose()

    def _choose(self) -> None:
        """Find out which robots are to be stepped."""
        going = ~self._stopped
        if self._leaders is not None:
            going &= self._leaders == np.arange(self.batch)
        self._stepped = None if going.all() else np.flatnonzero(going).astype(np.int32)

    def advance(self, tick: int | NDArray[np.int64], commands: Array) -> None:
        """Send what the reference wants at a tick plus the commands, and let one control step pass.

        Sensors have no memory here, and nobody reads them between two control steps: they are worked out in
        the last time step only, which leaves every bit as it is and saves a fifth of the time. They show the
        state at the beginning of that time step, with the forces that act in it.

        Args:
            tick: Row of the targets; or one for each robot, shape (B,).
            commands: Shape (B, m), SI units.
        """
        if isinstance(tick, int):
            self.limits(commands, self._targets[min(tick, self._last_target)], self._ctrl)
        else:
            self.limits(commands, self._targets[np.minimum(tick, self._last_target), 0], self._ctrl)
        if self._skips:
            self._flags.fill(self._seeing | _NO_SENSORS)
            self._run(self.physics.step, self._stepped, self._substeps - 1)
            self._flags.fill(self._seeing)
            self._run(self.physics.step, self._stepped)
        else:
            self._run(self.physics.step, self._stepped, self._substeps)
        if self._leaders is not None:
            np.take(self._sensed, self._leaders, axis=0, out=self.readings, mode="clip")
            np.copyto(self.qpos, self.qpos[self._leaders])

    def _run(self, call: Callable[..., None], *arguments: object) -> None:
        """Have MuJoCo do something; a robot with which it fails stays as it was, the others go on."""
        try:
            call(*arguments)
        except StepError as error:
            self._failed |= {int(i): f"MuJoCo cannot go on: {self.physics.error(int(i))}" for i in error.ids}


def _sensors_remember(model: mujoco.MjModel) -> bool:
    """Whether a sensor must see every time step: delayed ones, and those of plug-ins."""
    plugged = bool((model.sensor_plugin >= 0).any()) if model.nsensor else False
    return plugged or int(getattr(model, "nhistory", 0)) > 0
