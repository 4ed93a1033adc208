"""The text of a small tuning, and changed copies of it."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from circuitkit.base.source import find_data_file
from circuitkit.study.tuning.measure import Measure
from circuitkit.study.tuning.objective import Score

# The circuit that is tuned: numbers of its own, so that tests do not depend on those of a shipped one.
BASE = """\
circuit: base
control_step: 10 ms
timing: ordered
include: [binn_lateral.yaml]
parameters: {w: -0.5 deg, leak: 4 %, margin: 4 mm, one_foot: 0.9}
"""
SMALL = """\
study: small
scenario: nao_push
set: {reference.gait: gait_march, push.start.step: 4, push.direction: outward}
watch: 1 s
tune:
  circuit: base.yaml
  parameters:
    w: {from: -2 deg, to: -0.1 deg, log: true}
    leak: {from: 1 %, to: 20 %}
  start: {leak: 5 %}
  maximise:
    - {figure: survived, runs: pushed}
    - {figure: rms_ankle_roll, runs: calm, weight: -0.2, unit: deg, beyond: 0.1 deg}
  runs:
    pushed:
      axes: {push.force: [10 N]}
      scale: {push.force: [60 %, 90 %, 120 %]}
    calm: {set: {push: [], duration: 3 s}}
  train: {seeds: {first: 100, count: 1}}
  test: {seeds: {first: 0, count: 1}}
  sampler: tpe
  generation: 2
  trials: 3
  result: small_tuned
"""


def written(folder: Path, *changes: tuple[str, str], text: str = SMALL) -> Path:
    """The file of a tuning with some words changed; beside it lies the circuit that is tuned."""
    shutil.copy(find_data_file("binn_lateral", "circuits"), folder)
    (folder / "base.yaml").write_text(BASE, encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "small.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def make_runs_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have candidates measured without a run: the objective is minus the leak."""

    def measured(_: object, candidates: Iterable[Mapping[str, str]]) -> list[Score]:
        found = [float(each["leak"].removesuffix(" %")) for each in candidates]
        return [Score(-leak, (1.0, leak), 4) for leak in found]

    monkeypatch.setattr(Measure, "__call__", measured)
