"""The exception family, and `Problem`: one complaint about one place of a file.

Every message says where, what was found, what is allowed, and where it can, what was probably meant.
"""

from __future__ import annotations

import difflib
import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

_LOG = logging.getLogger("circuitkit")
_SHOWN_NAMES = 20
_SHORT_NAME = 2
_LONGEST_SUGGESTED = 100
_SAME_CASE = 1e-3  # less than any other difference, so that it decides between equals
_WORDS = re.compile("[a-z0-9]+")


_LONG_WORD = re.compile(r"([^\s;,']{100})[^\s;,']{100,}")  # of a message
# User and password of a URL, as SQLAlchemy reads them: a user has no slash, a password may have anything.
_SECRET = re.compile(
    r"(?<=://)[^:/\s@]*(?::\S*)?(?=@)|(?<=\w:)(?!//)[^\s'\"]*(?=@)|(?<=password=|..passwd=)[^&\s'\"]+"
)


def without_secrets(text: str) -> str:
    """A text without the users and passwords of the URLs in it."""
    return _SECRET.sub("…", text)


def printable(text: str) -> str:
    """A text as it may be shown: with an escape for what would write over a terminal, and without secrets."""
    text = without_secrets(text)
    if text.isprintable():
        return text
    shown = (c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)
    return "".join(shown)


@cache
def warn_once(text: str) -> None:
    """Say once in the life of a process what is allowed, and doubtful."""
    _LOG.warning("%s", text)


@dataclass(frozen=True)
class Problem:
    """One complaint about one place of a file; `str()` is `file:line:column: where: message; hint`.

    Attributes:
        file: The file as the user named it; empty for a complaint that belongs to no file.
        line: Line, from 1.
        column: Column, from 1.
        where: The place in the file's own terms, such as `neurons.q1.slope`; may be empty.
        message: What was found; what is allowed.
        hint: What was probably meant or what to do; may be empty.
    """

    file: str
    line: int
    column: int
    where: str
    message: str
    hint: str = ""

    @property
    def is_placed(self) -> bool:
        """Whether it says where in a file; if not, whatever names the file or the value knows a place."""
        return bool(self.file)

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.file else ""
        message = _LONG_WORD.sub(r"\1…", without_secrets(self.message))
        text = ": ".join(part for part in (place, self.where, message) if part)
        return printable(f"{text}; {self.hint}" if self.hint else text)


class Unopened(Problem):
    """A complaint about a file that is not there or cannot be opened, and so has no line of its own."""

    @property
    def is_placed(self) -> bool:
        """False: the file that names this one has the place."""
        return False


class CircuitkitError(Exception):
    """Base of all errors that circuitkit raises on purpose; their text can be shown as it is.

    Attributes:
        exit_code: What the command line exits with: 1 the input is wrong, 3 the run failed.
    """

    exit_code: ClassVar[int] = 3

    def __str__(self) -> str:
        return printable(super().__str__())


class InputError(CircuitkitError):
    """What the user wrote is wrong; carries every problem found, not only the first."""

    exit_code: ClassVar[int] = 1

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*problems)
        self.problems: tuple[Problem, ...] = problems

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


class UnknownNameError(InputError, LookupError):
    """A name that does not exist was asked for; the message lists those that do."""

    def __init__(self, kind: str, name: str, available: Iterable[str]) -> None:
        """Describe the failed look-up.

        Args:
            kind: What was looked for, such as "neuron".
            name: The name that was not found.
            available: The names that exist.
        """
        names = tuple(available)
        message = f"unknown {kind} '{name}'; allowed: {listing(names)}"
        super().__init__(Problem("", 0, 0, "", message, suggest(name, names)))
        self._look_up = (kind, name, names)

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, str, tuple[str, ...]]]:
        """Pickle by the arguments of `__init__`, not by those of `Exception`."""
        return type(self), self._look_up


class UnitError(CircuitkitError, ValueError):
    """A quantity cannot be read, or has the wrong dimension."""

    exit_code: ClassVar[int] = 1


class OutOfRangeError(UnitError):
    """A quantity is larger or smaller than any float."""


