"""`circuitkit format`."""

from __future__ import annotations

from pathlib import Path

import pytest

UNTIDY = """\
circuit: c
control_step: 10ms  # of the loop
timing: ordered
neurons:
  n: {role: excitatory, model: identity}
outputs:
  y: {unit: "1", readout: {n: 1}}
"""
TIDY = """\
circuit: c
control_step: 10 ms  # of the loop
timing: ordered

neurons:
  n: {model: identity, role: excitatory}

outputs:
  y: {unit: "1", readout: {n: 1}}
"""


@pytest.fixture(autouse=True)
def files(tmp_path):
    (tmp_path / "untidy.yaml").write_text(UNTIDY, encoding="utf-8")
    (tmp_path / "tidy.yaml").write_text(TIDY, encoding="utf-8")
    (tmp_path / "wrong.yaml").write_text(UNTIDY.replace("identity", "identty"), encoding="utf-8")


def test_files_are_formatted(circuitkit):
    outcome = circuitkit("format", "untidy.yaml", "tidy.yaml")
    assert (outcome.code, outcome.out) == (0, "")
    assert outcome.err == "untidy.yaml: formatted\ntidy.yaml: left as it is\n"
    assert Path("untidy.yaml").read_text(encoding="utf-8") == TIDY
    assert sorted(path.name for path in Path().iterdir()) == ["tidy.yaml", "untidy.yaml", "wrong.yaml"]


def test_check_writes_nothing_and_says_which(circuitkit):
    outcome = circuitkit("format", "untidy.yaml", "tidy.yaml", "--check")
    assert (outcome.code, outcome.err) == (1, "")
    assert outcome.out == "untidy.yaml: in another form\ntidy.yaml: in the normal form\n"
    assert Path("untidy.yaml").read_text(encoding="utf-8") == UNTIDY
    assert circuitkit("format", "tidy.yaml", "--check").code == 0


def test_diff_prints_a_patch(circuitkit):
    outcome = circuitkit("format", "untidy.yaml", "--diff")
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[:2] == ["--- untidy.yaml", "+++ untidy.yaml (normal form)"]
    assert "-control_step: 10ms  # of the loop" in lines
    assert "+control_step: 10 ms  # of the loop" in lines
    assert circuitkit("format", "tidy.yaml", "--diff").out == ""
    assert circuitkit("format", "untidy.yaml", "--diff", "--check").code == 1


def test_a_wrong_file_is_left_and_the_others_are_done(circuitkit):
    before = Path("wrong.yaml").read_bytes()
    outcome = circuitkit("format", "wrong.yaml", "untidy.yaml")
    assert outcome.code == 1
    assert outcome.err.startswith("wrong.yaml:5:32: neurons.n.model: unknown model 'identty'; ")
    assert outcome.err.endswith("\nuntidy.yaml: formatted\n")
    assert Path("wrong.yaml").read_bytes() == before


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gone.txt", "gone.txt:1:1: there is no such file; allowed: a YAML file\n"),
        (".", ".:1:1: found a folder; allowed: a YAML file\n"),
    ],
)
def test_what_is_no_file(circuitkit, name, message):
    outcome = circuitkit("format", name)
    assert (outcome.code, outcome.out, outcome.err) == (1, "", message)


def test_a_folder_that_cannot_be_written(circuitkit, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "write_text", refuse)
    outcome = circuitkit("format", "untidy.yaml")
    assert (outcome.code, outcome.err) == (3, "cannot write 'untidy.yaml': Permission denied\n")
