"""The figures of the report, in its order: a new one is a module and a line here."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import cast

from circuitkit.base.errors import UnknownNameError
from circuitkit.paper.reproduce.job import FigureModule

_HERE = "circuitkit.paper.reproduce"

FIGURES: Mapping[str, str] = {
    "fig5": f"{_HERE}.fig5",
    "fig6": f"{_HERE}.fig6",
    "fig7": f"{_HERE}.fig7",
    "fig8": f"{_HERE}.fig8",
    "fig9": f"{_HERE}.fig9",
    "fig10": f"{_HERE}.fig10",
    "fig11": f"{_HERE}.fig11",
    "polar": f"{_HERE}.polar",
    "robustness": f"{_HERE}.robustness",
    "ablation": f"{_HERE}.ablation",
    "stepping": f"{_HERE}.stepping",
}


def select(names: Sequence[str]) -> tuple[str, ...]:
    """The figures of these names in the order of the report; all of them, if no names are given.

    Raises:
        UnknownNameError: There is no figure of a name.
    """
    for name in names:
        if name not in FIGURES:
            kind = "figure"
            raise UnknownNameError(kind, name, FIGURES)
    return tuple(name for name in FIGURES if not names or name in names)


def module_of(name: str) -> FigureModule:
    """The module of a figure."""
    return cast("FigureModule", importlib.import_module(FIGURES[name]))
