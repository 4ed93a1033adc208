"""The command line of tuning; what it finds is tested in tests/study/tuning."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_tuning import make_runs_up, written

from circuitkit.study.tuning.measure import Measure


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A small tuning whose runs are made up: the objective is minus the leak."""
    make_runs_up(monkeypatch)
    return str(written(tmp_path))


def test_the_best_is_printed_beside_the_start_and_written(circuitkit, study, tmp_path):
    outcome = circuitkit("tune", study, "-o", "out", "--trials", "5", "--workers", "1")
    assert outcome.code == 0
    assert outcome.err == "wrote out/small_tuned.yaml\n"
    assert "small: 5 candidates" in outcome.out
    assert {"trials.db", "trials.csv", "history.png", "history.pdf", "small_tuned.yaml"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }
    assert circuitkit("validate", "out/small_tuned.yaml").code == 0


def test_json_and_resumption(circuitkit, study):
    words = ("tune", study, "-o", "out", "--workers", "1", "--json")
    first = json.loads(circuitkit(*words).out)
    assert first["trials"] == 3
    again = circuitkit(*words)
    assert again.code == 1
    assert again.err == (
        "--output: found a study 'small' in 'out' already; "
        "go on with it by --resume, or choose another folder\n"
    )
    in_it = circuitkit(*words, "--storage", "sqlite:///out/trials.db")
    assert "--storage: found a study 'small' in sqlite:///out/trials.db already" in in_it.err
    more = json.loads(circuitkit(*words, "--resume", "--trials", "5", "--result", "mine.yaml").out)
    assert more["trials"] == 5
    assert more["result"] == "mine.yaml"
    assert more["train"]["objective"] >= first["train"]["objective"]
    assert more["start"] == {"objective": -5.0, "figures": [1.0, 5.0]}


def test_verbose_tells_what_each_generation_brought(circuitkit, study):
    outcome = circuitkit("tune", study, "-o", "out", "--trials", "5", "--workers", "1", "--verbose")
    assert "train: 3 of 5, best -" in outcome.err
    assert "train: 5 of 5, best -" in outcome.err


def test_after_ctrl_c_the_best_so_far_is_written(circuitkit, study, monkeypatch):
    measured = Measure.__call__
    calls = []

    def interrupted(self, candidates):
        calls.append(len(candidates))
        if len(calls) > 1:
            raise KeyboardInterrupt
        return measured(self, candidates)

    monkeypatch.setattr(Measure, "__call__", interrupted)
    outcome = circuitkit("tune", study, "-o", "out", "--trials", "9", "--workers", "1")
    assert outcome.code == 130
    assert outcome.err == (
        "wrote out/small_tuned.yaml\n"
        "3 candidates are kept in 'out'; --resume (resume=True) goes on with the tuning\ninterrupted\n"
    )
    assert "small: 3 candidates" in outcome.out


def test_ctrl_c_before_the_first_candidate_says_how_to_go_on(circuitkit, study, monkeypatch):
    """And neither --resume nor another folder is needed, since nothing is there that could be lost."""

    def interrupted(*_):
        raise KeyboardInterrupt

    measured = Measure.__call__
    monkeypatch.setattr(Measure, "__call__", interrupted)
    words = ("tune", study, "-o", "out", "--trials", "3", "--workers", "1")
    outcome = circuitkit(*words)
    assert (outcome.code, outcome.err) == (
        130,
        "0 candidates are kept in 'out'; --resume (resume=True) goes on with the tuning\ninterrupted\n",
    )
    monkeypatch.setattr(Measure, "__call__", measured)
    again = circuitkit(*words, "--json")
    assert (again.code, json.loads(again.out)["trials"]) == (0, 3)
    assert json.loads(again.out)["start"] == {"objective": -5.0, "figures": [1.0, 5.0]}


def workers_of(pid):
    """The processes that a process has started and that do its runs."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text(encoding="utf-8").split():
            command = Path(f"/proc/{child}/cmdline").read_bytes().replace(b"\0", b" ")
            found += [child] if b"spawn_main" in command else []
    return found


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="processes are found by /proc")
@pytest.mark.parametrize("after_s", [0.0, 0.02, 0.1, 0.5])
def test_ctrl_c_while_workers_start_is_quiet(tmp_path, after_s):
    """A real process; all of its workers get the signal, as from a terminal, in whatever they just do."""
    path = written(tmp_path)
    words = [sys.executable, "-m", "circuitkit", "tune", str(path), "-o", "out", "--workers", "3"]
    running = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    until = time.monotonic() + 60
    while not workers_of(running.pid) and running.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    time.sleep(after_s)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=30)
    assert said == (
        "0 candidates are kept in 'out'; --resume (resume=True) goes on with the tuning\ninterrupted\n"
    )
    assert running.returncode == 130


def test_the_file_that_is_tuned_is_not_overwritten(circuitkit, study, tmp_path):
    (tmp_path / "mine.yaml").write_text(circuitkit("show", "binn_lateral_tuned", "--resolved").out)
    written(tmp_path, ("circuit: base.yaml", "circuit: mine.yaml"))
    outcome = circuitkit("tune", study, "-o", "out", "--result", "mine.yaml")
    assert outcome.code == 1
    assert "--result: found 'mine.yaml', the file that is tuned; allowed: another file" in outcome.err


def test_without_optuna_it_is_said_what_to_install(circuitkit, study, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("circuitkit.study.tuning.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "optuna", None)
    outcome = circuitkit("tune", study, "-o", "out")
    assert outcome.code == 3
    assert outcome.err == (
        "tuning needs the package 'optuna', which is not installed; "
        "install it with: pip install 'neurocircuitkit[tune]'\n"
    )
