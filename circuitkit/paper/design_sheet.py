"""Applies the design equations to one push: w, the bounds, where the equations are valid, and their traps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.units import format_quantity, parse_unit
from circuitkit.paper import equations as eq

PAPER_GAMMA = 1.01  # Fig. 7
PAPER_STEP_S = 0.01  # section 5.1
PAPER_MOTOR_TORQUE_NM = 73.44e-3  # section 4.2: stall torque, at the motor
NAO_ANKLE_GEAR = 201.3  # between motor and joint of NAO's ankle roll, which eq. 13 forgets
SHORT_PUSH_S = 1.0  # section 4.2: "short duration (less than one second)"
_EXACTLY = 1e-9  # of a step: an angle that is reached exactly is reached
_UNITS = {"m": "mm", "N": "N", "s": "ms", "rad": "deg", "rad/s": "deg/s", "N*m": "N*m"}


@dataclass(frozen=True)
class Body:
    """What the equations need to know of a robot.

    Attributes:
        name: Of the robot, for the sheet.
        mass_kg: m.
        com_height_m: z_CoM.
        ankle_limit_rad: How far the ankle turns to either side.
        joint_torque_nm: Stall torque of the ankle at the joint, behind the gear.
        joint_speed_rad_s: No-load speed of the ankle at the joint; None if it is not known.
        sole_edge_m: From the ankle to the nearest edge of its sole; None if it is not known.
        lever_m: By how much the CoM shifts with the ankle, in units of its sine: what eq. 16 takes for z_CoM;
            None if nobody measured it.
        torso_height_m: Of the CoM of the torso alone, above the floor, where pushes on the torso act; None if
            it is not known.
    """

    name: str
    mass_kg: float
    com_height_m: float
    ankle_limit_rad: float
    joint_torque_nm: float
    joint_speed_rad_s: float | None = None
    sole_edge_m: float | None = None
    lever_m: float | None = None
    torso_height_m: float | None = None


PAPER_BODY = Body(
    name="the paper's NAO",
    mass_kg=5.18,
    com_height_m=0.27,
    ankle_limit_rad=math.radians(22.0),
    joint_torque_nm=eq.joint_torque(PAPER_MOTOR_TORQUE_NM, NAO_ANKLE_GEAR),
)


@dataclass(frozen=True)
class Reach:
    """How far the ZMP can be brought beyond the CoM at rest, or beyond the DCM of a body that moves.

    Attributes:
        direction: Of the push, such as `outward`; empty if there is but one.
        distance_m: y_CoM - y_ZMP of eq. 22, L of the bound of the DCM.
    """

    direction: str
    distance_m: float


PAPER_REACH = Reach("", 0.12)  # section 4.2: the CoM at 0.06 m, the edge at -0.06 m


@dataclass(frozen=True)
class Bound:
    """What a point mass over its feet can hold in one direction.

    Attributes:
        reach: The direction and its distance.
        lasting_force_n: For ever (eq. 22).
        force_n: For the duration of the push (bound of the DCM).
        force_at_com_n: The same for a push at the height of the CoM, as the point mass has it.
        duration_s: How long the force of the push; infinite if for ever.
        under_lasting: Whether the push is under eq. 22.
        under_bound: Whether the push is under the bound of the DCM.
    """

    reach: Reach
    lasting_force_n: float
    force_n: float
    force_at_com_n: float
    duration_s: float
    under_lasting: bool
    under_bound: bool


@dataclass(frozen=True)
class Check:
    """One condition under which the equations mean what they say.

    Attributes:
        name: Of the condition.
        allowed: Up to where it is met.
        found: What this push has.
        met: Whether it is met.
    """

    name: str
    allowed: str
    found: str
    met: bool


@dataclass(frozen=True)
class Sheet:
    """The design for one push.

    Attributes:
        body: The robot.
        force_n: F_ext.
        duration_s: dt.
        weight_rad: w, in a step (eq. 21).
        gamma: The safety factor.
        step_s: t_step.
        leak: Part of the angle that is lost in a step.
        push_height_m: Where the push acts, above the floor.
        com_velocity: What the ankles must give to the CoM, [m/s] (eq. 19).
        com_shift_m: How far the CoM must shift in a step (eqs. 16 and 20).
        weight_by_lever_rad: w with the measured lever in the place of z_CoM; None if there is none, or if no
            angle shifts the CoM so far.
        bounds: One for each direction.
        checks: Where the equations are valid.
        traps: What they leave out, in this robot's numbers.
    """

    body: Body
    force_n: float
    duration_s: float
    weight_rad: float
    gamma: float
    step_s: float
    leak: float
    push_height_m: float
    com_velocity: float
    com_shift_m: float
    weight_by_lever_rad: float | None
    bounds: tuple[Bound, ...]
    checks: tuple[Check, ...]
    traps: tuple[str, ...]

    @property
    def setting(self) -> str:
        """What to set in the circuit, such as `w=1.655deg`."""
        return f"w={math.degrees(self.weight_rad):.4g}deg"


def make_sheet(
    body: Body = PAPER_BODY,
    reaches: Sequence[Reach] = (PAPER_REACH,),
    *,
    force_n: float | None = None,
    duration_s: float | None = None,
    weight_rad: float | None = None,
    gamma: float | None = None,
    step_s: float | None = None,
    leak: float | None = None,
    push_height_m: float | None = None,
) -> Sheet:
    """Work out the third of force, duration and w from two of them (eq. 21), and all that goes with it.

    Args:
        body: The robot.
        reaches: In which directions it can be pushed, and how far the feet reach there.
        force_n: F_ext.
        duration_s: dt.
        weight_rad: w, in a step.
        gamma: The safety factor; that of the paper's Fig. 7 if None.
        step_s: t_step; the paper's if None.
        leak: Part of the angle that is lost in a step; none, as in the paper, if None.
        push_height_m: Where the push acts, above the floor; if None on the torso, or at the CoM where the
            torso's height is not known. Eq. 21 does not ask.

    Raises:
        InputError: Not two are given, a number is not positive, or the push asks for more than asin can give.
    """
    gamma = PAPER_GAMMA if gamma is None else gamma
    step_s = PAPER_STEP_S if step_s is None else step_s
    if push_height_m is None:
        push_height_m = body.torso_height_m or body.com_height_m
    eq.require_positive(
        **{
            name: value
            for name, value in _named(force_n, duration_s, weight_rad).items()
            if value is not None
        }
    )
    force, duration, weight = _complete(body, force_n, duration_s, weight_rad, gamma, step_s)
    velocity = eq.com_velocity_against_push(force, duration, body.mass_kg, gamma)
    shift = eq.com_shift_from_velocity(velocity, step_s)
    bounds = tuple(_bound(body, reach, force, duration, push_height_m) for reach in reaches)
    return Sheet(
        body=body,
        force_n=force,
        duration_s=duration,
        weight_rad=weight,
        gamma=gamma,
        step_s=step_s,
        leak=leak or 0.0,
        push_height_m=push_height_m,
        com_velocity=velocity,
        com_shift_m=shift,
        weight_by_lever_rad=_weight_by_lever(body, shift),
        bounds=bounds,
        checks=tuple(_checks(body, duration, weight, shift, step_s, leak or 0.0)),
        traps=tuple(_traps(body, weight, push_height_m)),
    )


def _named(
    force_n: float | None, duration_s: float | None, weight_rad: float | None
) -> dict[str, float | None]:
    return {"force": force_n, "duration": duration_s, "w": weight_rad}


def _complete(
    body: Body,
    force_n: float | None,
    duration_s: float | None,
    weight_rad: float | None,
    gamma: float,
    step_s: float,
) -> tuple[float, float, float]:
    """Complete force, duration and w, of which one is not given."""
    mass, height = body.mass_kg, body.com_height_m
    if weight_rad is None and force_n is not None and duration_s is not None:
        weight = eq.weight_against_push(force_n, duration_s, mass, height, step_s, gamma)
        return force_n, duration_s, weight
    if duration_s is None and force_n is not None and weight_rad is not None:
        duration = eq.duration_for_weight(weight_rad, force_n, mass, height, step_s, gamma)
        return force_n, duration, weight_rad
    if force_n is None and duration_s is not None and weight_rad is not None:
        force = eq.force_for_weight(weight_rad, duration_s, mass, height, step_s, gamma)
        return force, duration_s, weight_rad
    given = [name for name, value in _named(force_n, duration_s, weight_rad).items() if value is not None]
    found = " and ".join(given) if given else "none of them"
    message = f"found {found}; allowed: two of force, duration and w; eq. 21 gives the third"
    raise InputError(Problem("", 0, 0, "", message))


def _bound(body: Body, reach: Reach, force_n: float, duration_s: float, push_height_m: float) -> Bound:
    mass, height, distance = body.mass_kg, body.com_height_m, reach.distance_m
    point_mass = eq.largest_force_for_duration(distance, duration_s, mass, height)
    lasting, short = (
        eq.force_at_height(force, push_height_m, height)
        for force in (eq.largest_lasting_force(distance, mass, height), point_mass)
    )
    at_com = eq.force_at_com_height(force_n, push_height_m, height)
    longest = eq.longest_duration_for_force(distance, at_com, mass, height)
    return Bound(reach, lasting, short, point_mass, longest, force_n <= lasting, force_n <= short)


def _weight_by_lever(body: Body, shift_m: float) -> float | None:
    if body.lever_m is None or shift_m > body.lever_m:
        return None
    return eq.weight_from_com_shift(shift_m, body.lever_m)


def _checks(
    body: Body, duration_s: float, weight_rad: float, shift_m: float, step_s: float, leak: float
) -> Iterator[Check]:
    """Check the conditions under which eq. 21 means what it says."""
    yield Check(
        "a short push (section 4.2)",
        f"less than {show(SHORT_PUSH_S, 's')}",
        show(duration_s, "s"),
        duration_s < SHORT_PUSH_S,
    )
    yield Check(
        "asin's argument (eq. 17)",
        "up to 1",
        f"{shift_m / body.com_height_m:.3g}",
        shift_m <= body.com_height_m,
    )
    reached = eq.angle_after_steps(weight_rad, duration_s / step_s, leak)
    met = reached <= body.ankle_limit_rad * (1 + _EXACTLY)
    after = "" if met else f"; the limit comes after {show(_until(body, weight_rad, leak) * step_s, 's')}"
    yield Check(
        "the ankle's range, p fully active all the while",
        f"up to {show(body.ankle_limit_rad, 'rad')}",
        f"{show(reached, 'rad')}{after}",
        met,
    )
    if body.joint_speed_rad_s is not None:
        speed = weight_rad / step_s
        yield Check(
            "the ankle's speed",
            f"up to {show(body.joint_speed_rad_s, 'rad/s')}",
            show(speed, "rad/s"),
            speed <= body.joint_speed_rad_s,
        )


def _until(body: Body, weight_rad: float, leak: float) -> int:
    """Count the whole steps within the ankle's range, whose end is w (1 - (1 - l)^n) / l."""
    steps = body.ankle_limit_rad / weight_rad
    if leak > 0:
        steps = math.log1p(-leak * steps) / math.log1p(-leak) if leak < 1 else 0.0
    return math.floor(steps + _EXACTLY)


