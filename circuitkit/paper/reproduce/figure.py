"""Finds the figures of the report: a figure is a class in a module of this package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.registry import Registry
from circuitkit.paper.reproduce.finding import Finding
from circuitkit.paper.reproduce.job import Job


@dataclass(frozen=True)
class Effort:
    """How long a figure takes on two cores, about; for the remaining time.

    Attributes:
        full_s: In full, [s].
        quick_s: With --quick, [s].
    """

    full_s: float
    quick_s: float


class ReportFigure(ABC):
    """Base of all figures; the first line of a figure's docstring says in `docs/reproduce.md` what it makes.

    Attributes:
        kind: Its name, such as `fig11`.
        order: Where it stands in the report: the paper's figures by their number, others after them.
        title: Its heading in the report.
        studies: Names of the studies that it runs.
        effort: How long it takes.
    """

    kind: ClassVar[str]
    order: ClassVar[int]
    title: ClassVar[str]
    studies: ClassVar[tuple[str, ...]] = ()
    effort: ClassVar[Effort]

    @abstractmethod
    def run(self, job: Job) -> Finding:
        """Make the figure: draw its pictures into `job.folder`, and return what was found."""


FIGURES: Registry[ReportFigure] = Registry("figures", ReportFigure, "circuitkit.paper.reproduce")  # type: ignore[type-abstract]  # as the base of classes


def select(names: Sequence[str] = ()) -> tuple[str, ...]:
    """Sort figures into the order of the report.

    Args:
        names: The figures; all of them, if none are given.

    Raises:
        UnknownNameError: There is no figure of a name.
    """
    ordered = sorted(FIGURES.kinds, key=lambda name: (FIGURES.kinds[name].order, name))
    for name in names:
        if name not in ordered:
            kind = "figure"
            raise UnknownNameError(kind, name, ordered)
    return tuple(name for name in ordered if not names or name in names)
