"""Draws the pictures of docs/robots/vehicle.md; with MUJOCO_GL=egl where there is no screen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit import draw_circuit, load_circuit, simulate
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    GREY,
    INK,
    PALE,
    SMALL,
    house_style,
    new_figure,
    save_figure,
    tidy,
)
from circuitkit.simulation import load_scenario
from circuitkit.simulation.renderer import Screen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from circuitkit.simulation import Recording

Array = NDArray[np.float64]

IMAGES = Path(__file__).parent / "img"
MEMBERS = 32
CHOICE = ("near_left -> near_right", "near_right -> near_left")


def recorded(name: str, seed: int = 0, **fields: Any) -> Recording:  # noqa: ANN401 - a scenario's fields
    """A run of a scenario, perhaps with other fields."""
    return simulate(load_scenario(name).model_copy(update=fields), seed=seed).recording


def _arena(axes: Axes, model: mujoco.MjModel) -> None:
    """Pillars and the lamp, and the walls as the frame."""
    from matplotlib.patches import Circle

    for number in range(1, 5):
        pillar = model.geom(f"pillar_{number}")
        axes.add_patch(Circle(pillar.pos[:2], pillar.size[0], facecolor=PALE, edgecolor=GREY, linewidth=0.8))
    axes.plot(*model.body("lamp").pos[:2], "*", color="#e0a800", markersize=9, zorder=5)
    axes.set(xlim=(-1.5, 1.5), ylim=(-1.2, 1.2), aspect="equal", xticks=[], yticks=[])


def _way(axes: Axes, run: Recording, color: str, label: str | None = None) -> None:
    x, y = run.channel("x")[:, 0], run.channel("y")[:, 0]
    axes.plot(x, y, color=color, linewidth=0.9, label=label)
    axes.plot(x[0], y[0], "o", color=color, markersize=2.5)


def draw_paths() -> None:
    """Where it drives: with and without the choice of a side, and from twenty starts to the lamp."""
    whole, bare = recorded("vehicle_avoids", 2), recorded("vehicle_avoids", 2, silenced=CHOICE)
    with house_style():
        figure = new_figure(9.0, 2.7)
        figure.set_layout_engine("constrained")
        left, middle, right = figure.subplots(1, 3)
        for axes, run, title in (
            (left, whole, "avoids, for a minute"),
            (middle, bare, "the same without the choice of a side"),
        ):
            _arena(axes, run.robot.model)
            _way(axes, run, INK)
            axes.set_title(title)
        _arena(right, whole.robot.model)
        for seed in range(20):
            _way(right, recorded("vehicle_seeks_light", seed), CYCLE[seed % len(CYCLE)])
        right.set_title("seeks light, 20 starts")
        save_figure(figure, IMAGES / "vehicle_paths.png")


def draw_heading() -> None:
    """The bump of the compass and the heading, over the minute; and the heading without the compass."""
    run = recorded("vehicle_keeps_heading")
    lost = recorded("vehicle_keeps_heading", silenced=("shift_left", "shift_right"))
    first = run.trace_names.index("compass[0]")
    activity = np.roll(run.trace[:, 0, first : first + MEMBERS], MEMBERS // 2, axis=1)
    with house_style():
        figure = new_figure(9.0, 3.6)
        figure.set_layout_engine("constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.imshow(
            activity.T, aspect="auto", origin="lower", cmap="Greys", interpolation="nearest",
            extent=(0, run.time_s[-1], -180 - 180 / MEMBERS, 180 - 180 / MEMBERS),
        )  # fmt: skip
        for each, axes, number, label in (
            (run, upper, 2, "heading"),
            (run, lower, 0, "with the compass"),
            (lost, lower, 1, "with a bump that does not move"),
        ):
            degrees = np.degrees(each.channel("heading")[:, 0])
            jumps = np.abs(np.diff(degrees, append=degrees[-1])) > 180  # noqa: PLR2004 - from 180 to -180 degrees
            line = np.where(jumps, np.nan, degrees)
            style = {"color": CYCLE[number], "linestyle": DASHES[number]}
            axes.plot(each.time_s, line, linewidth=1.1, label=label, **style)
        upper.set(ylabel="compass [deg]", yticks=[-90, 0, 90])
        lower.set(xlabel="time [s]", ylabel="heading [deg]", ylim=(-185, 185), yticks=[-90, 0, 90])
        for axes in (upper, lower):
            axes.legend(frameon=False, fontsize=SMALL, loc="upper right")
            tidy(axes)
        save_figure(figure, IMAGES / "vehicle_heading.png")


def draw_stills() -> None:
    """The vehicle on its way to the lamp, three times."""
    from PIL import Image

    run = recorded("vehicle_seeks_light", 1)
    model, pictures = run.robot.model, []
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera("corner").id
    for time_s in (2.0, 12.0, 59.0):
        data.qpos[:] = run.qpos[int(time_s / run.step_s), 0]
        mujoco.mj_forward(model, data)
        with Screen(model, 420, 300) as screen:
            screen.look(data, camera)
            pictures.append(screen.draw().copy())
    Image.fromarray(np.concatenate(pictures, axis=1)).save(IMAGES / "vehicle.png", optimize=True)


if __name__ == "__main__":
    draw_circuit(load_circuit("light_seeker"), IMAGES / "light_seeker_circuit.svg")
    draw_circuit(load_circuit("heading_keeper"), IMAGES / "heading_keeper_circuit.svg")
    draw_paths()
    draw_heading()
    draw_stills()
