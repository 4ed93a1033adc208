"""Draws the pictures of lamprey.md; with MUJOCO_GL=egl where there is no screen."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from circuitkit import simulate
from circuitkit.control import CircuitController
from circuitkit.draw.style import CYCLE, DASHES, house_style, new_figure, save_figure, tidy

IMAGES = Path(__file__).parent / "img"
JOINTS = range(1, 11)
CONTENDERS = {
    "with stretch": CircuitController("lamprey_stretch"),
    "eye alone": CircuitController("lamprey_stretch", silenced=("stretch", "turning")),
    "not steered": CircuitController("lamprey"),
}


def main() -> None:
    """Both pictures."""
    swim = simulate("lamprey_swims").recording
    drives = np.arange(1.0, 5.01, 0.5)
    speeds = [simulate("lamprey_swims", settings={"drive": str(d)}).measures["speed"] for d in drives]
    with house_style():
        figure = new_figure(9.0, 2.8)
        figure.set_layout_engine("constrained")
        waves, speed, paths = figure.subplots(1, 3, width_ratios=[1.2, 0.8, 1.4])
        for k in JOINTS:
            degrees = np.degrees(swim.channel(f"bend_{k}")[:, 0])
            waves.plot(swim.time_s, degrees / 60 - k, color=CYCLE[0], linewidth=0.9)
        waves.set(xlim=(0, 6), xlabel="time [s]", ylabel="joint, from head to tail", yticks=[-1, -5, -10])
        waves.set_yticklabels(["1", "5", "10"])
        speed.plot(drives, speeds, "o-", color=CYCLE[0], markersize=3)
        speed.set(xlabel="drive", ylabel="speed [m/s]", ylim=(0, 0.3))
        for number, (label, controller) in enumerate(CONTENDERS.items()):
            run = simulate("lamprey_current", controller=controller).recording
            style = {"color": CYCLE[number], "linestyle": DASHES[number]}
            paths.plot(run.channel("x")[:, 0], run.channel("y")[:, 0], label=label, **style)
        paths.set(xlabel="ahead [m]", ylabel="to the left [m]")
        paths.legend(frameon=False)
        for axes in (waves, speed, paths):
            tidy(axes)
        save_figure(figure, IMAGES / "lamprey_runs.png")
    still(swim, 8.0)


def still(recording, time_s: float) -> None:  # noqa: ANN001 - a Recording
    """The robot from above, at a moment of a run."""
    import matplotlib.pyplot as plt

    model = recording.robot.model
    data = mujoco.MjData(model)
    data.qpos[:] = recording.qpos[np.searchsorted(recording.time_s, time_s), 0]
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 320, 640) as renderer:
        renderer.update_scene(data, "above")
        plt.imsave(IMAGES / "lamprey.png", renderer.render())


if __name__ == "__main__":
    main()
