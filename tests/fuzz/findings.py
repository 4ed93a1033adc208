"""What counts as a finding, and how one is made small."""

from __future__ import annotations

import re
import resource
import signal
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from apart import apart, without_streams
from fuzz.targets import TARGETS, tried

from circuitkit.base.errors import CircuitkitError

LONGEST_S = 5.0  # of the processor, for others work on it as well
MOST_BYTES = 1 << 30
_STUCK_S = 4 * LONGEST_S  # of the clock: an extension module does not listen to signals
_PACKAGE = "circuitkit"


class OverTimeError(BaseException):
    """A file took too long; no `except Exception` takes it for an answer."""


_NAMES: dict[type, str] = {MemoryError: "over 1 GiB", OverTimeError: "over 5 s"}


@dataclass(frozen=True)
class Trial:
    """Files that were tried.

    Attributes:
        target: What they were given to.
        files: Their bytes by name.
        spoilt: Which of them was spoilt.
    """

    target: str
    files: Mapping[str, bytes]
    spoilt: str

    def write(self, folder: Path) -> Path:
        """Write the files; returns the path that the target takes."""
        for name, data in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return folder / (TARGETS[self.target].entry or self.spoilt)


@dataclass(frozen=True)
class Finding:
    """What was wrong with what came of a trial.

    Attributes:
        key: Equal for findings of one cause: what is wrong, and where it was raised.
        message: The exception, or the complaint.
    """

    key: str
    message: str


def limit_memory() -> None:
    """Let this process take so much more than it has now."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))


def _ring(_number: int, _frame: FrameType | None) -> None:
    raise OverTimeError


def judged(trial: Trial, folder: Path) -> Finding | None:
    """Try files in this process; None if they were answered as they should be."""
    path = trial.write(folder)
    target = TARGETS[trial.target]
    signal.signal(signal.SIGPROF, _ring)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        problems = tried(target, path)
    except (Exception, OverTimeError) as error:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        has_place = target.may_fail or str(folder) in str(error)
        if isinstance(error, CircuitkitError) and has_place:
            return None
        what = "no place: " if isinstance(error, CircuitkitError) else ""
        return Finding(
            f"{what}{_NAMES.get(type(error), type(error).__name__)} at {_place(error)}", repr(error)
        )
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    for problem in problems:
        has_line = problem.file and problem.line >= 1 and problem.column >= 1
        if not has_line and not (target.entry == "." and str(folder) in problem.message):
            return Finding(f"no place: {_plain(problem.message)}", str(problem))
    return None


def _place(error: BaseException) -> str:
    """Where an exception was raised: the last line of ours, and below it the last one of a library."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if f"/{_PACKAGE}/" in frame.filename]
    last = ours[-1] if ours else frames[-1]
    return f"{Path(last.filename).name}:{last.name}"


def _plain(text: str) -> str:
    """A message without what comes from the file."""
    return re.sub(r"'[^']*'|\[\d+\]|[\d.e+-]*\d", "…", text)[:80]


def judged_apart(trial: Trial) -> Finding | None:
    """Try files in a process of their own, which may crash."""

    def work() -> Finding | None:
        limit_memory()
        without_streams()
        with tempfile.TemporaryDirectory() as folder:
            return judged(trial, Path(folder))

    ended = apart(work, _STUCK_S)
    if ended.was_stuck:
        return Finding(f"stuck: {trial.target}", "does not end")
    if ended.signal or isinstance(ended.value, Exception):
        what = f"signal {ended.signal}" if ended.signal else "no answer"
        return Finding(f"crash of {trial.target}: {what}", "the interpreter crashed")
    found: Finding | None = ended.value
    return found


def smallest(trial: Trial, finding: Finding, seconds: float = 20.0) -> Trial:
    """The least of the files that still gives the same finding: without files, lines, words, characters."""
    end = time.monotonic() + seconds

    def is_same(candidate: Trial) -> bool:
        found = judged_apart(candidate) if time.monotonic() < end else None
        return found is not None and found.key == finding.key

    for name in [name for name in trial.files if name != trial.spoilt]:
        fewer = replace(trial, files={key: data for key, data in trial.files.items() if key != name})
        if is_same(fewer):
            trial = fewer
    for split in (_in_lines, _in_words):
        for name in sorted(trial.files, key=lambda name: name != trial.spoilt):
            if name.endswith((".npz", ".parquet")):
                continue

            def is_same_with(pieces: list[bytes], name: str = name) -> bool:
                return is_same(replace(trial, files={**trial.files, name: b"".join(pieces)}))  # noqa: B023 - called at once

            pieces = _reduced(split(trial.files[name]), is_same_with)
            trial = replace(trial, files={**trial.files, name: b"".join(pieces)})
    return trial


def _in_lines(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True)


def _in_words(data: bytes) -> list[bytes]:
    return re.findall(rb"\w+|\s+|[^\w\s]", data)


def _reduced(pieces: list[bytes], is_same: Callable[[list[bytes]], bool]) -> list[bytes]:
    """Leave out what can be left out, in ever smaller parts (Zeller's delta debugging)."""
    size = max(1, len(pieces) // 2)
    while pieces:
        at = 0
        while at < len(pieces):
            fewer = pieces[:at] + pieces[at + size :]
            if is_same(fewer):
                pieces = fewer
            else:
                at += size
        if size == 1:
            break
        size = max(1, size // 2)
    return pieces
