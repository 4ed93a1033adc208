"""Holds the paper's design equations (13, 16, 17, 19-22) and the bound of the DCM, each with its inverses.

Plain functions of numbers in SI units. What goes into a circuit file is the weight w, the angle that a fully
active neuron adds to the ankle in a step (eqs. 14 and 15). `design_sheet` applies them all to one push
and says where each is valid; docs/design.md says what they leave out.
"""

from __future__ import annotations

import math

from circuitkit.base.errors import InputError, Problem
from circuitkit.biped.gait.lipm import GRAVITY_M_S2, largest_push_force, natural_frequency

_NO_LEAK = 1e-15  # below it, one minus the leak is one


def require_positive(**values: float) -> None:
    """Refuse numbers that are not positive and finite.

    Args:
        values: By name; the name stands in the message.

    Raises:
        InputError: One is zero, negative, infinite or not a number; all of them are listed.
    """
    _require({name: (value, 0 < value < math.inf) for name, value in values.items()}, "more than 0")


def require_not_negative(**values: float) -> None:
    """Refuse numbers that are negative, infinite or not numbers; see `require_positive`."""
    _require({name: (value, 0 <= value < math.inf) for name, value in values.items()}, "0 or more")


def _require(values: dict[str, tuple[float, bool]], allowed: str) -> None:
    problems = [
        Problem("", 0, 0, name, f"found {value:g}; allowed: {allowed}")
        for name, (value, right) in values.items()
        if not right
    ]
    if problems:
        raise InputError(*problems)


def com_acceleration_from_torque(torque_nm: float, mass_kg: float, com_height_m: float) -> float:
    """y_CoM'' = T / (m z_CoM), in m/s^2 (eq. 13).

    Valid for a sole that stays flat, which `torque_at_edge` limits. T is the torque at the joint: the paper
    puts in the stall torque of the motor, 73.44 mN m, and forgets the gear (`joint_torque`).

    Args:
        torque_nm: T, at the joint; of either sign.
        mass_kg: m.
        com_height_m: z_CoM.

    Raises:
        InputError: Mass or height is not positive.
    """
    require_positive(mass_kg=mass_kg, com_height_m=com_height_m)
    return torque_nm / (mass_kg * com_height_m)


def torque_from_com_acceleration(com_acceleration: float, mass_kg: float, com_height_m: float) -> float:
    """T = m z_CoM y_CoM'', in N m: the inverse of eq. 13.

    Args:
        com_acceleration: y_CoM'', [m/s^2].
        mass_kg: m.
        com_height_m: z_CoM.

    Raises:
        InputError: Mass or height is not positive.
    """
    require_positive(mass_kg=mass_kg, com_height_m=com_height_m)
    return mass_kg * com_height_m * com_acceleration


def joint_torque(motor_torque_nm: float, gear_ratio: float) -> float:
    """T = N T_motor, in N m: what a motor with a gear gives at the joint, without friction.

    NAO's ankle roll: 201.3 times 73.44 mN m is 14.8 N m.

    Args:
        motor_torque_nm: T_motor.
        gear_ratio: N, turns of the motor for one of the joint.

    Raises:
        InputError: The ratio is not positive.
    """
    require_positive(gear_ratio=gear_ratio)
    return gear_ratio * motor_torque_nm


def zmp_shift_from_acceleration(com_acceleration: float, com_height_m: float) -> float:
    """(z_CoM / g) y_CoM'', in metres: the second term of eq. 2, by which accelerating moves the ZMP.

    With eq. 13 it is T / (m g), whatever the height: 0.0014 m for the paper's torque without gear.

    Args:
        com_acceleration: y_CoM'', [m/s^2].
        com_height_m: z_CoM.

    Raises:
        InputError: The height is not positive.
    """
    require_positive(com_height_m=com_height_m)
    return com_height_m / GRAVITY_M_S2 * com_acceleration


def torque_at_edge(edge_m: float, mass_kg: float) -> float:
    """T = m g e, in N m: the ankle torque at which the sole begins to turn about its edge.

    Eq. 13 through eq. 2 with the ZMP at the edge. For NAO it is a seventh of what the joint could give, so
    the foot's edge is what limits the ankle, not its motor.

    Args:
        edge_m: e, from the ankle to the edge of the sole.
        mass_kg: m, all of it on this foot.

    Raises:
        InputError: Mass or distance is not positive.
    """
    require_positive(edge_m=edge_m, mass_kg=mass_kg)
    return mass_kg * GRAVITY_M_S2 * edge_m


