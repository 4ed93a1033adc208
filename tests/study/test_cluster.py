"""A Dask scheduler and two workers as processes of their own on loopback; one worker is killed on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import pytest
from study.cut import small_study

from circuitkit.study import open_workers, sweep
from circuitkit.study.identity import versions
from circuitkit.study.scheduler import CasesByCell
from circuitkit.study.workers import Done, WorkerError, require_same_environment


@pytest.mark.parametrize("address", ["nonsense", "", "http://127.0.0.1:1", "tcp://127.0.0.1", "tcp://:8786"])
def test_what_is_no_address_of_a_scheduler_is_refused_at_once(address):
    refused = pytest.raises(WorkerError, match=r"allowed: the address of a Dask scheduler, such as tcp://")
    with refused, open_workers(scheduler=address):
        pass


@contextmanager
def process(*words):
    """A process that is killed at the end, with the lines that it writes."""
    one = {"OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}
    running = subprocess.Popen(
        [sys.executable, "-m", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | one,
    )
    try:
        yield running
    finally:
        running.kill()
        running.stderr.close()
        running.wait()


def line_with(running, text):
    """The first line that a process writes with this text in it."""
    for line in running.stderr:
        if text in line:
            return line
    message = f"the process ended without writing '{text}'"
    raise AssertionError(message)


@pytest.fixture(scope="module")
def cluster():
    """Address of a scheduler, and its two workers, which keep their files to themselves."""
    with ExitStack() as stack:
        started = process(
            "distributed.cli.dask_scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            "0",
            "--no-dashboard",
            "--no-show",
        )
        scheduler = stack.enter_context(started)
        address = line_with(scheduler, "Scheduler at:").split()[-1]
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "20")
        workers = [
            stack.enter_context(process("distributed.cli.dask_worker", address, *options)) for _ in range(2)
        ]
        for worker in workers:
            line_with(worker, "Starting established connection")
        yield address, workers


def test_a_lost_worker_changes_nothing_in_the_results(cluster, tmp_path):
    address, workers = cluster
    study = small_study().with_({"axes": {"contender": ["open loop"]}, "watch": "0.8 s"})

    def kill_one_worker(done, _):
        if done > 0 and workers[0].poll() is None:
            os.kill(workers[0].pid, signal.SIGKILL)

    sweep(study, tmp_path / "cluster", scheduler=address, batch=1, progress=kill_one_worker)
    assert workers[0].wait(timeout=10) == -signal.SIGKILL
    assert workers[1].poll() is None
    sweep(study, tmp_path / "here", workers=1, progress=False)
    bytes_of = [(tmp_path / place / "results.parquet").read_bytes() for place in ("cluster", "here")]
    assert bytes_of[0] == bytes_of[1]


def test_a_scheduler_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setattr("circuitkit.study.workers._CONNECT_S", 0.2)
    message = r"cannot reach a Dask scheduler at 'tcp://127\.0\.0\.1:1'"
    with pytest.raises(WorkerError, match=message), open_workers(scheduler="tcp://127.0.0.1:1"):
        pass


def test_a_worker_with_other_versions_is_refused_since_its_bits_may_be_others():
    case = CasesByCell(small_study())(0, 0)
    ours = {"versions": versions(), "backend": {}}
    require_same_environment(Done((), ours), case)
    other = Done((), {**ours, "versions": versions() | {"mujoco": "3.0.0"}})
    message = (
        rf"the worker process \d+ on '.+' has mujoco 3.0.0; "
        rf"allowed: as this process, mujoco {versions()['mujoco']}"
    )
    with pytest.raises(WorkerError, match=message):
        require_same_environment(other, case)


def test_a_worker_that_has_lost_its_compiler_is_refused_since_its_bits_are_others():
    case = CasesByCell(small_study().with_({"axes": {"contender": ["tuned, towards the edge"]}}))(0, 0)
    ours = {"versions": versions(), "backend": {"circuit": "compiled"}}
    require_same_environment(Done((), ours), case)
    message = "has run the circuit by the backend circuit numpy; allowed: as this process, circuit compiled"
    with pytest.raises(WorkerError, match=message):
        require_same_environment(Done((), {**ours, "backend": {"circuit": "numpy"}}), case)
