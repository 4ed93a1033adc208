"""Describes how a figure is made: where it may write, how fine it shall be, and how it runs its studies."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from circuitkit.study import Results, Study, Workers, open_workers, sweep
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