def com_shift_from_angle(angle_rad: float, com_height_m: float) -> float:
    """dy_CoM = sin(dtheta) z_CoM, in metres (eq. 16).

    Valid for a body that turns about its ankle as one piece. Where the hip turns back to keep the torso
    upright (eq. 5), the CoM moves by less: put the measured lever in place of z_CoM, 0.152 m for NAO.

    Args:
        angle_rad: dtheta, up to a quarter turn to either side.
        com_height_m: z_CoM.

    Raises:
        InputError: The height is not positive, or the angle is more than a quarter turn.
    """
    require_positive(com_height_m=com_height_m)
    if not abs(angle_rad) <= math.pi / 2:
        message = f"found {math.degrees(angle_rad):g} deg; allowed: -90 deg to 90 deg"
        raise InputError(Problem("", 0, 0, "angle_rad", message))
    return math.sin(angle_rad) * com_height_m


def weight_from_com_shift(com_shift_m: float, com_height_m: float) -> float:
    """W = asin(dy_CoM / z_CoM), in radians a step (eq. 17, from eqs. 15 and 16).

    Args:
        com_shift_m: dy_CoM in one step; not beyond z_CoM, where asin ends.
        com_height_m: z_CoM, or the measured lever (`com_shift_from_angle`).

    Raises:
        InputError: The height is not positive, or no angle shifts the CoM so far.
    """
    require_positive(com_height_m=com_height_m)
    if not abs(com_shift_m) <= com_height_m:
        message = (
            f"no angle shifts the CoM by {com_shift_m:g} m in a step: found more than its height; "
            f"allowed: up to {com_height_m:g} m"
        )
        raise InputError(Problem("", 0, 0, "com_shift_m", message))
    return math.asin(com_shift_m / com_height_m)


def com_velocity_against_push(force_n: float, duration_s: float, mass_kg: float, gamma: float = 1.0) -> float:
    """y_CoM' = gamma dt F_ext / m, in m/s: what the ankles must give to the CoM (eqs. 18 and 19).

    Valid for pushes of less than a second, as the paper says: it has the body accelerate by F_ext / m all the
    while, and leaves out that a body that leans falls on by itself.

    Args:
        force_n: F_ext.
        duration_s: dt.
        mass_kg: m.
        gamma: The safety factor; 1 matches the push exactly, the paper has 1.01 (Fig. 7) and 1.1 (4.2).

    Raises:
        InputError: Mass or factor is not positive, or force or duration is negative.
    """
    require_positive(mass_kg=mass_kg, gamma=gamma)
    require_not_negative(force_n=force_n, duration_s=duration_s)
    return gamma * duration_s * force_n / mass_kg


def com_velocity_from_shift(com_shift_m: float, step_s: float) -> float:
    """y_CoM' = dy_CoM / t_step, in m/s (eq. 20).

    The shift is an increment, made again in every step. It says nothing of the acceleration from rest to this
    velocity, which the foot's edge bounds (eqs. 2 and 22).

    Args:
        com_shift_m: dy_CoM of one step.
        step_s: t_step.

    Raises:
        InputError: The step is not positive.
    """
    require_positive(step_s=step_s)
    return com_shift_m / step_s


def com_shift_from_velocity(com_velocity: float, step_s: float) -> float:
    """dy_CoM = y_CoM' t_step, in metres: the inverse of eq. 20.

    Args:
        com_velocity: y_CoM', [m/s].
        step_s: t_step.

    Raises:
        InputError: The step is not positive.
    """
    require_positive(step_s=step_s)
    return com_velocity * step_s


def weight_against_push(
    force_n: float,
    duration_s: float,
    mass_kg: float,
    com_height_m: float,
    step_s: float,
    gamma: float = 1.0,
) -> float:
    """W = asin(gamma dt F_ext t_step / (m z_CoM)), in radians a step (eq. 21, from eqs. 17, 19 and 20).

    Valid where all of these are, and as long as the sum of the increments stays under the ankle's limit, 22
    degrees in the paper. Its w grows with the duration, while the increments add up over it as well.

    Args:
        force_n: F_ext.
        duration_s: dt, less than a second.
        mass_kg: m.
        com_height_m: z_CoM, or the measured lever (`com_shift_from_angle`).
        step_s: t_step.
        gamma: The safety factor.

    Raises:
        InputError: A number has the wrong sign, or the push asks for more than asin can give.
    """
    velocity = com_velocity_against_push(force_n, duration_s, mass_kg, gamma)
    return weight_from_com_shift(com_shift_from_velocity(velocity, step_s), com_height_m)


