"""The database of a tuning: how it is opened and waited for, and its errors in our words.

Optuna's tables hold the candidates, so that its tools can show them; nothing else of Optuna's is relied on.
"""

from __future__ import annotations

import logging
import re
import sqlite3
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from circuitkit.base.errors import (
    CircuitkitError,
    InputError,
    MissingDependencyError,
    Problem,
    without_secrets,
)

try:
    import optuna
    import sqlalchemy as sql
    from sqlalchemy.exc import SQLAlchemyError
except ImportError as missing:  # an extra
    raise MissingDependencyError(missing.name or "optuna", "tune", "tuning") from missing

_LOG = logging.getLogger("circuitkit")
_SLICE_S = 1.0  # how long SQLite waits by itself
_SAID_AFTER_S = 3.0
_PATIENCE_S = 600.0
_PAUSE_S = 0.05

T = TypeVar("T")


class StorageError(CircuitkitError):
    """The database of a tuning cannot be used: it is damaged, locked, full or not to be written."""


@dataclass(frozen=True)
class Storage:
    """A storage as the user named it.

    Attributes:
        url: Its URL.
        folder: The folder in which it lies, if the user named that one.
    """

    url: str
    folder: Path | None = None

    def __str__(self) -> str:
        return without_secrets(self.url) if self.folder is None else f"'{self.folder}'"

    @property
    def option(self) -> str:
        """What names it on the command line."""
        return "--storage" if self.folder is None else "--output"

    @property
    def word(self) -> str:
        """What it is."""
        return "storage" if self.folder is None else "folder"

    @property
    def anew(self) -> str:
        """How to have another one."""
        return f"begin anew in another {self.word} ({self.option})"


def opened(place: Storage) -> optuna.storages.RDBStorage:
    """The database, whose tables are made if they are missing; several processes may do so at once.

    Raises:
        InputError: There is no such database, and none can be made.
        StorageError: It cannot be used.
    """
    options: dict[str, Any] = {}
    if place.url.startswith("sqlite"):
        options = {"connect_args": {"timeout": _SLICE_S}}

    def work() -> optuna.storages.RDBStorage:
        return optuna.storages.RDBStorage(place.url, engine_kwargs=dict(options))

    try:
        return patiently(place, work)
    except (ImportError, sql.exc.ArgumentError, sql.exc.NoSuchModuleError) as error:  # no driver, no URL
        first = without_secrets(str(error.__cause__ or error).splitlines()[0])
        raise _cannot_open(place, first) from error


def _cannot_open(place: Storage, why: str) -> InputError:
    message = f"cannot open '{without_secrets(place.url)}': {why}; allowed: a URL such as sqlite:///x.db"
    return InputError(Problem("", 0, 0, "--storage", message))


def patiently(place: Storage, work: Callable[[], T]) -> T:
    """Do something with a database, again and again while somebody else has it locked.

    What is done must be a transaction, so that it may be done again.

    Raises:
        InputError: The database cannot be opened.
        StorageError: It cannot be used.
    """
    began, said = time.monotonic(), False
    while True:
        try:
            return work()
        except (CircuitkitError, sql.exc.ArgumentError, sql.exc.NoSuchModuleError):
            raise
        except _FOREIGN as error:
            why = _reason(error)
            waited = time.monotonic() - began
            if not _WAITING.search(why) or waited > _PATIENCE_S:
                raise _translated(place, error, why) from error
            if waited > _SAID_AFTER_S and not said:
                _LOG.warning("waiting for the database of %s: %s", place, why)
                said = True
            time.sleep(_PAUSE_S)


# What Optuna and SQLAlchemy raise: also for values that no database of theirs holds.
_FOREIGN = (
    SQLAlchemyError,
    sqlite3.Error,
    optuna.exceptions.OptunaError,
    RuntimeError,
    ValueError,
    LookupError,
    AssertionError,
    TypeError,
    OSError,
)
# Locked for a while; or another process has just made the same table or its only row.
_WAITING = re.compile(
    r"is locked|already exists|UNIQUE constraint failed: (alembic_version|version_info)|deadlock|"
    r"lock wait timeout",
    re.IGNORECASE,
)
_MESSAGES = (
    (
        r"is locked|lock wait",
        "is locked by another process for more than 10 min; end that one, then --resume",
    ),
    (r"is full|no space left", "cannot be written: no space left on the device; make room, then --resume"),
    (
        r"readonly|read-only|permission",
        "cannot be written: {why}; change its mode or that of its folder, or name another one ({option})",
    ),
    (
        r"optuna version|storage upgrade|alembic|revision",
        "was made by another version of Optuna: `optuna storage upgrade --storage URL` converts it, or "
        "{anew}",
    ),
    (r"no such (table|column)|has no column", "is a database, but none of this Optuna ({why}); {anew}"),
    (r"disk i/o", "cannot be read or written: {why}; see to the disk, then --resume"),
    (
        r"not a database|malformed|corrupt|unsupported file format|out of range|not an error",
        "is damaged ({why}); put a copy of it back, or {anew}",
    ),
)


def _reason(error: BaseException) -> str:
    """The innermost words for what went wrong."""
    while error.__cause__ is not None:
        error = error.__cause__
    original = getattr(error, "orig", None)
    words = str(original or error).strip() or type(error).__name__
    return f"the key {words} is missing" if isinstance(error, KeyError) else words.splitlines()[0]


def _translated(place: Storage, error: BaseException, why: str) -> CircuitkitError:
    """An exception of SQLAlchemy, SQLite or Optuna in our words."""
    why = why.replace(place.url, str(place))
    name = f"the database of {place}" if place.folder is not None else f"the database {place}"
    if re.search("unable to open|could not connect|connection", why, re.IGNORECASE):
        return _cannot_open(place, why)
    for pattern, message in _MESSAGES:
        if re.search(pattern, why, re.IGNORECASE):
            return StorageError(f"{name} {message.format(why=why, option=place.option, anew=place.anew)}")
    if isinstance(error, SQLAlchemyError | sqlite3.Error | optuna.exceptions.OptunaError):
        return StorageError(f"{name} cannot be used: {why}")
    return StorageError(f"{name} is damaged ({why}); put a copy of it back, or {place.anew}")
