"""The leg equations of the paper (eqs. 3-10), element by element on arrays of any shape.

Angles follow the robot's joints: pitch turns about y (positive bends the knee), roll about x. The sum of a
leg's pitch angles is the pitch of its foot as seen from the torso, so an upright torso has a sum of zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import SimulationError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LegGeometry:
    """Lengths of a leg and where it hangs, all in metres.

    Attributes:
        thigh_m: Hip to knee, l_H of eq. 4.
        tibia_m: Knee to ankle, l_K of eq. 4.
        ankle_height_m: Ankle above the sole.
        hip_offset_y_m: Hip from the middle of the body, also half the distance between the feet.
        hip_offset_z_m: Hip below the origin of the torso.
    """

    thigh_m: float
    tibia_m: float
    ankle_height_m: float
    hip_offset_y_m: float
    hip_offset_z_m: float


def support_leg_length(ankle_pitch: Array, knee_pitch: Array, legs: LegGeometry) -> Array:
    """L_sl = l_K cos(theta_ap) + l_H cos(theta_ap + theta_kp), in metres (eq. 4)."""
    return legs.tibia_m * np.cos(ankle_pitch) + legs.thigh_m * np.cos(ankle_pitch + knee_pitch)


def ankle_roll(com_shift_m: Array, support_leg_length_m: Array) -> Array:
    """theta_ar = asin(dy_CoM / L_sl), in radians (eq. 3).

    A shift to the left (+y) gives a positive angle: the foot turns about +x as seen from the leg.

    Raises:
        SimulationError: The shift is longer than the leg.
    """
    ratio = np.asarray(com_shift_m) / support_leg_length_m
    if np.any(np.abs(ratio) > 1.0):
        message = (
            f"eq. 3 has no solution: a shift of {np.abs(com_shift_m).max():.3f} m with a leg of "
            f"{np.min(support_leg_length_m):.3f} m; allowed: less than that; lower the sideways ZMP"
        )
        raise SimulationError(message)
    return np.arcsin(ratio)


def hip_roll(ankle_roll_rad: Array) -> Array:
    """theta_hr = -theta_ar, which keeps the torso vertical (eq. 5)."""
    return -ankle_roll_rad


def moving_leg_length(
    support_leg_length_m: Array, ankle_roll_rad: Array, hip_roll_rad: Array, lift_m: Array
) -> Array:
    """L_ml = (L_sl cos(theta_ar) - dz) / cos(theta_hr), in metres (eq. 9)."""
    return (support_leg_length_m * np.cos(ankle_roll_rad) - lift_m) / np.cos(hip_roll_rad)


def hip_pitch(
    moving_leg_length_m: Array,
    alpha: Array,
    torso_pitch: Array,
    legs: LegGeometry,
    thigh_back: NDArray[np.bool_] | bool = False,
) -> Array:
    """theta_hp = -arccos((L_ml - l_K cos(alpha - theta_tp)) / l_H) + theta_tp, in radians (eq. 6).

    Eq. 6 has the thigh in front of the vertical. A trailing leg can have it behind, which is the other sign
    of the arccosine.

    Args:
        moving_leg_length_m: L_ml.
        alpha: The sum of hip and knee pitch.
        torso_pitch: theta_tp.
        legs: The lengths.
        thigh_back: Where the knee is behind its hip.

    Raises:
        SimulationError: The leg cannot reach: it would have to be longer than it is.
    """
    cosine = (moving_leg_length_m - legs.tibia_m * np.cos(alpha - torso_pitch)) / legs.thigh_m
    if np.any(np.abs(cosine) > 1.0):
        message = (
            "eq. 6 has no solution: the leg is too short for this step; bend the knee more or step shorter"
        )
        raise SimulationError(message)
    angle = np.arccos(cosine)
    return np.where(thigh_back, angle, -angle) + torso_pitch


def knee_pitch(alpha: Array, hip_pitch_rad: Array) -> Array:
    """theta_kp = alpha - theta_hp, in radians (eq. 7)."""
    return alpha - hip_pitch_rad


def torso_pitch(hip_pitch_rad: Array, knee_pitch_rad: Array, ankle_pitch_rad: Array) -> Array:
    """theta_tp = theta_hp + theta_kp + theta_ap of the support leg, in radians (eq. 8)."""
    return hip_pitch_rad + knee_pitch_rad + ankle_pitch_rad


def ankle_pitch(torso_pitch_rad: Array, hip_pitch_rad: Array, knee_pitch_rad: Array) -> Array:
    """theta_ap = theta_tp - (theta_hp + theta_kp), which keeps the foot parallel to the ground (eq. 10)."""
    return torso_pitch_rad - (hip_pitch_rad + knee_pitch_rad)


def alpha_for_foot(forward_m: Array, leg_length_m: Array, torso_pitch_rad: Array, legs: LegGeometry) -> Array:
    """The paper's free parameter alpha that puts the foot `forward_m` ahead of its hip.

    Thigh and tibia, turned by phi_t and phi_k from the vertical, must reach the ankle:
    l_H cos(phi_t) + l_K cos(phi_k) = L and l_H sin(phi_t) + l_K sin(phi_k) = -x. Of the two solutions this is
    the one with the knee in front; alpha = phi_k + theta_tp.

    Args:
        forward_m: x, ankle ahead of the hip.
        leg_length_m: L, ankle below the hip within the leg's plane.
        torso_pitch_rad: theta_tp.
        legs: The lengths.

    Raises:
        SimulationError: The ankle is out of the leg's reach.
    """
    distance = np.hypot(forward_m, leg_length_m)
    if np.any(distance > legs.thigh_m + legs.tibia_m):
        message = (
            f"the foot is {distance.max():.3f} m from the hip, and the leg is "
            f"{legs.thigh_m + legs.tibia_m:.3f} m long; bend the knee more or step shorter"
        )
        raise SimulationError(message)
    cosine = (distance**2 + legs.tibia_m**2 - legs.thigh_m**2) / (2 * distance * legs.tibia_m)
    return -np.arctan2(forward_m, leg_length_m) + np.arccos(np.clip(cosine, -1.0, 1.0)) + torso_pitch_rad


def knee_is_behind(
    forward_m: Array, alpha: Array, torso_pitch_rad: Array, legs: LegGeometry
) -> NDArray[np.bool_]:
    """Where the knee stands behind its hip: x + l_K sin(alpha - theta_tp) < 0."""
    behind: NDArray[np.bool_] = forward_m + legs.tibia_m * np.sin(alpha - torso_pitch_rad) < 0
    return behind