def angle_after_steps(weight_rad: float, steps: float, leak: float = 0.0) -> float:
    """Theta = w (1 - (1 - l)^n) / l, in radians: what the increments of n steps add up to (eqs. 14 and 15).

    Valid for a neuron that is fully active all the while. The leak l, the part of the angle that is lost in a
    step, is not in the paper; without it the sum is n w, with it the angle ends at w / l.

    Args:
        weight_rad: w.
        steps: n; a duration over t_step.
        leak: l, from 0 to 1.

    Raises:
        InputError: The number of steps is negative, or the leak is outside 0 to 1.
    """
    require_not_negative(steps=steps, leak=leak)
    if leak > 1:
        raise InputError(Problem("", 0, 0, "leak", f"found {leak:g}; allowed: 0 to 1"))
    if leak < _NO_LEAK:
        return weight_rad * steps
    kept = math.expm1(steps * math.log1p(-leak)) if leak < 1 else -float(steps > 0)
    return weight_rad * -kept / leak


def force_for_weight(
    weight_rad: float,
    duration_s: float,
    mass_kg: float,
    com_height_m: float,
    step_s: float,
    gamma: float = 1.0,
) -> float:
    """F_ext = m z_CoM sin(w) / (gamma dt t_step), in newtons: eq. 21 for the largest force of a w.

    Args:
        weight_rad: w, from 0 to a quarter turn.
        duration_s: dt.
        mass_kg: m.
        com_height_m: z_CoM, or the measured lever.
        step_s: t_step.
        gamma: The safety factor.

    Raises:
        InputError: A number is not positive, or w is negative or more than a quarter turn.
    """
    require_positive(duration_s=duration_s, mass_kg=mass_kg, step_s=step_s, gamma=gamma)
    require_not_negative(weight_rad=weight_rad)
    shift = com_shift_from_angle(weight_rad, com_height_m)
    return mass_kg * com_velocity_from_shift(shift, step_s) / (gamma * duration_s)


def duration_for_weight(
    weight_rad: float,
    force_n: float,
    mass_kg: float,
    com_height_m: float,
    step_s: float,
    gamma: float = 1.0,
) -> float:
    """Dt = m z_CoM sin(w) / (gamma F_ext t_step), in seconds: eq. 21 for the longest push of a w.

    Force and duration enter eq. 21 as their product, so this is `force_for_weight` with F_ext for dt, and its
    arguments and errors are those.
    """
    require_positive(force_n=force_n)
    return force_for_weight(weight_rad, force_n, mass_kg, com_height_m, step_s, gamma)


def gamma_of_weight(
    weight_rad: float, force_n: float, duration_s: float, mass_kg: float, com_height_m: float, step_s: float
) -> float:
    """Gamma = m z_CoM sin(w) / (dt F_ext t_step), dimensionless: eq. 21 for the safety factor that a w has.

    Below 1 the CoM moves more slowly than the push moves it, against eq. 18. The paper's 1.63 degrees has
    0.995 for its own push of 20 N and 0.2 s. Arguments and errors are those of `force_for_weight`.
    """
    require_positive(force_n=force_n)
    return force_for_weight(weight_rad, duration_s, mass_kg, com_height_m, step_s) / force_n


def largest_lasting_force(distance_m: float, mass_kg: float, com_height_m: float) -> float:
    """F_ext = m g (y_CoM - y_ZMP) / z_CoM, in newtons: the largest force that can be held for ever (eq. 22).

    The paper puts the CoM at its best place, 0.06 m, and the ZMP at the edge, -0.06 m, which gives 22.58 N
    with g = 9.81 (it prints 22.48). Valid for a CoM at rest; one that moves has its DCM in the place of y_CoM
    (`biped.gait.lipm.dcm`).

    Args:
        distance_m: y_CoM - y_ZMP, from the CoM or DCM to the edge.
        mass_kg: m.
        com_height_m: z_CoM.

    Raises:
        InputError: Mass or height is not positive, or the distance is negative.
    """
    require_positive(mass_kg=mass_kg, com_height_m=com_height_m)
    require_not_negative(distance_m=distance_m)
    return mass_kg * GRAVITY_M_S2 * distance_m / com_height_m


