"""The score on mistakes that authors make: what is caught, at which line and column, with which guess."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from mistakes.corpus import CIRCUIT, Case, typos_of_names, written_cases

from circuitkit.base.errors import Problem
from circuitkit.circuit import check

CASES = written_cases()
BASES = sorted((Path(__file__).parent / "bases").iterdir())
SHIPPED = sorted((Path(__file__).parent.parent.parent / "circuits").glob("*.yaml"))


@dataclass(frozen=True)
class Score:
    """What became of a case; `others` counts complaints beside the one that is due."""

    case: Case
    caught: bool
    placed: bool
    suggested: bool
    complaints: tuple[Problem, ...]
    others: int

    def __str__(self) -> str:
        case = self.case
        meant = f"{case.file}:{case.line}:{case.column}: {case.says or case.typo_of}"
        return "\n  ".join([case.title, f"meant {meant}", *(f"found {each}" for each in self.complaints)])


def score(case: Case, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Score:
    for name, text in case.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(folder)
    errors, warnings = check(CIRCUIT)
    complaints = warnings if case.warning else errors
    said = [each for each in complaints if case.says in str(each)]
    place = (case.file, case.line, case.column)
    there = [each for each in said if (each.file, each.line, each.column) == place]
    guesses = [str(each).rpartition("did you mean ")[2] for each in there]
    suggested = any(f"'{case.typo_of}'" in guess for guess in guesses)
    others = len(errors) + len(warnings) - 1
    return Score(case, bool(said), bool(there), suggested, tuple(complaints), others)


def report(scores: Sequence[Score], capsys: pytest.CaptureFixture) -> tuple[float, float, float]:
    """Print the score and what is missed; the shares that are caught, placed, and of the typos suggested."""
    typos = [each.suggested for each in scores if each.case.typo_of]
    caught = sum(each.caught for each in scores) / len(scores)
    placed = sum(each.placed for each in scores) / len(scores)
    suggested = sum(typos) / len(typos)
    missed = [each for each in scores if not each.placed or (each.case.typo_of and not each.suggested)]
    lines = [
        f"{len(scores)} mistakes: {caught:.1%} caught, {placed:.1%} at the exact line and column",
        f"{len(typos)} typos among them: {suggested:.1%} with the right suggestion",
        *map(str, missed),
    ]
    with capsys.disabled():
        sys.stdout.write("\n" + "\n".join(lines) + "\n")
    return caught, placed, suggested


@pytest.mark.parametrize("base", BASES, ids=lambda base: base.name)
def test_the_circuits_that_are_spoilt_are_valid(base, monkeypatch):
    monkeypatch.chdir(base)
    assert check(CIRCUIT) == ((), ())


def test_the_mistakes_of_the_corpus(tmp_path, monkeypatch, capsys):
    assert len(CASES) >= 60
    assert len({case.title for case in CASES}) == len(CASES)
    scores = [score(case, tmp_path / str(number), monkeypatch) for number, case in enumerate(CASES)]
    caught, placed, suggested = report(scores, capsys)
    assert caught == 1
    assert placed >= 0.95
    assert suggested >= 0.90
    # A missing key may be reported beside the misspelt one, but no crowd of consequences.
    assert sum(each.others <= 1 for each in scores) / len(scores) >= 0.95


def test_a_typo_in_every_name_of_the_shipped_circuits(tmp_path, monkeypatch, capsys):
    texts = {path: path.read_text("utf-8") for path in SHIPPED}
    cases = [
        Case(f"{path.name}: {name}, line {line}", {CIRCUIT: spoilt}, CIRCUIT, line, column, typo_of=name)
        for seed, (path, text) in enumerate(texts.items())
        if "\ninclude:" not in text
        for spoilt, line, column, name in typos_of_names(text, seed)
    ]
    scores = [score(case, tmp_path, monkeypatch) for case in cases]
    caught, placed, suggested = report(scores, capsys)
    assert caught == 1
    assert placed >= 0.95
    assert suggested >= 0.90
