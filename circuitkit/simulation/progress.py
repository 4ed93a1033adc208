"""A progress bar on standard error, for long work on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(total: int, label: str, *, shown: bool) -> Iterator[Callable[[int], object] | None]:
    """A bar on standard error, if it is a terminal; gives a function that takes how much is done."""
    if not shown:
        yield None
        return
    from rich.console import Console  # only a bar needs it
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # as above

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    name, percent = TextColumn("{task.description}"), TextColumn("{task.percentage:3.0f} %")
    with Progress(name, BarColumn(), percent, TimeRemainingColumn(), console=console, transient=True) as bar:
        task = bar.add_task(label, total=total)
        yield lambda done: bar.update(task, completed=done)
