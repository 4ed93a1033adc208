"""How a robot starts: its keyframe, the joints that it holds, and the actuators that hold them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from circuitkit.base.errors import Problem, listing, suggest
from circuitkit.base.units import parse_quantity
from circuitkit.robots.channels import Array
from circuitkit.robots.mjcf import HELD_UNITS, HINGE, OF_JOINT, SLIDE, TYPE_NAMES
from circuitkit.robots.spec import Robot


@dataclass(frozen=True, eq=False)
class StartState:
    """What a model starts with beside its positions.

    Attributes:
        qvel: Velocities; shape (nv,).
        act: States of actuators, such as muscles; shape (na,).
        mocap_pos: Places of the mocap bodies; shape (nmocap, 3), [m].
        mocap_quat: How they stand; shape (nmocap, 4).
    """

    qvel: Array
    act: Array
    mocap_pos: Array
    mocap_quat: Array


def start_state(model: mujoco.MjModel, key: str | None = None) -> StartState:
    """What a keyframe says beside positions and controls; rest without one."""
    data = mujoco.MjData(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, int(model.key(key).id))
    return StartState(data.qvel.copy(), data.act.copy(), data.mocap_pos.copy(), data.mocap_quat.copy())


def _key_names(model: mujoco.MjModel) -> list[str]:
    return [model.key(i).name for i in range(model.nkey)]


def no_keyframe(name: str, keys: Sequence[str]) -> tuple[str, str]:
    """What is wrong with the name of a keyframe that is not there, and what to do."""
    if keys:
        return f"the MJCF has no keyframe '{name}'; allowed: {listing(keys)}", suggest(name, keys)
    message = f"found '{name}', but the MJCF has no keyframes; allowed: no key"
    return message, "hold, such as hold: {JOINT: 10 deg}, puts joints where they start"


def start_of(
    robot: Robot, model: mujoco.MjModel, servos: Mapping[str, float], problems: list[Problem]
) -> tuple[Array, Array, StartState]:
    """Positions at the start, the controls that hold them, and the rest of the state."""
    qpos, ctrl, start = model.qpos0.copy(), np.zeros(model.nu), start_state(model)
    if robot.key is not None:
        keys = _key_names(model)
        if robot.key in keys:
            qpos, ctrl = model.key(robot.key).qpos.copy(), model.key(robot.key).ctrl.copy()
            start = start_state(model, robot.key)
        else:
            problems.append(robot.problem(("key",), *no_keyframe(robot.key, keys)))
    aim(model, {int(model.joint(name).id) for name in servos}, qpos, ctrl, start.act)
    hold_joints(
        model, robot.hold, qpos, ctrl, start.act,
        lambda name, *m: problems.append(robot.problem(("hold", name), *m)),
    )  # fmt: skip
    return qpos, ctrl, start


def aim(model: mujoco.MjModel, joints: Iterable[int], qpos: Array, ctrl: Array, act: Array) -> dict[int, str]:
    """Let the position actuators of some joints hold the joints' positions from the first moment on.

    Force = k (a - length) + b with the gear's length = gear * position: the target a is length - b / k. It is
    the control, or the state of an actuator that filters its control; an integrator's state is a, and its
    control is the speed 0.

    Args:
        model: The model.
        joints: Numbers of the joints.
        qpos: Positions; shape (nq,).
        ctrl: Controls, changed in place; shape (nu,).
        act: States of actuators, changed in place; shape (na,).

    Returns:
        Why a joint is not held, by its number.
    """
    chosen, refused = set(joints), {}
    for i in range(model.nactuator):
        joint = int(model.actuator_trnid[i, 0])
        if not of_joint(model, i) or joint not in chosen or not holds_position(model, i):
            continue
        length = qpos[model.jnt_qposadr[joint]] * model.actuator_gear[model.actuator_outadr[i], 0]
        target = length - model.actuator_biasprm[i, 0] / -model.actuator_biasprm[i, 1]
        if message := _unreachable(model, i, target):
            refused[joint] = message
        place, state = int(model.actuator_ctrladr[i]), int(model.actuator_actadr[i])
        integrates = model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_INTEGRATOR
        ctrl[place] = 0.0 if integrates else target
        if _keeps_target(model, i):
            act[state] = target
    return refused


def _keeps_target(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the first state of a position actuator is the target that it follows."""
    if model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_PID:  # its target is limited in speed, or not
        return bool(model.actuator_dynprm[actuator, 1] > 0)
    return bool(model.actuator_actnum[actuator] > 0)


