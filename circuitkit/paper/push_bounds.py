"""Works out the bound of the DCM, the largest push that any control by the ankles can hold."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from circuitkit.biped.anatomy import Sole
from circuitkit.biped.gait.lipm import dcm, largest_push_force
from circuitkit.biped.robot import biped_of
from circuitkit.paper.runs import push_moment, record, without_pushes
from circuitkit.simulation import Plan

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PushKind:
    """Pushes that differ only in force.

    Attributes:
        direction: Such as `inward`.
        duration_s: How long.
    """

    direction: str
    duration_s: float


@dataclass(frozen=True)
class _PushStart:
    """An undisturbed robot when a push would start; positions forward and left, in the world.

    Attributes:
        dcm_m: DCM; shape (2,).
        corners_m: Corners of both soles; shape (8, 2).
        com_height_m: Height of the CoM.
        push_height_m: Height at which the scenario's first push acts.
    """

    dcm_m: Array
    corners_m: Array
    com_height_m: float
    push_height_m: float


def _start_of_push(plan: Plan) -> _PushStart:
    """Walk in open loop without the push, and look at the moment when it would begin."""
    recording = record(plan, "open_loop", [without_pushes(plan)])
    push, biped = plan.scenario.pushes[0], biped_of(recording.robot)
    layout, feet = biped.layout, biped.block.feet
    tick = round(push_moment(plan.scenario, plan.reference).time_s / plan.body.step_s)
    now = recording.readings[tick, 0]
    height = float(now[layout.com][2])
    ankles = np.stack([now[layout.foot(side)][:2] for side in range(2)])
    return _PushStart(
        dcm_m=dcm(now[layout.com][:2], now[layout.com_velocity][:2], height),
        corners_m=np.concatenate([_corners_m(foot.extent) for foot in (feet.left, feet.right)])
        + ankles.repeat(4, 0),
        com_height_m=height,
        push_height_m=_height_of(plan, push.body, recording.qpos[tick, 0]) + push.height,
    )


def _corners_m(sole: Sole) -> Array:
    """List the corners of a sole from its ankle; shape (4, 2)."""
    return np.array([(x, y) for x in (sole.back, sole.front) for y in (sole.right, sole.left)])


def _height_of(plan: Plan, body: str, qpos: Array) -> float:
    """Measure the height of a body's centre of mass above the floor, [m]."""
    model = plan.robot.model
    data = mujoco.MjData(model)
    data.qpos = qpos
    mujoco.mj_kinematics(model, data)
    return float(data.xipos[plan.robot.number("body", body)][2])


@dataclass(frozen=True)
class BoundsAround:
    """What no ankle controller can exceed, for pushes from around; [N], one for each direction.

    Attributes:
        point_mass_n: Of a point mass that is pushed at its height; shape (n,).
        upright_n: Of a body whose torso does not turn, pushed at the height of the pushed body; shape (n,).
    """

    point_mass_n: Array
    upright_n: Array


def dcm_bounds_around(plan: Plan, angles_rad: Array, duration_s: float) -> BoundsAround:
    """Work out the bound of the DCM for pushes from any direction.

    In the plane, the DCM of a point mass under a constant force F u obeys
    xi' = omega (xi - p + F u/(m omega^2)), where the ZMP p may be anywhere in the support polygon P. With
    E = exp(omega d), at the end of the push

        xi(d) = E xi_0 + (E - 1) (F u/(m omega^2) - q),

    where q is a mean of p, and so anywhere in P. The push can be held if xi(d) can be in P. Since P is
    convex, xi(d)/(E - 1) + q is anywhere in P E/(E - 1), so F u/(m omega^2) must lie in (P - xi_0) E/(E - 1),
    or

        F = m omega^2 L / (1 - exp(-omega d))

    as along a line, L being the way from xi_0 along u to the edge of P. P is the hull of both feet: in front,
    behind and outward its edges are those of the foot that carries, inward the other foot catches the body.

    A push at the height h_p instead of the CoM's h brings a moment F (h_p - h). A torso that does not turn
    hands it to the feet (`largest_push_force`), so what can be held is smaller by h/h_p. Whoever
    turns the torso may hold more than that.

    Args:
        plan: The scenario's plan; its first push says when, and on which body at which height.
        angles_rad: Directions; 0 is forward, a quarter turn is to the left; shape (n,).
        duration_s: d.
    """
    start = _start_of_push(plan)
    lengths = distances_to_edge(start.dcm_m, angles_rad, start.corners_m)
    mass, height = biped_of(plan.robot).mass_kg, start.com_height_m
    return BoundsAround(
        lengths * largest_push_force(1.0, duration_s, mass, height),
        lengths * largest_push_force(1.0, duration_s, mass, height, start.push_height_m),
    )


def distances_to_edge(point_m: Array, angles_rad: Array, corners_m: Array) -> Array:
    """How far a point can go in each direction before it leaves the convex hull of some corners.

    The hull is all x with n_i . x <= c_i, one for each side, so along u the point x0 leaves it after the
    smallest (c_i - n_i . x0) / (n_i . u) with n_i . u > 0.

    Args:
        point_m: x0, forward and left; shape (2,).
        angles_rad: Directions; 0 is forward, a quarter turn is to the left; shape (n,).
        corners_m: Three or more points that do not lie on a line; shape (k, 2).

    Returns:
        Shape (n,), [m]; 0 where the point lies outside of a side that it would have to pass.
    """
    sides = ConvexHull(corners_m).equations
    slack = -(sides[:, :2] @ point_m + sides[:, 2])
    ways = np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1)
    speed = ways @ sides[:, :2].T
    towards = speed > np.finfo(float).eps
    times = np.where(towards, slack / np.where(towards, speed, 1.0), np.inf)
    distances: Array = np.maximum(times.min(axis=1), 0.0)
    return distances
