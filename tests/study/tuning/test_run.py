"""A tiny tuning of a real circuit, pushed in MuJoCo: a generation of two, a few short runs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import optuna
import pytest
from small_tuning import written

from circuitkit.circuit import check as check_circuit
from circuitkit.circuit import load_circuit
from circuitkit.circuit.authoring.formatting import format_file
from circuitkit.control import load_controller
from circuitkit.study import open_workers
from circuitkit.study.tuning import result as result_module
from circuitkit.study.tuning.measure import Measure, Progress
from circuitkit.study.tuning.objective import Score
from circuitkit.study.tuning.result import write_result
from circuitkit.study.tuning.run import Tuned, _database, start_of, tune
from circuitkit.study.tuning.search import Candidate
from circuitkit.study.tuning.spec import load_tuning


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tuning")


@pytest.fixture(scope="module")
def steps() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def tuned(folder: Path, steps: list[Progress]) -> Tuned:
    return tune(written(folder), folder / "out", workers=1, progress=steps.append)


def test_the_best_is_no_worse_than_the_start(tuned):
    assert len(tuned.history.trials) == 3
    assert tuned.start is not None
    assert tuned.start.settings == {"w": "-0.5 deg", "leak": "5 %"}  # the base's own, and the file's start
    assert tuned.best.value >= tuned.start.value
    assert tuned.test is not None
    assert tuned.test.runs == tuned.best.runs == 4


def test_progress_counts_candidates_up_to_the_test(tuned, steps):
    assert [step.done for step in steps] == sorted(step.done for step in steps)
    assert {step.stage for step in steps} == {"train", "test"}
    assert steps[-1].measured == steps[-1].trials == len(tuned.history.trials)


def test_the_result_is_a_valid_circuit_in_normal_form(tuned):
    assert check_circuit(tuned.path) == ((), ())
    assert not format_file(tuned.path).changes
    graph = load_circuit(tuned.path)
    assert graph.name == "small_tuned"
    assert str(graph.parameters["w"]) == tuned.best.settings["w"]
    assert str(graph.parameters["margin"]) == "4 mm"  # the base's


def test_the_result_says_where_its_numbers_come_from(tuned):
    text = " ".join(line.strip("# ") for line in tuned.path.read_text().splitlines() if line.startswith("#"))
    assert "circuitkit tune small.yaml (study small; tpe, seed 0, 3 candidates; number " in text
    assert "Objective, most: survived of pushed - 0.2 rms_ankle_roll of calm [deg] beyond 0.1 deg." in text
    assert f"Training, seed 100: {tuned.best.value:.6g} (survived of pushed " in text
    assert f"Test, seed 0: {tuned.test.value:.6g} (survived of pushed " in text


def test_the_result_measures_again_what_was_measured(tuned, folder):
    path = written(folder, ("circuit: base.yaml", f"circuit: {tuned.path}"))
    tuning = load_tuning(path)
    with open_workers(1) as workers:
        (again,) = Measure(tuning, tuning.runs("train"), workers)([{}])
    assert isinstance(again, Score)
    assert again.value == tuned.best.value
    assert again.figures == tuned.best.figures


def test_the_history_is_a_table_and_a_picture(tuned, folder):
    rows = (folder / "out/trials.csv").read_text().splitlines()
    assert rows[0] == "number,objective,survived of pushed,rms_ankle_roll of calm,w,leak,error"
    assert [row.split(",")[0] for row in rows[1:]] == ["0", "1", "2"]
    assert {f"history.{suffix}" for suffix in ("png", "pdf")} < {p.name for p in (folder / "out").iterdir()}
    assert json.loads(json.dumps(tuned.row()))["best"]["values"] == dict(tuned.best.settings)


# What is tuned, for each way in which a result can be written; and words that it must have.
WAYS = {
    "parameters: include and set": ("binn_lateral_tuned", {"w": "-1 deg"}, "include: ["),
    "a neuron of the base: a copy": ("binn_lateral", {"q1.slope": "50 /m"}, "# Section 4.2: the difference"),
    "an instance of the base: a copy": ("binn_planar", {"lateral.w": "1 deg"}, "as: sagittal"),
    "a neuron of an included file: in full": (
        "binn_lateral_tuned",
        {"p1.shift": "0.3"},
        "shift: 0.3",
    ),
    "an output": ("binn_lateral", {"ankle_roll.integrate.leak": "3 %"}, "leak: 3 %"),
}


@pytest.mark.parametrize(("base", "values", "words"), WAYS.values(), ids=WAYS)
def test_a_result_means_what_was_measured_whatever_was_tuned(tmp_path, base, values, words):
    name = next(iter(values))
    tuning = load_tuning(written(tmp_path, ("circuit: base.yaml", f"circuit: {base}")))
    path = write_result(tuning, values, ["Found somehow."], tmp_path / "results/x.yaml")
    assert check_circuit(path)[0] == ()
    assert not format_file(path).changes
    text = path.read_text()
    assert "# Found somehow.\n" in text
    assert words in text
    expected, found = load_circuit(base, values), load_circuit(path)
    assert found.neurons == expected.neurons or [n.parameters for n in found.neurons] == [
        n.parameters for n in expected.neurons
    ], name
    assert [(o.name, o.leak, o.readout) for o in found.outputs] == [
        (o.name, o.leak, o.readout) for o in expected.outputs
    ]


CONTROLLER = (
    ("circuit: base.yaml", "controller: dcm_ankle"),
    ("w: {from: -2 deg, to: -0.1 deg, log: true}", "lateral.limit: {from: 5 deg, to: 20 deg}"),
    ("    leak: {from: 1 %, to: 20 %}\n  start: {leak: 5 %}\n", ""),
)


def test_a_controller_is_tuned_by_the_same_file(tmp_path):
    tuning = load_tuning(written(tmp_path, *CONTROLLER))
    own = math.degrees(load_controller("dcm_ankle").lateral.limit)
    assert start_of(tuning) == {"lateral.limit": pytest.approx(own)}
    assert tuning.settings({"lateral.limit": "9 deg"}) == {
        "controller": "dcm_ankle",
        "controller.lateral.limit": "9 deg",
    }
    path = write_result(tuning, {"lateral.limit": "9 deg"}, ["Found somehow."], tmp_path / "x.yaml")
    expected = load_controller("dcm_ankle", {"lateral.limit": "9 deg"})
    assert load_controller(path) == expected.model_copy(update={"controller": "small_tuned"})
    assert "# measured on undisturbed walks" in path.read_text()  # the comments of the base


def test_the_best_few_are_confirmed_by_seeds_of_their_own(tmp_path, monkeypatch):
    confirm = "  confirm: {seeds: {first: 200, count: 1}, best: 2}\n  test:"
    path = written(tmp_path, ("  test:", confirm))
    # By training the later candidate is better, by the seeds of the confirmation the earlier one.
    figures = iter([[0.1, 0.5, 0.6], [0.3, 0.9], [0.4]])

    def measured(_: object, candidates: list[Candidate]) -> Iterator[Score]:
        values = next(figures)
        assert len(values) == len(candidates)
        return [Score(value, (value, 0.0), 1) for value in values]

    monkeypatch.setattr(Measure, "__call__", measured)
    tuned = tune(path, tmp_path / "out", workers=1)
    assert tuned.best.number == 1
    assert (tuned.best.value, tuned.confirmed.value, tuned.test.value) == (0.5, 0.9, 0.4)
    text = tuned.path.read_text()
    assert "# Chosen among the best 2, seed 200: 0.9" in text
    assert "; 1 run)." in text


def test_ctrl_c_writes_the_best_so_far(tmp_path, monkeypatch):
    calls = iter([[0.1, 0.5, 0.4]])

    def measured(_: object, __: list[Candidate]) -> list[Score]:
        try:
            return [Score(value, (value, 0.0), 4) for value in next(calls)]
        except StopIteration:
            raise KeyboardInterrupt from None

    monkeypatch.setattr(Measure, "__call__", measured)
    tuned = tune(written(tmp_path), tmp_path / "out", trials=9, workers=1)
    assert tuned.history.interrupted
    assert tuned.test is None
    text = tuned.path.read_text()
    words = " ".join(line.strip("# ") for line in text.splitlines())
    assert "3 candidates, ended early; number 1)" in words
    assert "# The test was not run." in text


def test_what_cannot_be_written_faithfully_is_not_written(tmp_path, monkeypatch):
    tuning = load_tuning(written(tmp_path))
    monkeypatch.setattr(result_module, "compare_circuits", lambda *_: ("a difference",))
    with pytest.raises(result_module.ResultError, match="please report"):
        write_result(tuning, {"w": "-1 deg"}, [], tmp_path / "x.yaml")
    assert not (tmp_path / "x.yaml").exists()


@pytest.mark.parametrize(
    "name", ["out_20%cells", "out?a=b", "a#b;c", "{x}", "ä ö", "a&b=c", "[1]", "%(here)s"]
)
def test_a_database_lies_in_the_folder_whatever_its_name(tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    storage = optuna.storages.RDBStorage(_database(folder))
    optuna.create_study(storage=storage, study_name="small")
    assert (folder / "trials.db").stat().st_size > 0
    assert [each.name for each in tmp_path.iterdir()] == [name]