def _traps(body: Body, weight_rad: float, push_height_m: float) -> Iterator[str]:
    """Say what the equations leave out, in numbers of this robot."""
    mass, height = body.mass_kg, body.com_height_m
    bare = eq.zmp_shift_from_acceleration(
        eq.com_acceleration_from_torque(PAPER_MOTOR_TORQUE_NM, mass, height), height
    )
    geared = eq.zmp_shift_from_acceleration(
        eq.com_acceleration_from_torque(body.joint_torque_nm, mass, height), height
    )
    edge = "the foot's edge limits it"
    if body.sole_edge_m is not None:
        turning = show(eq.torque_at_edge(body.sole_edge_m, mass), "N*m")
        edge = f"{edge}: {show(body.sole_edge_m, 'm')} from the ankle, {turning}"
    yield (
        "Eq. 13 forgets the gear: the ankle's stall torque at the joint is "
        f"{show(body.joint_torque_nm, 'N*m')}, not {PAPER_MOTOR_TORQUE_NM:g} N*m. It could move the ZMP by "
        f"{show(geared, 'm')}, not by {show(bare, 'm')}; {edge}."
    )
    lever = "by less"
    if body.lever_m is not None:
        lever = f"by {show(body.lever_m, 'm')} times the sine, not {show(height, 'm')}"
    yield f"Eq. 16 turns the body as one piece; with hips that turn back (eq. 5) the CoM moves {lever}."
    offset = eq.com_shift_from_angle(min(weight_rad, math.pi / 2), body.lever_m or height)
    yield (
        f"w is an increment, added in every step (eq. 20). Added once, {show(weight_rad, 'rad')} moves the "
        f"CoM by {show(offset, 'm')}; the paper does not say how the angle returns (the circuit's leak)."
    )
    if push_height_m == height:
        yield (
            f"The bounds are for a push at the height of the CoM, {show(height, 'm')}; higher up it is "
            "harder to hold, by its height over that of the CoM, while the torso is kept upright."
        )
    else:
        worth = eq.force_at_com_height(1.0, push_height_m, height)
        yield (
            f"The bounds are for a push {show(push_height_m, 'm')} above the floor, worth {worth:.3g} times "
            "what it would be at the height of the CoM, while the torso is kept upright."
        )
    yield (
        "Eq. 21 has no sign. A network that reads the ZMP holds with a negative w, towards the violated edge "
        "(binn_lateral_tuned), one that reads the capture point with the sign of eq. 14 "
        "(binn_lateral_capture); try both on the robot."
    )


def show(value: float, unit: str, digits: int = 4) -> str:
    """Write an SI value as it is read best, such as `22.58 N`; `for ever` if it is no finite time.

    Args:
        value: In SI units.
        unit: Its SI unit.
        digits: Significant digits.
    """
    if unit == "s" and math.isinf(value):
        return "for ever"
    shown = "s" if unit == "s" and value >= 1.0 else _UNITS.get(unit, unit)
    return format_quantity(value, parse_unit(shown), digits)
