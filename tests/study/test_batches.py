"""Batches under way, with workers that do what a test tells them, and a clock that it moves."""

from __future__ import annotations

from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from circuitkit.study import batches as module
from circuitkit.study.batches import Batches
from circuitkit.study.workers import LostJobError, WorkerError


class Told:
    """Workers: a future is done when a test says so."""

    def __init__(self, timeout_s=None):
        self.timeout_s, self.futures, self.stopped = timeout_s, [], []

    def submit(self, _):
        self.futures.append(Future())
        return self.futures[-1]

    def outcome(self, future, _):
        return future.result()

    def stop(self, future, waited_s):
        self.stopped.append((self.futures.index(future), waited_s))


def job(*seeds, duration=2.0):
    case = SimpleNamespace(scenario=SimpleNamespace(duration=duration, scenario="small"))
    return SimpleNamespace(case=case, specs=[SimpleNamespace(seed=each) for each in seeds])


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """What time it is, in a list; a wait takes none."""
    now = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(module, "_LOOK_S", 0.01)
    return now


def passing(batches, clock, seconds):
    """A machine that is awake: it looks every 10 ms."""
    for _ in range(round(seconds / 0.02)):
        clock[0] += 0.02
        list(batches.wait())


def test_what_is_done_comes_back_with_who_asked():
    workers = Told()
    batches = Batches(workers)
    batches.begin(job(0), "a")
    batches.begin(job(1), "b")
    assert len(batches) == 2
    done = SimpleNamespace(seconds=1.0)
    workers.futures[1].set_result(done)
    assert list(batches.wait()) == [("b", done)]
    assert len(batches) == 1
    batches.cancel()
    assert workers.futures[0].cancelled()


def test_what_is_lost_is_done_three_times(caplog):
    workers = Told()
    batches = Batches(workers)
    batches.begin(job(3, 4, 3), "a")
    for number in range(2):
        workers.futures[number].set_exception(LostJobError("worker 7 was ended by signal 9"))
        assert list(batches.wait()) == []
    lost = "3 runs of the scenario 'small' with seed 3, 4"
    assert caplog.messages == [
        f"worker 7 was ended by signal 9; its batch ({lost}) is run again, try {n} of 3" for n in (2, 3)
    ]
    workers.futures[2].set_exception(LostJobError("worker 8 was ended by signal 9"))
    with pytest.raises(WorkerError) as caught:
        list(batches.wait())
    assert str(caught.value) == (
        f"a batch was lost 3 times: {lost}; the last time, worker 8 was ended by signal 9"
    )


def test_a_worker_that_is_stuck_is_ended_once_and_what_to_do_is_told(clock):
    workers = Told(timeout_s=0.1)
    batches = Batches(workers)
    batches.begin(job(5), "a")
    for number in range(3):
        passing(batches, clock, 0.08)
        assert len(workers.stopped) == number
        passing(batches, clock, 0.06)
        assert [each for each, _ in workers.stopped] == list(range(number + 1))
        workers.futures[number].set_exception(LostJobError("worker 7 was ended by signal 9"))
        if number < 2:
            list(batches.wait())
    with pytest.raises(WorkerError) as caught:
        list(batches.wait())
    assert str(caught.value) == (
        "a batch was lost 3 times: 1 run of the scenario 'small' with seed 5; the last time, worker 7 was "
        "stuck at it for 0 s and was ended; allow more by --timeout (timeout_s)"
    )


def test_a_pause_of_the_machine_does_not_count(clock):
    workers = Told(timeout_s=0.1)
    batches = Batches(workers)
    batches.begin(job(5), "a")
    clock[0] += 1000.0
    list(batches.wait())
    assert workers.stopped == []


def test_a_batch_may_take_twenty_times_what_others_took_for_as_much_work():
    workers = Told()
    batches = Batches(workers)
    batches.begin(job(0, 1), "a")  # 4 s of simulated time in 6 s
    batches.begin(job(2, 3, 4), "b")  # 6 s
    late = batches._under_way[workers.futures[1]]
    assert batches._limit_s(late) == 600.0
    workers.futures[0].set_result(SimpleNamespace(seconds=6.0))
    list(batches.wait())
    assert batches._limit_s(late) == 60.0 + 20.0 * 9.0
    workers.futures[1].set_exception(LostJobError("lost"))
    list(batches.wait())
    assert batches._limit_s(late) == 2 * (60.0 + 20.0 * 9.0)
