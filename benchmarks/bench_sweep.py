"""A sweep against bare physics on all processors: the same robots, the same number of physics steps.

The sweep is everything: starting the processes, planning the walk, pushes, sensors with noise, the circuit,
the measures, and rows on the disk. Bare is nothing but `Batch.step` of MuJoCo, with a thread for each
processor and the walk's targets written once a control step.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.bench_loop import bare_batch
from circuitkit.study import CaseBuilder, Study, load_study, sweep
from circuitkit.study.bench import Amount
from circuitkit.study.scheduler import BATCH
from circuitkit.study.workers import processors

_SEEDS = 400  # enough that the start of the processes counts as little as in a sweep of minutes
_MOST = 1 / 0.85  # of the time of bare physics: a throughput of 0.85


def cases() -> tuple[Amount, ...]:
    """A study of one cell, in which the robots stand to the end."""
    return (Amount("sweep: all processors", "x the time of Batch.step alone", _prepare, limit=_MOST),)


def _prepare() -> Callable[[], float]:
    study = load_study("push_limits").with_(
        {
            "search": None,
            "seeds": {"count": _SEEDS},
            "set": {"reference.gait": "gait_march", "controller": "circuit", "push.force": "10 N"},
            "axes": {
                "reference.gait": None,
                "contender": None,
                "push.direction": ["inward"],
                "push.duration": None,
            },
        }
    )
    bare = _bare(study)

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            results = sweep(study, Path(folder), progress=False)
            swept = time.perf_counter() - began
        (share,) = results.shares()
        if share.survived < share.runs:
            message = f"{share.runs - share.survived} robots fell: the amounts of work differ"
            raise AssertionError(message)
        began = time.perf_counter()
        bare()
        return swept / (time.perf_counter() - began)

    return once


def _bare(study: Study) -> Callable[[], None]:
    plan = CaseBuilder(study).of_cell(study.cells[0]).plan()
    targets, size = plan.body.motion.targets, BATCH * processors()
    counts = [min(size, _SEEDS - done) for done in range(0, _SEEDS, size)]
    batches = [bare_batch(plan, np.repeat(targets[:, np.newaxis], count, axis=1)) for count in counts]

    def step_all() -> None:
        for step in batches:
            step()

    return step_all


if __name__ == "__main__":
    (case,) = cases()
    measured = case.prepare()
    for _ in range(3):
        print(f"{1 / measured():.3f} x the throughput of bare Batch.step")