def distance_for_lasting_force(force_n: float, mass_kg: float, com_height_m: float) -> float:
    """y_CoM - y_ZMP = F_ext z_CoM / (m g), in metres: the inverse of eq. 22.

    Args:
        force_n: F_ext.
        mass_kg: m.
        com_height_m: z_CoM.

    Raises:
        InputError: Mass or height is not positive, or the force is negative.
    """
    require_positive(mass_kg=mass_kg, com_height_m=com_height_m)
    require_not_negative(force_n=force_n)
    return force_n * com_height_m / (mass_kg * GRAVITY_M_S2)


def largest_force_for_duration(
    distance_m: float, duration_s: float, mass_kg: float, com_height_m: float
) -> float:
    """F = m omega^2 L / (1 - exp(-omega d)), in newtons: the bound of the DCM, see `biped.gait.lipm`.

    Valid for a point mass at a constant height over feet that stay; the arms, the hips and a step can do
    more. Eq. 22 is its limit for a lasting push.

    Args:
        distance_m: L, from the DCM at the start of the push to the last edge that can be reached.
        duration_s: d; may be infinite.
        mass_kg: m.
        com_height_m: z_CoM.

    Raises:
        InputError: Duration, mass or height is not positive, or the distance is negative.
    """
    require_positive(mass_kg=mass_kg, com_height_m=com_height_m)
    require_not_negative(distance_m=distance_m)
    if duration_s != math.inf:
        require_positive(duration_s=duration_s)
    return largest_push_force(distance_m, duration_s, mass_kg, com_height_m)


def longest_duration_for_force(
    distance_m: float, force_n: float, mass_kg: float, com_height_m: float
) -> float:
    """D = -ln(1 - m omega^2 L / F) / omega, in seconds: how long a force can be held.

    The inverse of `largest_force_for_duration`.

    Args:
        distance_m: L, from the DCM at the start of the push to the last edge that can be reached.
        force_n: F.
        mass_kg: m.
        com_height_m: z_CoM.

    Returns:
        Infinite for a force that can be held for ever (eq. 22).

    Raises:
        InputError: Force, mass or height is not positive, or the distance is negative.
    """
    require_positive(force_n=force_n)
    share = largest_lasting_force(distance_m, mass_kg, com_height_m) / force_n
    if share >= 1.0:
        return math.inf
    return -math.log1p(-share) / natural_frequency(com_height_m)


def distance_for_push(force_n: float, duration_s: float, mass_kg: float, com_height_m: float) -> float:
    """L = F (1 - exp(-omega d)) / (m omega^2), in metres: the distance that a push takes from the DCM.

    What is left of it when the push ends, the ankles can still hold.

    Args:
        force_n: F.
        duration_s: d; may be infinite.
        mass_kg: m.
        com_height_m: z_CoM.

    Raises:
        InputError: Mass or height is not positive, or force or duration is negative.
    """
    if duration_s != math.inf:
        require_not_negative(duration_s=duration_s)
    lasting = distance_for_lasting_force(force_n, mass_kg, com_height_m)
    return lasting * -math.expm1(-natural_frequency(com_height_m) * duration_s)


def force_at_com_height(force_n: float, push_height_m: float, com_height_m: float) -> float:
    """F' = F h / z_CoM, in newtons: the force at the CoM's height that asks as much of the ankles.

    A push at the height h brings the moment F (h - z_CoM) about the CoM as well. A torso that is kept upright
    hands it to the feet: y'' = omega^2 (y - p) + F / m + F (h - z_CoM) / (m z_CoM). Eq. 22 and the bound of
    the DCM are for h = z_CoM; put F' into them. A torso that may turn can hold more.

    Args:
        force_n: F.
        push_height_m: h, above the floor.
        com_height_m: z_CoM.

    Raises:
        InputError: A height is not positive, or the force is negative.
    """
    require_positive(push_height_m=push_height_m, com_height_m=com_height_m)
    require_not_negative(force_n=force_n)
    return force_n * push_height_m / com_height_m


def force_at_height(force_n: float, push_height_m: float, com_height_m: float) -> float:
    """F = F' z_CoM / h, in newtons: the inverse of `force_at_com_height`.

    Args:
        force_n: F', such as a bound for pushes at the CoM's height.
        push_height_m: h, above the floor.
        com_height_m: z_CoM.

    Raises:
        InputError: A height is not positive, or the force is negative.
    """
    require_positive(push_height_m=push_height_m, com_height_m=com_height_m)
    require_not_negative(force_n=force_n)
    return force_n * com_height_m / push_height_m
