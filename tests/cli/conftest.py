"""Fixtures that run a command line inside this process, in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from circuitkit.cli.main import main


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


@pytest.fixture
def circuitkit(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[..., Outcome]:
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> Outcome:
        code = main(words)
        printed = capsys.readouterr()
        return Outcome(code, printed.out, printed.err)

    return call


@pytest.fixture
def refused(circuitkit: Callable[..., Outcome]) -> Callable[..., str]:
    """The one line by which a command refuses wrong input; it prints nothing else and exits with 1."""

    def call(*words: str) -> str:
        outcome = circuitkit(*words)
        assert (outcome.code, outcome.out) == (1, "")
        (line,) = outcome.err.splitlines()
        return line

    return call
