"""The linear inverted pendulum: ZMP, CoM and DCM (capture point), and the largest push that can be held."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

GRAVITY_M_S2 = 9.81

Array = NDArray[np.float64]


def natural_frequency(com_height_m: float) -> float:
    """Omega = sqrt(g / z_CoM), in rad/s."""
    return math.sqrt(GRAVITY_M_S2 / com_height_m)


def zmp_from_com(com_m: Array, com_acceleration: Array, com_height_m: Array | float) -> Array:
    """y_ZMP = y_CoM - (z_CoM / g) y_CoM'', in metres (eq. 2)."""
    return com_m - com_height_m / GRAVITY_M_S2 * com_acceleration


def com_from_zmp(zmp_m: Array, com_height_m: float, step_s: float) -> Array:
    """The CoM motion whose ZMP by eq. 2 is the one given, starting and ending at rest.

    Eq. 2 with a central second difference is a tridiagonal system over all ticks at once. It looks ahead as
    far as it must, so the sway before the first step comes out by itself. Its solution is the bounded one:
    what the ends force upon it dies out as exp(-omega t).

    Args:
        zmp_m: Shape (T, ...); along the first axis is time.
        com_height_m: z_CoM.
        step_s: Time between ticks.

    Returns:
        Shape (T, ...), [m].
    """
    stiffness = com_height_m / GRAVITY_M_S2 / step_s**2
    bands = np.empty((3, len(zmp_m)))
    bands[0] = bands[2] = -stiffness
    bands[1] = 1.0 + 2.0 * stiffness
    bands[1, [0, -1]] = 1.0 + stiffness
    solution: Array = solve_banded((1, 1), bands, zmp_m)
    return solution


def dcm(com_m: Array, com_velocity: Array, com_height_m: float) -> Array:
    """Xi = y + y' / omega, in metres: the divergent part of the motion, also called capture point."""
    return com_m + com_velocity / natural_frequency(com_height_m)


def largest_push_force(
    distance_m: float,
    duration_s: float,
    mass_kg: float,
    com_height_m: float,
    push_height_m: float | None = None,
) -> float:
    """F = m omega^2 L (h / h_p) / (1 - exp(-omega d)), in newtons: the largest push that can be held.

    No controller that keeps the ZMP inside the support can hold more: a constant force moves the point that
    the DCM runs away from by F / (m omega^2), and the DCM must not have left the support when the push ends.
    Eq. 22 is the limit of a lasting push.

    A push at another height than the CoM's, h, brings a moment F (h_p - h) as well. A torso that is kept
    upright hands it to the feet, y'' = omega^2 (y - p) + F h_p / (m h), so the force counts h_p / h times.
    Whoever turns the torso can hold more than that for a while.

    Args:
        distance_m: L, from the DCM at the start of the push to the last DCM that can be held.
        duration_s: d.
        mass_kg: m.
        com_height_m: h, the height of the CoM.
        push_height_m: h_p, where the push acts, above the floor; None at the CoM.
    """
    omega = natural_frequency(com_height_m)
    lever = 1.0 if push_height_m is None else com_height_m / push_height_m
    return mass_kg * omega**2 * distance_m * lever / -math.expm1(-omega * duration_s)
