"""The pictures of the hexapod's page; `python docs/robots/hexapod_pictures.py` writes them."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np

from circuitkit.draw.style import INHIBITORY, INK, house_style, new_figure, save_figure, tidy
from circuitkit.simulation import Result, simulate
from circuitkit.simulation.film import FRAME_SIZE, FRAMES_PER_S, SCENE_HEIGHT, Reel

IMAGES = Path(__file__).parent / "img"
CARRIES_N = 0.2
LEGS = ("L1", "L2", "L3", "R1", "R2", "R3")


def write_still(result: Result, time_s: float) -> None:
    """A frame of the film, without the panels below it, whose text is too small for a still."""
    with contextlib.closing(Reel(result)) as reel:
        scene = reel.frame(round(time_s * FRAMES_PER_S)).crop((0, 0, FRAME_SIZE[0], SCENE_HEIGHT))
    scene.save(IMAGES / "hexapod.png", optimize=True)


def write_footfalls(result: Result) -> None:
    """Which legs carry when, before and after one is lost."""
    recording = result.recording
    with house_style():
        figure = new_figure(7.2, 2.4)
        axes = figure.add_axes((0.07, 0.2, 0.91, 0.68))
        tidy(axes, grid=False)
        for row, leg in enumerate(LEGS):
            stands = recording.channel(f"{leg}_load")[:, 0] > CARRIES_N
            axes.fill_between(
                recording.time_s, row - 0.4, np.where(stands, row + 0.4, row - 0.4), step="pre", color=INK
            )
        axes.axvline(5.0, color=INHIBITORY, linewidth=1.2)
        axes.set(xlim=(2, 10), xlabel="time [s]   (black: the leg carries more than 0.2 N)", yticks=range(6))
        axes.set_yticklabels(LEGS)
        axes.invert_yaxis()
        axes.set_title("L2 is lost after 5 s", loc="left")
        save_figure(figure, IMAGES / "hexapod_footfalls.png")


if __name__ == "__main__":
    run = simulate("hexapod_loses_a_leg")
    write_footfalls(run)
    write_still(run, 12.0)
