"""What is killed or short of space while it is done in a process of its own."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from apart import Ended, apart

_WRITES = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.truncate"}


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
