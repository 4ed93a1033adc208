"""Workers: how they end, and what they are told from elsewhere."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest

from circuitkit.base.errors import InputError, Problem
from circuitkit.robots import load_robot
from circuitkit.study.processes import Processes
from circuitkit.study.workers import _told_by

ROOT = Path(__file__).parents[2]


def workers_of(pid):
    """The processes that do a process's runs."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text(encoding="utf-8").split():
            command = Path(f"/proc/{child}/cmdline").read_bytes().replace(b"\0", b" ")
            found += [int(child)] if b"spawn_main" in command else []
    return found


def lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="processes are found by /proc")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_no_worker_is_left_when_its_parent_ends(tmp_path, number, code):
    """Whether it is asked to end or killed; and what is asked leaves no file half-written."""
    words = [sys.executable, "-m", "circuitkit", "sweep", "push_limits", "-o", "out", "--workers", "2"]
    env = os.environ | {
        "PYTHONPATH": str(ROOT),
        "OPENBLAS_NUM_THREADS": "1",
        "CIRCUITKIT_CACHE": str(tmp_path / "cache"),
    }
    running = subprocess.Popen(words, cwd=tmp_path, env=env, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while len(children := workers_of(running.pid)) < 2 and time.monotonic() < until:
        time.sleep(0.02)
    time.sleep(4.0)  # they compile, or run already
    running.send_signal(number)
    _, said = running.communicate(timeout=60)
    assert running.returncode == code, said
    assert "Traceback" not in said
    while any(map(lives, children)) and time.monotonic() < until + 60:
        time.sleep(0.1)
    assert not any(map(lives, children))
    assert [path for name in ("*.part*", "building-*") for path in tmp_path.rglob(name)] == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_start_of_a_process_is_not_cut_in_two(monkeypatch, number):
    """What was told to end meanwhile ends afterwards, and a process that never started is no obstacle."""

    def leave(came, _):
        raise SystemExit(came)

    done = []

    def start(_):
        signal.raise_signal(number)
        done.append("started")

    before = signal.signal(number, leave)
    try:
        monkeypatch.setattr(SpawnProcess, "start", start)
        processes = Processes(1)
        with pytest.raises(SystemExit):
            processes.submit(os.getpid)
        processes.shutdown()
    finally:
        signal.signal(number, before)
    assert done == ["started"]


def test_a_robot_that_is_sent_elsewhere_knows_where_it_lies(tmp_path, monkeypatch):
    path = load_robot("vehicle").folder
    monkeypatch.chdir(path.parent)
    robot = load_robot(Path(path.name) / "robot.yaml")
    assert not robot.mjcf_path.is_absolute()
    sent = pickle.dumps(robot)
    monkeypatch.chdir(tmp_path)
    assert pickle.loads(sent).mjcf_path.is_file()


def test_what_a_worker_elsewhere_complains_of_names_it():
    found = _told_by(
        "tcp://10.0.0.1:4, process 7 on 'far'", InputError(Problem("x.xml", 1, 1, "", "no file"))
    )
    assert str(found) == (
        "x.xml:1:1: no file; so says the worker tcp://10.0.0.1:4, process 7 on 'far', which needs the same "
        "files at the same paths"
    )
