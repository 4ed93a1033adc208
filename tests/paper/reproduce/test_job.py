"""Studies of figures: where their runs lie, and what happens to runs of other files."""

from __future__ import annotations

import pytest

from circuitkit.base.errors import InputError
from circuitkit.paper.reproduce.figure import Job
from circuitkit.study import make_study


def study(**changes):
    return make_study(
        {
            "study": "tiny",
            "scenario": "nao_push",
            "watch": "0.3 s",
            "set": {"push.start.step": 0, "reference.gait": "gait_march"},
            "axes": {
                "contender": {
                    "open_loop": {"controller": "open_loop"},
                    "binn": {"controller": "circuit", "circuit": "binn_lateral"},
                },
                "push.direction": ["outward", "inward"],
            },
            "seeds": {"first": 0, "count": 1},
            "search": {"field": "push.force", "low": "0 N", "high": "40 N", "step": "40 N"},
            **changes,
        }
    )


def parts(folder):
    return sorted(path.parent.relative_to(folder).as_posix() for path in folder.rglob("results.parquet"))


def test_runs_lie_in_the_figures_folder_coarse_and_full_apart(tmp_path):
    Job("fig11", tmp_path, quick=True, workers=1).sweep(study())
    Job("fig11", tmp_path, workers=1).sweep(study(), "other")
    assert parts(tmp_path) == ["full/other", "quick/tiny"]


def test_apart_or_together_the_rows_are_the_same(tmp_path):
    together = Job("fig11", tmp_path / "a", workers=1).sweep(study())
    apart = Job("fig11", tmp_path / "b", workers=1).sweep(study(), apart="contender")
    assert apart.rows == together.rows
    assert apart.limits() == together.limits()
    assert parts(tmp_path / "b") == ["full/tiny/binn", "full/tiny/open_loop"]


def test_a_change_of_one_contender_leaves_the_runs_of_the_others(tmp_path):
    said = []
    job = Job("fig11", tmp_path, workers=1, log=said.append)
    job.sweep(study(), apart="contender")
    binn = {"controller": "circuit", "circuit": "binn_lateral"}
    others = {"open_loop": {"controller": "open_loop"}, "binn": binn | {"circuit.w": "1 deg"}}
    job.sweep(study().with_({"axes": {"contender": others}}), apart="contender")
    folder = tmp_path / "full" / "tiny" / "binn"
    assert said == [f"fig11: the runs in '{folder}' are of other files; they are made anew"]


def test_a_mistake_of_a_study_is_not_taken_for_runs_of_others(tmp_path):
    with pytest.raises(InputError, match="w"):
        Job("fig11", tmp_path, workers=1).sweep(study(set={"circuit.ww": "1 deg"}))
