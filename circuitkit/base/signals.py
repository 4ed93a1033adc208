"""Being told to end: SIGTERM and SIGHUP end a process as an exception does, so that it tidies up."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

BY_SIGNAL = 128  # and the signal's number: the exit code of what a signal has ended, as shells report it
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
_CAME: list[int] = []

T = TypeVar("T")


def tidy_up_when_ended() -> list[signal.Signals]:
    """Have this process leave all its blocks when it is told to end; its exit code is that of `BY_SIGNAL`.

    Returns:
        The signals that this concerns: others are ignored, or handled by somebody else, and stay so.
    """
    taken = [number for number in _ENDING if signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, _leave)
    return taken


@contextmanager
def tidied_up_when_ended() -> Iterator[None]:
    """Leave the block, with all that it tidies up, before such a signal ends the process as it always does.

    Where `tidy_up_when_ended` has been called, and in other threads, which get no signals, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    taken = tidy_up_when_ended()
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)
        if taken and _CAME:
            os.kill(os.getpid(), _CAME[0])


def whole(work: Callable[[], T]) -> T:
    """Do what neither Ctrl-C nor being told to end shall cut in two; they take effect afterwards."""
    if threading.current_thread() is not threading.main_thread():
        return work()
    came: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *_ENDING)}
    taken = [number for number, handler in before.items() if callable(handler)]
    for number in taken:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        return work()
    finally:
        for number in taken:
            signal.signal(number, before[number])
        for number in came[:1]:
            signal.raise_signal(number)


def _leave(number: int, _: object) -> None:
    _CAME.append(number)
    for each in _ENDING:
        if signal.getsignal(each) is _leave:
            signal.signal(each, signal.SIG_IGN)  # tidying up is not cut short
    raise SystemExit(BY_SIGNAL + number)
