"""Makes figures one after the other, leaves what is finished as it is, and writes the report after each."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import circuitkit
from circuitkit.base.errors import CircuitkitError
from circuitkit.base.files import make_folder, write_text
from circuitkit.base.output_folder import one_run
from circuitkit.base.source import data_folder
from circuitkit.paper.reproduce.figure import FIGURES, Effort, Job, select
from circuitkit.paper.reproduce.finding import FINDING_FILE, Finding
from circuitkit.paper.reproduce.report import Entry, as_html, as_markdown

REPORT = "report"
_CORES = 2  # what the efforts are given for
_MINUTE_S = 60.0


class FiguresFailedError(CircuitkitError):
    """Some figures could not be made; the others were, and are in the report."""


@dataclass(frozen=True)
class Made:
    """What a call left behind.

    Attributes:
        findings: The figures that were asked for, in the order of the report.
        markdown: The report.
        html: The same, with the pictures in it.
    """

    findings: tuple[Finding, ...]
    markdown: Path
    html: Path


def reproduce(
    names: Sequence[str],
    folder: Path,
    *,
    quick: bool = False,
    workers: int | None = None,
    again: bool = False,
    progress: bool = False,
    log: Callable[[str], object] = lambda _: None,
) -> Made:
    """Make figures, and a report of all that lie in the folder.

    What is finished stays as it is, a figure of a stopped call goes on where it was. A finished figure in
    full is good for `quick` too. It is made anew once a circuit, a robot or a file of `sims/` is another;
    runs of it that nothing changed are not run again.

    Args:
        names: Which figures; all, if none are given.
        folder: Each figure gets one in it.
        quick: All of it, coarser.
        workers: Processes for the studies; None for one a processor.
        again: Forget what is there of these figures.
        progress: Show bars on a terminal.
        log: Receives a line at a time about what is going on.

    Raises:
        UnknownNameError: There is no figure of a name.
        FiguresFailedError: Some figures could not be made; says which and why.
        OutputError: A file cannot be written.
    """
    chosen = select(names)
    stamp = {"version": circuitkit.__version__, "inputs": inputs_digest()}
    if again:
        for name in chosen:
            shutil.rmtree(folder / name, ignore_errors=True)
    waiting = [name for name in chosen if not is_finished(folder / name, quick=quick, stamp=stamp)]
    clock = Clock({name: FIGURES[name].effort for name in waiting}, quick=quick, workers=workers)
    if finished := [name for name in chosen if name not in waiting]:
        log(f"{', '.join(finished)}: done before; --again makes them anew")
    failed: dict[str, str] = {}
    for number, name in enumerate(waiting, 1):
        log(f"{name} ({number} of {len(waiting)}), {clock.left()}")
        job = Job(name, folder / name, quick, workers, progress, log)
        with clock.measures(name):
            try:
                _make(job, stamp)
            except CircuitkitError as error:
                failed[name] = str(error)
                log(f"{name} could not be made: {error}")
        write_report(folder)
    markdown, html = write_report(folder)
    if failed:
        reasons = "\n".join(f"{name}: {reason}" for name, reason in failed.items())
        message = f"could not make {', '.join(failed)}; the rest is in '{html}'\n{reasons}"
        raise FiguresFailedError(message)
    made = (Finding.load(folder / name) for name in chosen)
    return Made(tuple(each[0] for each in made if each is not None), markdown, html)


def _make(job: Job, stamp: Mapping[str, Any]) -> None:
    (job.folder / FINDING_FILE).unlink(missing_ok=True)
    make_folder(job.folder)
    with one_run(
        job.folder, deep=False
    ):  # in its folders are the studies, which know what of them still holds
        finding = FIGURES[job.figure]().run(job)
        finding.save(job.folder, **stamp, quick=job.quick)


def is_finished(folder: Path, *, quick: bool, stamp: Mapping[str, Any]) -> bool:
    """See whether a figure's folder holds what would be made, as fine as asked for, from the same files."""
    found = Finding.load(folder)
    if found is None:
        return False
    _, theirs = found
    return (quick or not theirs.get("quick")) and all(theirs.get(key) == stamp[key] for key in stamp)


def inputs_digest() -> str:
    """Sum up every circuit, scenario, gait, controller, study and robot that ships in one digest."""
    digest = hashlib.sha256()
    for place in (data_folder(name) for name in ("circuits", "sims", "robots")):
        for path in sorted(each for each in place.rglob("*") if each.suffix in {".yaml", ".xml"}):
            digest.update(f"{place.name}/{path.relative_to(place).as_posix()}\n".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


class Clock:
    """Estimates how long the rest takes, by what figures are known to take and how quick they went so far."""

    def __init__(self, efforts: Mapping[str, Effort], *, quick: bool, workers: int | None) -> None:
        """Set up.

        Args:
            efforts: Of the figures still to be made.
            quick: Whether they are made coarser.
            workers: Processes for the studies; None for one a processor.
        """
        self._left_s = {name: effort.quick_s if quick else effort.full_s for name, effort in efforts.items()}
        self._expected_s = 0.0
        self._measured_s = 0.0
        self._guess = _CORES / (workers or os.cpu_count() or _CORES)

    @property
    def seconds(self) -> float:
        """How long the rest takes, about, [s]."""
        pace = self._measured_s / self._expected_s if self._expected_s else self._guess
        return sum(self._left_s.values()) * pace

    def left(self) -> str:
        """The same in words."""
        if self.seconds < 1.5 * _MINUTE_S:
            return f"about {max(self.seconds, 1.0):.0f} s left"
        return f"about {self.seconds / _MINUTE_S:.0f} min left"

    @contextmanager
    def measures(self, name: str) -> Iterator[None]:
        """Measure the block in which a figure is made, or fails."""
        began = time.monotonic()
        try:
            yield
        finally:
            self.record(name, time.monotonic() - began)

    def record(self, name: str, took_s: float) -> None:
        """Note that a figure was made in so many seconds."""
        self._expected_s += self._left_s.pop(name)
        self._measured_s += took_s


def entries(folder: Path) -> Iterator[Entry]:
    """Read what lies in a folder, in the order of the report."""
    for name in select():
        found = Finding.load(folder / name)
        if found is not None:
            finding, stamp = found
            yield Entry(finding, quick=bool(stamp.get("quick")), version=str(stamp.get("version", "")))


def write_report(folder: Path) -> tuple[Path, Path]:
    """Write `report.md` and `report.html` of all figures in a folder.

    Raises:
        OutputError: A file cannot be written.

    Returns:
        Their paths.
    """
    text = as_markdown(tuple(entries(folder)))
    markdown, html = folder / f"{REPORT}.md", folder / f"{REPORT}.html"
    write_text(markdown, text)
    write_text(html, as_html(text, folder))
    return markdown, html
