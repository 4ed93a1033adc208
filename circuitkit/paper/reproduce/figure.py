"""Describes a figure of the report, a class in a module of this package: what it gets and how it is found."""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.registry import Registry
from circuitkit.paper.reproduce.finding import Finding
from circuitkit.study import Results, Study, Workers, load_study, open_workers, sweep
from circuitkit.study.store import OtherStudyError


def _silent(_: str) -> None:
    return None


@dataclass(frozen=True)
class Job:
    """One figure to make.

    Attributes:
        figure: Its name.
        folder: `DIR/FIGURE`, made beforehand; all files of the figure go there.
        quick: Coarser: fewer seeds, coarser grids, fewer cells.
        workers: Processes for the studies; None for one a processor.
        progress: Show a bar on a terminal.
        log: Receives a line at a time about what is going on.
    """

    figure: str
    folder: Path
    quick: bool = False
    workers: int | None = None
    progress: bool = False
    log: Callable[[str], object] = _silent

    def study(self, name: str, quick: Mapping[str, Any]) -> Study:
        """Load a study, with the changes that make it coarser if that is asked for."""
        study = load_study(name)
        return study.with_(quick) if self.quick else study

    def sweep(self, study: Study, name: str = "", *, apart: str = "") -> Results:
        """Run a study, or what is left of it.

        Its runs lie in `DIR/FIGURE/quick` or `DIR/FIGURE/full`. Runs there of other circuits, scenarios or
        versions are thrown away.

        Args:
            study: What to run.
            name: Of its folder; the study's by default.
            apart: An axis whose values get a folder each, so that a change of one leaves the others' runs.

        Raises:
            CircuitkitError: As of `sweep`.
        """
        folder = self.folder / ("quick" if self.quick else "full") / (name or study.name)
        results = self._swept(study, folder, apart)
        for remark in results.remarks():
            self.log(f"{self.figure}: {remark}")
        return results

    def _swept(self, study: Study, folder: Path, apart: str) -> Results:
        with open_workers(self.workers) as workers:
            if not apart:
                return self._sweep(study, folder, workers)
            parts = [study.with_({"axes": {apart: [value.text]}}) for value in study.axes[apart]]
            done = [
                self._sweep(part, folder / value.text, workers)
                for part, value in zip(parts, study.axes[apart], strict=True)
            ]
        return Results(study, tuple(row for results in done for row in results.rows))

    def _sweep(self, study: Study, folder: Path, workers: Workers) -> Results:
        try:
            return sweep(study, folder, workers=workers, resume=True, progress=self.progress)
        except OtherStudyError:
            self.log(f"{self.figure}: the runs in '{folder}' are of other files; they are made anew")
            shutil.rmtree(folder)
            return sweep(study, folder, workers=workers, resume=True, progress=self.progress)


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
