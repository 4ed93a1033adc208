"""Being told to end: SIGTERM and SIGHUP end a process as an exception does, so that it tidies up."""

from __future__ import annotations

import signal

BY_SIGNAL = 128  # and the signal's number: the exit code of what a signal has ended, as shells report it
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


def tidy_up_when_ended() -> None:
    """Have this process leave all its blocks when it is told to end; signals that are ignored stay so."""
    for number in _ENDING:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _leave)


def _leave(number: int, _: object) -> None:
    for each in _ENDING:
        signal.signal(each, signal.SIG_IGN)  # tidying up is not cut short
    raise SystemExit(BY_SIGNAL + number)
