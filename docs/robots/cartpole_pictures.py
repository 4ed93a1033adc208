"""Draws the pictures of docs/robots/cartpole.md."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from circuitkit import draw_circuit, load_circuit, simulate
from circuitkit.draw.style import CYCLE, DASHES, GREY, SMALL, house_style, new_figure, save_figure, tidy
from circuitkit.simulation.renderer import Screen

IMAGES = Path(__file__).parent / "img"
SHOTS_S = (9.0, 10.4, 11.2)  # before a push of the pole and after it


def draw_run() -> None:
    """Cart, pole and motor over the minute; pushes as dotted lines."""
    result = simulate("cartpole_balances")
    recording, scenario = result.recording, result.scenario
    with house_style():
        figure = new_figure(7.2, 2.9)
        figure.set_layout_engine("constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.plot(recording.time_s, recording.channel("cart")[:, 0], color=CYCLE[0], label="cart [m]")
        degrees = np.degrees(recording.channel("pole")[:, 0]) / 10
        upper.plot(recording.time_s, degrees, color=CYCLE[1], linestyle=DASHES[1], label="pole [10 deg]")
        lower.plot(
            recording.time_s, recording.channel("motor_force")[:, 0], color=CYCLE[2], label="motor [N]"
        )
        lower.set(xlabel="time [s]")
        for axes in (upper, lower):
            for push in scenario.pushes:
                axes.axvline(push.start, color=GREY, linestyle=":", linewidth=0.8)
            axes.legend(frameon=False, fontsize=SMALL, loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
            tidy(axes)
        save_figure(figure, IMAGES / "cartpole_run.png")


def draw_stills() -> None:
    """The cart before a push, while it catches the pole, and on its way back."""
    from PIL import Image

    recording = simulate("cartpole_balances").recording
    model, pictures = recording.robot.model, []
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera("side").id
    for time_s in SHOTS_S:
        data.qpos[:] = recording.qpos[int(time_s / recording.step_s), 0]
        mujoco.mj_forward(model, data)
        with Screen(model, 400, 220) as screen:
            screen.look(data, camera)
            pictures.append(screen.draw())
    Image.fromarray(np.concatenate(pictures, axis=1)).save(IMAGES / "cartpole.png", optimize=True)


if __name__ == "__main__":
    draw_circuit(load_circuit("cartpole_balance"), IMAGES / "cartpole_circuit.png")
    draw_run()
    draw_stills()
