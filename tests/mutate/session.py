"""A run of pytest that learns which tests call which functions, and then tries mutants in processes."""

from __future__ import annotations

import errno
import functools
import gc
import os
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from types import FrameType, FunctionType

import pytest
from _pytest.runner import runtestprotocol
from apart import apart, without_streams
from mutate.mutants import Mutant

_TESTS_S = 20.0  # for the tests of one mutant
_STUCK_S = 60.0
_TAKE_AWAY = frozenset({"os.rename", "os.remove", "os.rmdir", "os.chmod", "shutil.rmtree"})
_MAY_CHANGE = (tempfile.gettempdir(), str(Path.home() / ".cache"))


class Session:
    """A plugin: takes the place of the loop over tests.

    Attributes:
        outcomes: For each mutant "killed", "survived" or "not called".
    """

    def __init__(self, mutants: Sequence[Mutant]) -> None:
        self.mutants = mutants
        self.files = {str(each.path) for each in mutants}
        self.outcomes: dict[Mutant, str] = {}
        self._calls: dict[tuple[str, str], list[tuple[float, pytest.Item]]] = defaultdict(list)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the tests once, then some of them for every mutant."""
        for item in session.items:
            self._learn(item)
        for number, mutant in enumerate(self.mutants):
            tests = sorted(self._calls.get((str(mutant.path), mutant.function), ()), key=lambda each: each[0])
            outcome = _tried(mutant, [item for _, item in tests]) if tests else "not called"
            self.outcomes[mutant] = outcome
            if outcome != "killed":
                sys.__stdout__.write(f"{number}: {outcome}: {describe(mutant)}\n")
                sys.__stdout__.flush()
        return True

    def _learn(self, item: pytest.Item) -> None:
        called: set[tuple[str, str]] = set()

        def note(frame: FrameType, event: str, _argument: object) -> None:
            if event == "call" and frame.f_code.co_filename in self.files:
                called.add((frame.f_code.co_filename, frame.f_code.co_qualname.partition(".<locals>")[0]))

        begun = time.perf_counter()
        sys.setprofile(note)
        try:
            reports = runtestprotocol(item, log=False, nextitem=None)
        finally:
            sys.setprofile(None)
        if all(report.passed for report in reports):
            for function in called:
                self._calls[function].append((time.perf_counter() - begun, item))


def describe(mutant: Mutant) -> str:
    """Where and what a mutant is."""
    return f"{Path(os.path.relpath(mutant.path)).as_posix()}:{mutant.line}: {mutant.function}: {mutant.what}"


def _tried(mutant: Mutant, items: Sequence[pytest.Item]) -> str:
    """Whether a test fails with a mutant; a process that crashes or does not end has noticed it, too."""

    def work() -> bool:
        without_streams()
        sys.addaudithook(_stay_in_our_folders)
        return _is_noticed(mutant, items)

    return "survived" if apart(work, _STUCK_S).value is False else "killed"


def _stay_in_our_folders(event: str, arguments: tuple[object, ...]) -> None:
    """Refuse to take away files of the machine, which changed code may do if the one who runs it is root."""
    if event in _TAKE_AWAY:
        paths = [str(each) for each in arguments[:2] if isinstance(each, str | os.PathLike)]
        # Those that are not absolute are below the folder of a test.
        if any(path.startswith("/") and not path.startswith(_MAY_CHANGE) for path in paths):
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM), paths[-1])


def _is_noticed(mutant: Mutant, items: Sequence[pytest.Item]) -> bool:
    code = mutant.code()
    for each in gc.get_objects():
        if isinstance(each, FunctionType) and each.__code__.co_filename == str(mutant.path):
            new = code.get((each.__code__.co_qualname, each.__code__.co_firstlineno))
            if new is not None and each.__code__.co_freevars == new.co_freevars:
                each.__code__ = new
        elif isinstance(each, functools._lru_cache_wrapper):
            each.cache_clear()
    end = time.monotonic() + _TESTS_S
    for item in items:
        if any(report.failed for report in runtestprotocol(item, log=False, nextitem=None)):
            return True
        if time.monotonic() > end:
            break
    return False
