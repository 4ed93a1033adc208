"""What is done in a process of its own, which may be killed or short of space meanwhile."""

from __future__ import annotations

import os
import pickle
import resource
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_WRITES = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.truncate"}


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        signal: Of what it died; 0 if it ended by itself.
        value: What its function returned, or the exception that it raised.
    """

    signal: int
    value: Any = None


def apart(work: Callable[[], Any]) -> Ended:
    """Call a function in a forked process."""
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
    with os.fdopen(read, "rb") as pipe:
        data = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return Ended(os.WTERMSIG(status))
    return Ended(0, pickle.loads(data))


def killed_at(number: int, folder: Path, work: Callable[[], Any]) -> Ended:
    """Call a function, and kill it just before the given write into a folder, counted from 0."""

    def go() -> Any:
        left = number

        def watch(event: str, arguments: tuple[Any, ...]) -> None:
            nonlocal left
            if event in _WRITES and _is_write(event, arguments) and _is_inside(arguments, folder):
                if left == 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                left -= 1

        sys.addaudithook(watch)
        return work()

    return apart(go)


def _is_write(event: str, arguments: tuple[Any, ...]) -> bool:
    if event != "open":
        return True
    mode, flags = arguments[1], arguments[2]
    return any(letter in (mode or "") for letter in "wax+") or bool((flags or 0) & (os.O_WRONLY | os.O_RDWR))


def _is_inside(arguments: tuple[Any, ...], folder: Path) -> bool:
    paths = [each for each in arguments[:2] if isinstance(each, str | bytes | os.PathLike)]
    return any(os.fsdecode(each).startswith(str(folder)) for each in paths)


def with_files_up_to(size: int, work: Callable[[], Any]) -> Ended:
    """Call a function that can write no file beyond a size, as if a disk were full [bytes]."""

    def go() -> Any:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
        return work()

    return apart(go)
