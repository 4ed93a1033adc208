"""The bar of a study under way: how many runs of about how many, and how long it will still take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LATE_S = 2.0  # what is over sooner needs no bar


@contextmanager
def progress_of_runs(label: str) -> Iterator[Callable[[int, int], object] | None]:
    """A bar on standard error, if that is a terminal.

    Args:
        label: What is going on.

    Yields:
        A function that takes how many runs are done and about how many there will be; None without terminal.
    """
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of about {task.total:.0f} runs"),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    began = time.monotonic()
    with Progress(*columns, console=console, transient=True, speed_estimate_period=120.0) as bar:
        task = bar.add_task(label, total=1, visible=False)

        def tell(done: int, expected: int) -> None:
            late = time.monotonic() - began > _LATE_S
            bar.update(task, completed=done, total=max(expected, 1), visible=late)

        yield tell
