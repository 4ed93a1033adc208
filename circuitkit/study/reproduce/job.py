"""How a figure is made: where it may write, how fine it shall be, and how it runs its studies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from circuitkit.study import Results, Study
    from circuitkit.study.reproduce.finding import Finding


@dataclass(frozen=True)
class Effort:
    """How long a figure takes on two cores, about; for the remaining time.

    Attributes:
        full_s: In full, [s].
        quick_s: With --quick, [s].
    """

    full_s: float
    quick_s: float


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
        say: Is told a line at a time what is going on.
    """

    figure: str
    folder: Path
    quick: bool = False
    workers: int | None = None
    progress: bool = False
    say: Callable[[str], object] = _silent

    def sweep(self, study: Study, name: str = "") -> Results:
        """Run a study, or what is left of it: its runs lie in `DIR/FIGURE/quick` or `DIR/FIGURE/full`.

        Args:
            study: What to run.
            name: Tells several studies of one figure apart.
        """
        from circuitkit.study import sweep

        folder = self.folder / ("quick" if self.quick else "full") / name
        return sweep(study, folder, workers=self.workers, resume=True, progress=self.progress)


class FigureModule(Protocol):
    """What every module of a figure has; `registry.FIGURES` lists them."""

    TITLE: str
    EFFORT: Effort

    def run(self, job: Job) -> Finding:
        """Make the figure: draw its pictures into `job.folder`, and tell what was found."""
