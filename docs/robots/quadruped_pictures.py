"""Draws the pictures of docs/robots/quadruped.md."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit import simulate
from circuitkit.draw.style import CYCLE, DASHES, INK, SMALL, house_style, new_figure, save_figure, tidy
from circuitkit.simulation.renderer import Screen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from circuitkit.simulation import Result

Array = NDArray[np.float64]

IMAGES = Path(__file__).parent / "img"
LEGS = ("LH", "LF", "RH", "RF")  # in the order of the walk
WALK, TROT = 0.7, 1.6
DRIVES = (0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.4, 1.6, 1.8, 2.0)
STANDS_N = 2.0
SETTLED_S = 3.0


def driven(drive: float) -> Result:
    """A run of the scenario, in which the push is too weak to be felt."""
    return simulate("quadruped_trots", settings={"drive": str(drive)}, push="0.001N,200ms,left")


def standing(result: Result) -> dict[str, NDArray[np.bool_]]:
    """For each leg, in which ticks it stands."""
    return {leg: result.recording.channel(f"load_{leg}")[:, 0] > STANDS_N for leg in LEGS}


def lift_offs(stands: NDArray[np.bool_], shortest: int = 4) -> NDArray[np.intp]:
    """Ticks at which a leg leaves the ground, to stay away for a while after it stood for a while."""
    found = np.flatnonzero(stands[:-1] & np.logical_not(stands[1:])) + 1
    long = [i for i in found if stands[i - shortest : i].all() and not stands[i : i + shortest].any()]
    return np.array(long, dtype=np.intp)


def lag(stands: dict[str, NDArray[np.bool_]], leg: str, behind: str = "LH") -> float:
    """By which part of a cycle a leg lifts off after another one, as a circular mean."""
    first, then = lift_offs(stands[behind]), lift_offs(stands[leg])
    cycle = np.searchsorted(first, then, "right") - 1
    inside = (cycle >= 0) & (cycle < len(first) - 1)
    start = first[cycle[inside]]
    part = (then[inside] - start) / (first[cycle[inside] + 1] - start)
    return float(np.angle(np.exp(2j * np.pi * part).mean()) / (2 * np.pi) % 1)


def speed(result: Result) -> Array:
    """Speed forward in each tick, [m/s]."""
    return result.recording.channel("forward_velocity")[:, 0]


def _footfalls(axes: Axes, result: Result, title: str) -> None:
    first = int(SETTLED_S / result.recording.step_s)
    window = slice(first, first + 100)
    for row, leg in enumerate(reversed(LEGS)):
        stands = standing(result)[leg][window]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], stands, [0]])))
        bars = [(a * 0.01, (b - a) * 0.01) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        axes.broken_barh(bars, (row - 0.35, 0.7), color=INK)
    axes.set_yticks(range(len(LEGS)), list(reversed(LEGS)))
    axes.set_xlim(0, 1)
    axes.set_xlabel("time [s]")
    axes.set_title(title)
    tidy(axes)


def draw_gaits() -> None:
    """Footfalls of walk and trot; lag, duty factor and speed over the drive."""
    results = {drive: driven(drive) for drive in DRIVES}
    settled = int(SETTLED_S / results[TROT].recording.step_s)
    feet = {d: {leg: s[settled:] for leg, s in standing(r).items()} for d, r in results.items()}
    curves = {
        "lag of LF behind LH": [lag(feet[d], "LF") for d in DRIVES],
        "duty factor, fore": [float(feet[d]["LF"].mean()) for d in DRIVES],
        "duty factor, hind": [float(feet[d]["LH"].mean()) for d in DRIVES],
        "speed [m/s]": [float(speed(r)[settled:].mean()) for r in results.values()],
    }
    with house_style():
        figure = new_figure(7.2, 3.4)
        grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.5))
        grid.update(hspace=0.75, left=0.06, right=0.98, bottom=0.13, top=0.93)
        _footfalls(figure.add_subplot(grid[0, 0]), results[WALK], f"walk, drive {WALK}")
        _footfalls(figure.add_subplot(grid[1, 0]), results[TROT], f"trot, drive {TROT}")
        axes = figure.add_subplot(grid[:, 1])
        for number, (label, values) in enumerate(curves.items()):
            look = {"color": CYCLE[number], "linestyle": DASHES[number], "marker": "o", "markersize": 2.5}
            axes.plot(DRIVES, values, label=label, **look)
        axes.set_xlabel("drive")
        axes.set_ylim(0, 0.9)
        axes.legend(frameon=False, fontsize=SMALL, loc="lower right")
        tidy(axes)
        save_figure(figure, IMAGES / "quadruped_gaits.png")


def draw_stills() -> None:
    """The robot in a walk, in a trot, and during a push of 160 N."""
    from PIL import Image

    pushed = simulate("quadruped_trots", push="160N,200ms,right")
    shots = [(driven(WALK), 5.0), (driven(TROT), 5.05), (pushed, 5.4)]
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 1.3, 110.0, -12.0
    pictures = []
    for result, time_s in shots:
        model = result.recording.robot.model
        data = mujoco.MjData(model)
        data.qpos[:] = result.recording.qpos[int(time_s / result.recording.step_s), 0]
        mujoco.mj_forward(model, data)
        camera.lookat[:] = [*data.qpos[:2], 0.25]
        with Screen(model, 400, 300) as screen:
            screen.look(data, camera)
            pictures.append(screen.draw().copy())
    Image.fromarray(np.concatenate(pictures, axis=1)).save(IMAGES / "quadruped.png")


if __name__ == "__main__":
    draw_gaits()
    draw_stills()
