"""Clocks that are wrong: in 1970, in a far century, going back, standing still."""

from __future__ import annotations

import itertools
import time

import pytest
from apart import apart

from circuitkit.study import make_study, sweep

STUDY = {
    "study": "short",
    "scenario": "vehicle_avoids",
    "set": {"duration": "50 ms"},
    "seeds": {"count": 3},
}
CLOCKS = {
    "1970": lambda: 0.0,
    "far future": lambda: 2.0**33,
    "back": lambda: next(_BACK),
    "still": lambda: 1e9,
}
_BACK = itertools.count(2e9, -3600.0)


def swept(folder):
    sweep(make_study(STUDY), folder, workers=1, progress=False, batch=1)


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_clock_that_is_wrong_changes_no_result(tmp_path, monkeypatch, clock):
    assert apart(lambda: swept(tmp_path / "right")).value is None
    monkeypatch.setattr(time, "time", CLOCKS[clock])
    monkeypatch.setattr(time, "time_ns", lambda: int(CLOCKS[clock]() * 1e9))
    assert apart(lambda: swept(tmp_path / "wrong")).value is None
    right, wrong = (tmp_path / name / "results.parquet" for name in ("right", "wrong"))
    assert right.read_bytes() == wrong.read_bytes()
