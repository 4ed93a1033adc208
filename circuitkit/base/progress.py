"""The progress bar of everything that takes long, on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

_LATE_S = 2.0  # what is over sooner needs no bar
_SPEED_S = 120.0  # the remaining time follows from the speed in so many seconds


class Advance(Protocol):
    """Moves a bar on."""

    def __call__(self, done: float, total: float | None = None, label: str | None = None) -> object:
        """Show how far it is.

        Args:
            done: How much is done.
            total: Of how much; as before if None.
            label: What is going on; as before if None.
        """


@contextmanager
def progress_bar(label: str, total: float | None = None, *, shown: bool = True) -> Iterator[Advance | None]:
    """A bar that appears after two seconds if a person is watching.

    Args:
        label: What is going on, such as "running".
        total: How much there is to do, if that is known beforehand.
        shown: Whether a bar is wanted at all.

    Yields:
        What moves it on; None if there is none, as where standard error is no terminal.
    """
    if not shown or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console  # takes a tenth of a second to load
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # the same

    words, percent = TextColumn("{task.description}"), TextColumn("{task.percentage:3.0f} %")
    columns = (words, BarColumn(), percent, TimeRemainingColumn())
    console = Console(stderr=True)
    began = time.monotonic()
    with Progress(*columns, console=console, transient=True, speed_estimate_period=_SPEED_S) as bar:
        task = bar.add_task(label, total=total, visible=False)

        def advance(done: float, total: float | None = None, label: str | None = None) -> None:
            late = time.monotonic() - began > _LATE_S
            bar.update(task, completed=done, total=total, description=label, visible=late)

        yield advance
