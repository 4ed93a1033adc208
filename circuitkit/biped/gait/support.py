"""The support polygon: the convex hull of the soles, and how far a point is from its edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]


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
