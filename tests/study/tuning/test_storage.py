"""The storage of a tuning: kills, locks, several at once, and databases that cannot be used."""

from __future__ import annotations

import json
import os
import shutil
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from small_tuning import make_runs_up, written

from circuitkit.base.errors import CircuitkitError, InputError
from circuitkit.base.files import OutputError
from circuitkit.study.tuning import lock as lock_module
from circuitkit.study.tuning import run
from circuitkit.study.tuning import storage as storage_module
from circuitkit.study.tuning.lock import StudyLock
from circuitkit.study.tuning.measure import Measure
from circuitkit.study.tuning.run import tune
from circuitkit.study.tuning.storage import Storage, StorageError

TESTS = Path(__file__).parents[2]


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A small tuning whose runs are made up, without pictures."""
    make_runs_up(monkeypatch)
    monkeypatch.setattr(run, "draw_history", lambda *_: None)
    return written(tmp_path)


def environment():
    path = os.pathsep.join([str(TESTS.parent), str(TESTS)])
    return os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}


def test_killed_and_resumed_it_leaves_what_one_leaves_that_was_never_stopped(tmp_path):
    """At the first statements, and between two candidates; at many more moments by make torture."""
    words = [
        sys.executable,
        str(TESTS / "tuning_kills.py"),
        str(tmp_path),
        "2",
        "190",
        "440",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment())
    assert json.loads(done.stdout)["differing"] == []


def test_who_works_on_a_study_is_told_and_other_studies_go_on(study, tmp_path):
    storage = Storage(f"sqlite:///{tmp_path}/trials.db")
    with StudyLock(storage, "small"), StudyLock(storage, "another"):
        who = f"process {os.getpid()} on '{socket.gethostname()}'"
        message = f"{who} works on the study 'small' in .*; wait for it"
        with pytest.raises(StorageError, match=message):
            tune(study, tmp_path / "out", workers=1, storage=storage.url, resume=True)
    assert len(tune(study, tmp_path / "out", workers=1, storage=storage.url).history.trials) == 3


@pytest.mark.parametrize(
    ("in_folder", "said"),
    [
        (False, "{url} (last seen 0 s ago); wait for it, end it, or name another storage (--storage)"),
        (True, "'{folder}' (last seen 0 s ago); wait for it, end it, or name another folder (--output)"),
    ],
)
def test_a_lock_says_who_has_it_and_what_to_do(tmp_path, in_folder, said):
    url = f"sqlite:///{tmp_path}/trials.db"
    storage = Storage(url, tmp_path if in_folder else None)
    with StudyLock(storage, "small") as lock:
        lock.sign()
        with pytest.raises(StorageError) as caught:
            StudyLock(storage, "small").__enter__()
    who = f"process {os.getpid()} on '{socket.gethostname()}' works on the study 'small' in "
    assert str(caught.value) == who + said.format(url=url, folder=tmp_path)
    with StudyLock(storage, "small"), sqlite3.connect(tmp_path / "trials.db") as database:
        ((study, pid, born),) = database.execute("select study, pid, born from circuitkit_locks").fetchall()
    stat = Path(f"/proc/{os.getpid()}/stat")
    if stat.exists():  # proc(5): the 22nd field, after the name in brackets and the 3rd
        assert born == stat.read_text(encoding="utf-8").rpartition(")")[2].split()[19]
    assert (study, pid) == ("small", os.getpid())
    with sqlite3.connect(tmp_path / "trials.db") as database:
        assert database.execute("select count(*) from circuitkit_locks").fetchone() == (0,)


def test_a_sign_of_life_is_given_now_and_then(tmp_path, monkeypatch):
    storage = Storage(f"sqlite:///{tmp_path}/trials.db")

    def seen() -> float:
        with sqlite3.connect(tmp_path / "trials.db") as database:
            return database.execute("select seen from circuitkit_locks").fetchone()[0]

    with StudyLock(storage, "small") as lock:
        first = seen()
        assert abs(first - time.time()) < 60
        lock.sign()
        assert seen() == first
        monkeypatch.setattr(lock_module, "_SIGN_S", 0.0)
        lock.sign()
        assert seen() > first


def test_a_process_that_has_ended_has_no_time_of_birth():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended_pid = ended.pid
    deadline = time.monotonic() + 20
    while lock_module._born(ended_pid) and time.monotonic() < deadline:  # a zombie until it is waited for
        time.sleep(0.02)
    assert lock_module._born(ended_pid) == ""
    ended.wait()
    assert lock_module._born(ended_pid) == ""
    assert lock_module._born(os.getpid()) == lock_module._born(os.getpid()) != ""


@pytest.mark.parametrize(
    ("why", "said"),
    [
        (
            "database is locked",
            "is locked by another process for more than 10 min; end that one, then --resume",
        ),
        (
            "database or disk is full",
            "cannot be written: no space left on the device; make room, then --resume",
        ),
        (
            "attempt to write a readonly database",
            "cannot be written: attempt to write a readonly database; change its mode or that of its folder, "
            "or name another one (--output)",
        ),
        (
            "The runtime optuna version is no longer compatible",
            "was made by another version of Optuna: `optuna storage upgrade --storage URL` converts it, or "
            "begin anew in another folder (--output)",
        ),
        (
            "no such table: trials",
            "is a database, but none of this Optuna (no such table: trials); begin anew in another folder "
            "(--output)",
        ),
        ("disk I/O error", "cannot be read or written: disk I/O error; see to the disk, then --resume"),
        (
            "database disk image is malformed",
            "is damaged (database disk image is malformed); put a copy of it back, or begin anew in another "
            "folder (--output)",
        ),
        ("something else", "cannot be used: something else"),
    ],
)
def test_what_sqlite_says_is_told_with_what_to_do(tmp_path, monkeypatch, why, said):
    monkeypatch.setattr(storage_module, "_PATIENCE_S", 0.0)
    place = Storage(f"sqlite:///{tmp_path}/trials.db", tmp_path)

    def work() -> None:
        raise sqlite3.OperationalError(why)

    with pytest.raises(StorageError) as caught:
        storage_module.patiently(place, work)
    assert str(caught.value) == f"the database of '{tmp_path}' {said}"


def test_what_no_database_holds_is_damage_and_what_is_no_database_is_told():
    place = Storage("sqlite:////none/such/x.db")

    def missing() -> None:
        key = "params"
        raise KeyError(key)

    with pytest.raises(StorageError) as caught:
        storage_module.patiently(place, missing)
    assert str(caught.value) == (
        "the database sqlite:////none/such/x.db is damaged (the key 'params' is missing); put a copy of it "
        "back, or begin anew in another storage (--storage)"
    )
    with pytest.raises(InputError) as wrong:
        storage_module.opened(place)
    assert str(wrong.value) == (
        "--storage: cannot open 'sqlite:////none/such/x.db': unable to open database file; allowed: a URL "
        "such as sqlite:///x.db"
    )


def test_work_is_done_again_while_somebody_else_has_the_database(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(storage_module, "_SAID_AFTER_S", -1.0)
    tries = iter([sqlite3.OperationalError("database is locked")] * 2)

    def work() -> int:
        for error in tries:
            raise error
        return 7

    assert storage_module.patiently(Storage("sqlite:///x.db", tmp_path), work) == 7
    assert caplog.messages == [f"waiting for the database of '{tmp_path}': database is locked"]


def test_the_lock_of_a_dead_process_is_taken_over(tmp_path):
    storage = Storage(f"sqlite:///{tmp_path}/trials.db")
    code = (
        "import os, sys; from circuitkit.study.tuning.lock import *; "
        "StudyLock(Storage(sys.argv[1]), 'small').__enter__(); os._exit(9)"
    )
    words = [sys.executable, "-c", code, storage.url]
    assert subprocess.run(words, check=False, env=environment()).returncode == 9
    with StudyLock(storage, "small"):
        pass


def test_the_lock_of_another_machine_is_taken_over_when_it_was_silent_for_long(tmp_path, monkeypatch):
    storage = Storage(f"sqlite:///{tmp_path}/trials.db")
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(socket, "gethostname", lambda: "far")
        theirs = StudyLock(storage, "small")
        theirs.__enter__()
    with pytest.raises(StorageError, match="on 'far' works on the study"):
        StudyLock(storage, "small").__enter__()
    monkeypatch.setattr(lock_module, "_SILENT_S", 0.0)
    with StudyLock(storage, "small"):
        monkeypatch.setattr(lock_module, "_SIGN_S", 0.0)
        with pytest.raises(StorageError, match="another process has taken over the study 'small'"):
            theirs.sign()


def test_three_that_begin_at_once_on_a_new_storage_all_run(tmp_path):
    code = (
        "import sys, time; from circuitkit.study.tuning.search import *; silence_optuna(verbose=False)\n"
        "P = {'x': Searched.model_validate({'from': '0', 'to': '1'})}\n"
        "S = Search(sys.argv[2], P, {'x': 0.5}, 'tpe', 1, False, 4)\n"
        "time.sleep(max(float(sys.argv[3]) - time.time(), 0))\n"
        "run_search(S, sys.argv[1], 5, lambda c: [Score(1.0, (), 1)] * len(c))"
    )
    url, begin = f"sqlite:///{tmp_path}/trials.db", str(time.time() + 8)
    words = [[sys.executable, "-c", code, url, name, begin] for name in "abc"]
    running = [subprocess.Popen(each, stderr=subprocess.PIPE, text=True, env=environment()) for each in words]
    assert [(each.communicate()[1], each.returncode) for each in running] == [("", 0)] * 3


def test_a_database_that_is_locked_for_some_seconds_is_waited_for(study, tmp_path, caplog):
    tune(study, tmp_path / "out", workers=1)
    blocker = sqlite3.connect(tmp_path / "out/trials.db", check_same_thread=False, isolation_level=None)
    blocker.execute("BEGIN EXCLUSIVE")
    timer = threading.Timer(5.0, blocker.execute, ("ROLLBACK",))
    timer.start()
    assert len(tune(study, tmp_path / "out", workers=1, trials=5, resume=True).history.trials) == 5
    timer.join()
    blocker.close()
    assert "waiting for the database of" in caplog.text


def garbage(path):
    path.write_bytes(b"no database at all" * 300)


def truncated(path):
    path.write_bytes(path.read_bytes()[:6000])


def other_tables(path):
    path.unlink()
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE studies (x)")
    database.close()


def older_optuna(path):
    with sqlite3.connect(path) as database:
        database.execute("UPDATE alembic_version SET version_num = 'v2.6.0.a'")
    database.close()


def another_value(path):
    with sqlite3.connect(path) as database:
        database.execute("UPDATE trial_values SET value = value + 1 WHERE trial_value_id = 2")
    database.close()


def another_candidate(path):
    with sqlite3.connect(path) as database:
        database.execute("DELETE FROM trials WHERE number = 1")
    database.close()


SPOILT = {
    garbage: r"the database of '.*out' is damaged \(file is not a database\); put a copy of it back",
    truncated: r"is damaged \(database disk image is malformed\)",
    other_tables: r"is a database, but none of this Optuna",
    older_optuna: r"was made by another version of Optuna: `optuna storage upgrade",
    another_value: r"trial 1 of the study 'small' in '.*out' is not what this version of circuitkit has",
    another_candidate: r"trial 1 of the study 'small' in '.*out' is not what this version",
}


@pytest.mark.parametrize("spoil", SPOILT)
def test_a_database_that_is_damaged_is_told_with_what_to_do(study, tmp_path, spoil):
    tune(study, tmp_path / "out", workers=1)
    spoil(tmp_path / "out/trials.db")
    with pytest.raises(StorageError, match=SPOILT[spoil]):
        tune(study, tmp_path / "out", workers=1, resume=True)


@pytest.mark.skipif(os.geteuid() == 0 and not shutil.which("chattr"), reason="root may write everywhere")
def test_a_disk_that_is_full_is_told(study, tmp_path, monkeypatch):
    tune(study, tmp_path / "out", workers=1)
    connect = sqlite3.connect

    def small(*arguments, **keys):
        database = connect(*arguments, **keys)
        pages = database.execute("PRAGMA page_count").fetchone()[0]
        database.execute(f"PRAGMA max_page_count = {pages}")
        return database

    monkeypatch.setattr(sqlite3, "connect", small)
    monkeypatch.setattr(sqlite3.dbapi2, "connect", small)
    with pytest.raises(StorageError, match="no space left on the device; make room, then --resume"):
        tune(study, tmp_path / "out", workers=1, trials=99, resume=True)


def test_a_folder_whose_name_is_no_text_has_no_database(study, tmp_path):
    with pytest.raises(OutputError, match="its name is not UTF-8, as that of a database must be"):
        tune(study, tmp_path / os.fsdecode(b"\xff"), workers=1)
    assert not (tmp_path / os.fsdecode(b"\xff")).exists()


def test_no_password_is_shown(study, tmp_path):
    url = "nonsense://me:se:cr@et@host/db"
    assert str(Storage(url)) == "nonsense://…@host/db"
    with pytest.raises(InputError) as refused:
        tune(study, tmp_path / "out", workers=1, storage=url)
    assert "se:cr" not in str(refused.value)
    assert "et@" not in str(refused.value)


@pytest.mark.usefixtures("study")
@pytest.mark.parametrize("stage", ["confirm", "test"])
def test_ctrl_c_after_the_search_is_told_and_gone_on_with(tmp_path, monkeypatch, stage):
    confirm = "  confirm: {seeds: {first: 200, count: 1}, best: 2}\n  test:"
    path = written(tmp_path, ("  test:", confirm))
    measured = Measure.__call__

    def interrupted(self, candidates):
        if self.runs == self.tuning.runs(stage):
            raise KeyboardInterrupt
        return measured(self, candidates)

    monkeypatch.setattr(Measure, "__call__", interrupted)
    tuned = tune(path, tmp_path / "out", workers=1)
    assert tuned.history.interrupted
    assert "3 candidates are kept in" in tuned.kept
    assert "--resume" in tuned.kept
    monkeypatch.setattr(Measure, "__call__", measured)
    again = tune(path, tmp_path / "out", workers=1, resume=True)
    assert again.test is not None
    assert again.kept == ""
    assert issubclass(StorageError, CircuitkitError)
