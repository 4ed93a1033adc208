"""The lock of a study in a storage: one process at a time works on a study, and others are told which one.

It is a row of a table beside Optuna's, and so serves every database and many machines. The lock of a
process that has died is taken over: here by the process's number and start, from elsewhere by its silence.
"""

from __future__ import annotations

import logging
import os
import socket
import time
import uuid
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import sqlalchemy as sql
from sqlalchemy.exc import IntegrityError, SQLAlchemyError

from circuitkit.study.tuning.storage import Storage, StorageError, opened, patiently

_LOG = logging.getLogger("circuitkit")
_SILENT_S = 900.0  # after so long without a sign of life, a process on another machine counts as dead
_SIGN_S = 30.0  # between two signs of life
_DEAD = {"Z", "X"}  # states of proc(5) of what has ended

_LOCKS = sql.Table(
    "circuitkit_locks",
    sql.MetaData(),
    sql.Column("study", sql.String(512), primary_key=True),
    sql.Column("token", sql.String(64), nullable=False),
    sql.Column("host", sql.String(255), nullable=False),
    sql.Column("pid", sql.Integer, nullable=False),
    sql.Column("born", sql.String(64), nullable=False),
    sql.Column("seen", sql.Float(53), nullable=False),
)


@dataclass
class StudyLock:
    """Says that a process works on a study; gone when its block ends, or stale when its process does.

    Attributes:
        place: The storage.
        study: Name of the study.
    """

    place: Storage
    study: str
    _engine: Any = None
    _token: str = field(default_factory=lambda: uuid.uuid4().hex)
    _seen: float = 0.0

    def __enter__(self) -> StudyLock:
        """Take the lock.

        Raises:
            StorageError: A process that lives has it.
        """
        self._engine = opened(self.place).engine
        patiently(self.place, lambda: _LOCKS.create(self._engine, checkfirst=True))
        patiently(self.place, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        """Give it back; it is stale anyway if that is impossible."""
        try:
            with self._engine.begin() as connection:
                connection.execute(sql.delete(_LOCKS).where(_LOCKS.c.token == self._token))
        except SQLAlchemyError as error:
            _LOG.info("the lock of %s stays: %s", self.place, error)
        self._engine.dispose()

    def _take(self) -> None:
        mine = {
            "token": self._token,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "born": _born(os.getpid()),
            "seen": time.time(),
        }
        own = _LOCKS.c.study == self.study
        with self._engine.begin() as connection:
            before = connection.execute(sql.select(_LOCKS).where(own)).mappings().first()
        if before is not None and self._lives(before):
            since = f"last seen {max(time.time() - before['seen'], 0):.0f} s ago"
            message = (
                f"process {before['pid']} on '{before['host']}' works on the study '{self.study}' in "
                f"{self.place} ({since}); wait for it, end it, or name another {self.place.word} "
                f"({self.place.option})"
            )
            raise StorageError(message)
        try:
            with self._engine.begin() as connection:
                if before is not None:  # whoever is faster finds it changed
                    old = own & (_LOCKS.c.token == before["token"])
                    done = connection.execute(sql.update(_LOCKS).where(old).values(**mine)).rowcount
                else:
                    done = connection.execute(sql.insert(_LOCKS).values(study=self.study, **mine)).rowcount
        except IntegrityError:
            done = 0
        if not done:
            self._take()
        self._seen = time.monotonic()

    @staticmethod
    def _lives(row: Any) -> bool:  # noqa: ANN401 - a row of the table
        if row["host"] == socket.gethostname():
            return bool(row["born"] == _born(row["pid"]))
        return bool(time.time() - row["seen"] < _SILENT_S)

    def sign(self) -> None:
        """Give a sign of life, now and then.

        Raises:
            StorageError: Another process has taken the study over.
        """
        if time.monotonic() - self._seen < _SIGN_S:
            return
        own = (_LOCKS.c.study == self.study) & (_LOCKS.c.token == self._token)

        def work() -> int:
            with self._engine.begin() as connection:
                return int(
                    connection.execute(sql.update(_LOCKS).where(own).values(seen=time.time())).rowcount
                )

        if not patiently(self.place, work):
            message = f"another process has taken over the study '{self.study}' in {self.place}"
            raise StorageError(message)
        self._seen = time.monotonic()


def _born(pid: int) -> str:
    """When a process was started, where the system tells; empty if there is none of this number."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2]
        state, *others = fields.split()
        return "" if state in _DEAD else others[18]  # starttime, the 22nd: proc(5)
    except OSError:
        pass
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return ""
    except OSError:
        pass
    return "unknown"
