"""Processes of this machine: who gets what work, and what is known of one that ends."""

from __future__ import annotations

import os
import signal
import socket
import time
from concurrent.futures import BrokenExecutor

import pytest

from circuitkit.study.processes import Processes, environment, this_process, whole


def test_variables_are_there_for_a_while(monkeypatch):
    monkeypatch.setenv("CIRCUITKIT_A", "old")
    monkeypatch.delenv("CIRCUITKIT_B", raising=False)
    with environment(CIRCUITKIT_A="1", CIRCUITKIT_B="2"):
        assert (os.environ["CIRCUITKIT_A"], os.environ["CIRCUITKIT_B"]) == ("1", "2")
    assert os.environ["CIRCUITKIT_A"] == "old"
    assert "CIRCUITKIT_B" not in os.environ


def test_a_ctrl_c_takes_effect_after_what_is_whole():
    before, done = signal.getsignal(signal.SIGINT), []

    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        done.append(1)

    with pytest.raises(KeyboardInterrupt):
        whole(work)
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is before
    assert whole(lambda: 7) == 7


def test_work_goes_to_who_has_least_and_a_process_that_ends_is_replaced():
    host = socket.gethostname()
    with Processes(2) as processes:
        slow = processes.submit(time.sleep, 30)
        other = processes.submit(this_process)
        assert processes.name(other) == f"worker {other.result()}"
        assert processes.name(slow) != processes.name(other)
        assert other.result().endswith(f" on '{host}'")
        threads = processes.submit(os.getenv, "OMP_NUM_THREADS")
        assert threads.result() == "1"
        ended = processes.submit(os._exit, 5)
        with pytest.raises(BrokenExecutor):
            ended.result()
        assert processes.how_it_ended(ended) == ("ended with exit code 5", False)
        again = processes.submit(this_process)
        assert processes.name(again) == f"worker {again.result()}" != processes.name(other)
        processes.kill(slow)
        with pytest.raises(BrokenExecutor):
            slow.result()
        assert processes.how_it_ended(slow) == ("was ended by signal 9 (SIGKILL)", True)
        begun = time.monotonic()
        left = processes.submit(time.sleep, 30)
        told = processes.submit(signal.raise_signal, signal.SIGTERM)
        with pytest.raises(BrokenExecutor):
            told.result()
        assert processes.how_it_ended(told) == ("was ended by signal 15 (SIGTERM)", True)
    assert time.monotonic() - begun < 20
    assert left.done()