def _unreachable(model: mujoco.MjModel, actuator: int, target: float) -> str:
    """Why an actuator cannot hold a target, in its own units; empty if it can."""
    name, place = model.actuator(actuator).name, int(model.actuator_ctrladr[actuator])
    integrates = model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR
    bounds = []
    if model.actuator_ctrllimited[place] and not integrates:
        bounds.append(("ctrlrange", model.actuator_ctrlrange[place]))
    if model.actuator_actlimited[actuator] and _keeps_target(model, actuator):
        bounds.append(("actrange", model.actuator_actrange[actuator]))
    for word, (low, high) in bounds:
        if not low <= target <= high:
            return (
                f"its actuator '{name}' would have to be told {target:.6g}, and its {word} is {low:g} to "
                f"{high:g}; allowed: what lies within; or give the joint a servo by servos"
            )
    if model.actuator_history[actuator, 0] > 0:
        return (
            f"its actuator '{name}' gets its controls late and would let go at first; allowed: an actuator "
            "without delay; or give the joint a servo by servos"
        )
    return ""


def hold_joints(
    model: mujoco.MjModel,
    hold: Mapping[str, str],
    qpos: Array,
    ctrl: Array,
    act: Array,
    complain: Callable[..., object],
) -> None:
    """Put joints where they shall be held; position actuators that drive them get the target.

    Args:
        model: The model.
        hold: Angle or position by joint, as text with unit.
        qpos: Positions, changed in place; shape (nq,).
        ctrl: Controls, changed in place; shape (nu,).
        act: States of actuators, changed in place; shape (na,).
        complain: Is told the joint, a message and a hint for each that cannot be held.
    """
    names = [model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) in {HINGE, SLIDE}]
    numbers: dict[int, str] = {}
    for name, text in hold.items():
        if name not in names:
            complain(
                name,
                f"the MJCF has no hinge or slide '{name}'; allowed: {listing(names)}",
                suggest(name, names),
            )
            continue
        joint = int(model.joint(name).id)
        kind = int(model.jnt_type[joint])
        unit, quantity = HELD_UNITS[kind], parse_quantity(text)
        if quantity.dimension != unit.dimension:
            is_a = f"but {name} is a {TYPE_NAMES[kind]}"
            complain(name, f"found '{text}', {is_a}; allowed: a quantity in {unit} or like it")
            continue
        qpos[model.jnt_qposadr[joint]] = quantity.value_si
        numbers[joint] = name
    for joint, message in aim(model, numbers, qpos, ctrl, act).items():
        complain(numbers[joint], message)


def of_joint(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator drives a joint."""
    return int(model.actuator_trntype[actuator]) in {int(kind) for kind in OF_JOINT}


def holds_position(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator pulls its joint to a target: force = k (target - length), and damping.

    The target is its control, or a state that follows the control.
    """
    gain, bias = float(model.actuator_gainprm[actuator, 0]), float(model.actuator_biasprm[actuator, 1])
    if model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_AFFINE:
        return False
    if model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_PID:  # its gain is that of the integral
        inputs = int(model.actuator_ctrlspec[actuator])
        return bias < 0 and bool(inputs & int(mujoco.mjtCtrlInput.mjINPUT_POS))
    plain = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
    return bool(plain and gain > 0 and abs(gain + bias) <= 1e-9 * gain)


def drives_position(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's control is a position; that of an integrator is a speed."""
    integrates = model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR
    return holds_position(model, actuator) and not integrates
