"""The progress bar: only where a person is watching."""

from __future__ import annotations

import io
import sys

import pytest

from circuitkit.base import progress
from circuitkit.base.progress import progress_bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("stream", "shown"), [(io.StringIO(), True), (Terminal(), False)])
def test_there_is_no_bar_without_a_terminal_or_a_wish(monkeypatch, stream, shown):
    monkeypatch.setattr(sys, "stderr", stream)
    with progress_bar("running", 3, shown=shown) as advance:
        assert advance is None
    assert stream.getvalue() == ""


@pytest.mark.parametrize(("late_s", "is_seen"), [(0.0, True), (60.0, False)])
def test_a_bar_appears_when_it_takes_long(monkeypatch, late_s, is_seen):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "_LATE_S", late_s)
    with progress_bar("running", 4) as advance:
        advance(1)
        advance(2, 4, "still running")
    assert ("still running" in stream.getvalue()) == is_seen
