"""A vehicle with two wheels in an arena, driven by `braitenberg_avoider`; a picture of its path.

Run it with: python examples/avoid_the_walls.py [PICTURE]
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from circuitkit import Stepper, compile_circuit, load_circuit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

WIDTH_M, HEIGHT_M = 2.0, 1.5  # the arena
PILLARS = ((1.2, 0.8, 0.15), (0.55, 1.05, 0.1))  # x, y, radius [m]
WHEEL_RADIUS_M, AXLE_M = 0.03, 0.14
SENSOR_ANGLE, SENSOR_RANGE_M = math.radians(35), 1.0


def seen(x: float, y: float, angle: float) -> float:
    """Distance to the first wall or pillar in a direction, [m]."""
    cosine, sine = math.cos(angle), math.sin(angle)
    walls = [
        ((WIDTH_M if cosine > 0 else 0) - x) / cosine if cosine else math.inf,
        ((HEIGHT_M if sine > 0 else 0) - y) / sine if sine else math.inf,
    ]
    for pillar_x, pillar_y, radius in PILLARS:
        along = (pillar_x - x) * cosine + (pillar_y - y) * sine
        aside = (pillar_x - x) * sine - (pillar_y - y) * cosine
        if along > 0 and abs(aside) < radius:
            walls.append(along - math.sqrt(radius**2 - aside**2))
    return min(SENSOR_RANGE_M, *walls)


def drive(duration_s: float, pose: tuple[float, float, float], *, seed: int = 0) -> Array:
    """Drive through the arena.

    Args:
        duration_s: How long.
        pose: x [m], y [m] and heading [rad] at the start.
        seed: Of the circuit's noise.

    Returns:
        Shape (T, 7): x, y, heading, distances left and right [m], wheels left and right [rad/s], each step.
    """
    program = compile_circuit(load_circuit("braitenberg_avoider"))
    stepper = Stepper(program, 1, seed=seed)
    x, y, heading = pose
    log = np.empty((round(duration_s / program.step_s), 7))
    for row in log:
        distances = seen(x, y, heading + SENSOR_ANGLE), seen(x, y, heading - SENSOR_ANGLE)
        stepper.inputs[0] = distances
        left, right = stepper.step()[0]
        ahead_m = program.step_s * WHEEL_RADIUS_M * (left + right) / 2
        x += ahead_m * math.cos(heading)
        y += ahead_m * math.sin(heading)
        heading += program.step_s * WHEEL_RADIUS_M * (right - left) / AXLE_M
        row[:] = x, y, heading, *distances, left, right
    return log


def clearance_m(log: Array) -> float:
    """How near the middle of the vehicle came to a wall or pillar, at least."""
    x, y = log[:, 0], log[:, 1]
    walls = np.minimum.reduce([x, WIDTH_M - x, y, HEIGHT_M - y])
    pillars = [np.hypot(x - at_x, y - at_y) - radius for at_x, at_y, radius in PILLARS]
    return float(np.minimum.reduce([walls, *pillars]).min())


def draw_path(axes: Axes, log: Array) -> None:
    """The arena and the path; from the circle to the square."""
    from matplotlib.patches import Circle, Rectangle

    axes.add_patch(Rectangle((0, 0), WIDTH_M, HEIGHT_M, fill=False, linewidth=1.5))
    for x, y, radius in PILLARS:
        axes.add_patch(Circle((x, y), radius, color="0.6"))
    axes.plot(log[:, 0], log[:, 1], linewidth=0.9)
    axes.plot(*log[0, :2], "o", *log[-1, :2], "s", color="black", markersize=5)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")


if __name__ == "__main__":
    from matplotlib.figure import Figure

    log = drive(30.0, (0.3, 0.3, 0.4))
    length_m = float(np.hypot(*np.diff(log[:, :2], axis=0).T).sum())
    print(f"drove {length_m:.1f} m; nothing was nearer than {100 * clearance_m(log):.0f} cm")
    figure = Figure(figsize=(5.4, 4.2), layout="constrained")
    draw_path(figure.add_subplot(), log)
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "avoid_the_walls.png", dpi=150)
