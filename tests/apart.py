"""What is done in a process of its own, which may crash, be killed, or never end."""

from __future__ import annotations

import os
import pickle
import select
import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        signal: Of what it died; 0 if it ended by itself.
        value: What its function returned, or the exception that it raised.
        was_stuck: Whether it was killed because it took too long.
    """

    signal: int
    value: Any = None
    was_stuck: bool = False


def apart(work: Callable[[], Any], limit_s: float | None = None) -> Ended:
    """Call a function in a forked process, and kill that if it takes longer than a time."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.close(read)
            try:
                value = work()
            except Exception as error:
                value = error
            with os.fdopen(write, "wb") as pipe:
                pickle.dump(value, pipe)
        finally:
            os._exit(0)
    os.close(write)
    was_stuck = not select.select([read], [], [], limit_s)[0]
    if was_stuck:
        os.kill(child, signal.SIGKILL)
    with os.fdopen(read, "rb") as pipe:
        data = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return Ended(os.WTERMSIG(status), was_stuck=was_stuck)
    return Ended(0, pickle.loads(data) if data else EOFError("it ended without an answer"))


def without_streams() -> None:
    """Have this process read and print nothing any more."""
    null = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(null, number)