class ExpressionError(CircuitkitError, ValueError):
    """A mathematical expression cannot be read, or joins what does not fit together.

    Attributes:
        offset: Where in its text, from 0.
    """

    exit_code: ClassVar[int] = 1

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.offset = offset


class MissingDependencyError(CircuitkitError):
    """A feature needs a package that is an extra and is not installed."""

    def __init__(self, package: str, extra: str, purpose: str = "") -> None:
        """Name the package and the extra that brings it.

        Args:
            package: The import that failed, such as "imageio".
            extra: The extra of the distribution that brings it, such as "video".
            purpose: What needs it, such as "writing a video".
        """
        self._arguments = (package, extra, purpose)
        needed = purpose or "this"
        super().__init__(
            f"{needed} needs the package '{package}', which is not installed; "
            f"install it with: pip install 'neurocircuitkit[{extra}]'"
        )

    def __reduce__(self) -> tuple[type[MissingDependencyError], tuple[str, str, str]]:
        """Pickle by the arguments of `__init__`, not by the message."""
        return type(self), self._arguments


class SimulationError(CircuitkitError):
    """The simulation cannot go on."""


class DivergedError(SimulationError):
    """A number that is not finite came out of a step."""


def suggest(name: str, allowed: Iterable[str]) -> str:
    """`did you mean 'q1'?` for the nearest allowed name, or an empty text if none is near.

    Near are names with letters that are wrong, missing, too many or in the wrong order, in another case, with
    their words in another order, cut short, or written out.
    """
    if len(name) > _LONGEST_SUGGESTED:
        return ""
    near = 0.5 if len(name) <= _SHORT_NAME else 0.6  # of two letters, one may be wrong
    matcher = difflib.SequenceMatcher(b=name.lower())
    best = ""
    for candidate in allowed:
        if candidate == name or len(candidate) > _LONGEST_SUGGESTED:
            continue
        matcher.set_seq1(candidate.lower())
        if _is_part(name, candidate) or matcher.quick_ratio() >= near:
            likeness = _likeness(name, candidate, matcher)
            if likeness > near or (likeness == near and not best):
                best, near = candidate, likeness
    return f"did you mean '{best}'?" if best else ""


def _likeness(name: str, candidate: str, matcher: difflib.SequenceMatcher[str]) -> float:
    """1 for equal names, 0 for names without a common letter; equal letter case counts a little."""
    a, b = name.lower(), candidate.lower()
    edited = 1 - _edits(a, b) / max(len(a), len(b), 1)
    reordered = 0.9 if sorted(_WORDS.findall(a)) == sorted(_WORDS.findall(b)) else 0.0
    part = 0.7 if _is_part(name, candidate) else 0.0
    alike = max(edited, matcher.ratio(), reordered, part)
    same_case = sum(x == y for x, y in zip(name, candidate, strict=False)) / max(len(a), len(b), 1)
    return alike + _SAME_CASE * same_case


def _is_part(name: str, candidate: str) -> bool:
    """Whether one is the beginning of the other, and long enough to tell."""
    short, long = sorted((name.lower(), candidate.lower()), key=len)
    return len(short) > _SHORT_NAME and long.startswith(short)


def _edits(a: str, b: str) -> int:
    """How many letters to insert, remove, replace or swap with their neighbour to make b of a.

    The optimal string alignment distance: a table d[i][j] for the first i letters of a and j of b, by rows.
    """
    before, row = [0] * (len(b) + 1), list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        above, last = row, before
        row = [i]
        for j, y in enumerate(b, 1):
            cost = min(above[j] + 1, row[j - 1] + 1, above[j - 1] + (x != y))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                cost = min(cost, last[j - 2] + 1)
            row.append(cost)
        before = above
    return row[-1]


def listing(names: Iterable[str]) -> str:
    """The names separated by commas, cut after twenty; `nothing` if there are none."""
    every = tuple(names)
    if not every:
        return "nothing"
    shown = ", ".join(every[:_SHOWN_NAMES])
    return shown if len(every) <= _SHOWN_NAMES else f"{shown} and {len(every) - _SHOWN_NAMES} more"
