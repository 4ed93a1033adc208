"""Keeps what the pictures of several figures have in common, so that they read alike, also in grey."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from circuitkit.draw.style import EXCITATORY, GATE, GREY, INHIBITORY, INK, save_figure

WIDTH_IN = 7.2


@dataclass(frozen=True)
class LineStyle:
    """The way in which a contender is drawn in every figure.

    Attributes:
        label: In legends and tables.
        colour: Of its line.
        dashes: Of its line; no two have the same dashes and marker.
        marker: At its points.
        filled: Whether the marker is filled.
    """

    label: str
    colour: str
    dashes: Any
    marker: str
    filled: bool = True

    def line(self, **more: Any) -> dict[str, Any]:  # noqa: ANN401 - whatever `Axes.plot` takes
        """Return arguments of `Axes.plot`."""
        face = self.colour if self.filled else "white"
        return {
            "label": self.label,
            "color": self.colour,
            "linestyle": self.dashes,
            "marker": self.marker,
            "markerfacecolor": face,
            "markersize": 4.5,
            "linewidth": 1.3,
            **more,
        }


STYLES: Mapping[str, LineStyle] = {
    "open_loop": LineStyle("open loop", GREY, (0, (1, 1.5)), "o", filled=False),
    "mpc": LineStyle("MPC, joint angles (as NAO's)", "#e6a100", "--", "^", filled=False),
    "mpc_full": LineStyle("MPC, full CoM feedback", "#9a6b00", "-.", "v"),
    "dcm_ankle": LineStyle("ankle PD on the DCM", GATE, (0, (6, 1.5, 1, 1.5, 1, 1.5)), "D", filled=False),
    "binn": LineStyle("BiNN as the paper reads", INHIBITORY, (0, (3, 1.5)), "s", filled=False),
    "binn_tuned": LineStyle("BiNN, tuned", EXCITATORY, "-", "s"),
    "binn_capture": LineStyle("BiNN on the capture point", "#1d4f7a", (0, (5, 1)), "P"),
    "bound": LineStyle("bound by the DCM", INK, ":", ""),
    "point_mass": LineStyle("the same, pushed at the CoM", "#9a9a9a", ":", ""),
}


def label_of(contender: str) -> str:
    """Name a contender in words."""
    return STYLES[contender].label if contender in STYLES else contender.replace("_", " ")


def save(figure: Figure, folder: Path, name: str) -> str:
    """Write a picture for the screen and one for print.

    Returns:
        The file name of the one for the screen.
    """
    save_figure(figure, folder / f"{name}.pdf")
    save_figure(figure, folder / f"{name}.png")
    return f"{name}.png"
