"""Plots of runs of any robot: channels, neurons and commands over time, the path from above, a comparison."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from circuitkit.simulation.run import Result


def draw_result(result: Result, folder: Path) -> None:
    """Write the plots of a run."""


def draw_comparison(results: Sequence[Result], folder: Path) -> None:
    """Write the plot of a comparison."""
