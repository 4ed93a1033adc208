"""Sweeps: what they find against simulations made by hand, the same bytes however they run, and resuming."""

from __future__ import annotations

import errno
import json
import multiprocessing
import os
import re
import shutil
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np
import pyarrow.parquet
import pytest
from study.cut import FORCES_N, SEEDS, small_study

from circuitkit.base.errors import CircuitkitError, InputError, SimulationError
from circuitkit.base.files import DamagedFileError, OutputError
from circuitkit.base.source import data_folder
from circuitkit.simulation import RunSpec, Scenario, load_scenario, make_plan
from circuitkit.simulation.loop import run_loop
from circuitkit.study import Workers, make_study, open_workers, read_results, run_cases, run_studies, sweep
from circuitkit.study.driver import estimate
from circuitkit.study.workers import WorkerError


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The small study by one worker: its folder and its results."""
    folder = tmp_path_factory.mktemp("sweep")
    return folder, sweep(small_study(), folder, workers=1, progress=False)


def contents(folder):
    return (folder / "results.parquet").read_bytes()


def by_hand(direction: str, force: float) -> Scenario:
    """The scenario that a run of the small study should be."""
    scenario = load_scenario("nao_push")
    jitter, push, noise = scenario.befalling
    start = {**push.start, "step": 0}
    push = push.model_copy(update={"start": start, "direction": direction, "force": force, "duration": 0.2})
    marching = type(scenario.reference)(gait="gait_march")
    changed = scenario.model_copy(update={"reference": marching, "duration": 2.35})
    return changed.with_disturbances((jitter, push, noise))


CONTROLLER = {"open loop": "open_loop", "tuned, towards the edge": "circuit"}


def measured(scenario, controller, specs):
    """The measures of runs that are recorded."""
    plan = make_plan(scenario)
    return run_loop(plan.setup(plan.controller(controller), specs)).measures


def test_limits_are_what_trying_every_force_finds(swept):
    for limit in swept[1].limits():
        direction, contender = limit.labels["push.direction"], limit.labels["contender"]
        specs = [RunSpec(seed, by_hand(direction, force).befalling) for force in FORCES_N for seed in SEEDS]
        found = measured(by_hand(direction, 0.0), CONTROLLER[contender], specs)
        stood = np.array([each["survived"] for each in found]).reshape(-1, len(SEEDS))
        first_failure = int((~stood.all(axis=1)).argmax())
        assert 0 < first_failure < len(FORCES_N)
        assert limit.fails_at == FORCES_N[first_failure]
        assert limit.largest == FORCES_N[first_failure - 1]
        assert (limit.survived, limit.runs) == (len(SEEDS), len(SEEDS))


def test_a_row_has_the_measures_of_a_run_of_its_own(swept):
    _, results = swept
    for row in [row for row in results.rows if row["push.force"] == 30.0][::3]:
        scenario = by_hand(row["push.direction"], 30.0)
        spec = RunSpec(row["seed"], scenario.befalling)
        (measures,) = measured(scenario, CONTROLLER[row["contender"]], [spec])
        assert {name: row[name] for name in measures} == measures
        assert ("rms_ankle_roll" in row) == (row["contender"] != "open loop")


def test_a_row_has_the_whole_scenario(swept):
    _, results = swept
    row = results.rows[-1]
    said = json.loads(row["scenario"])
    assert said["seed"] == row["seed"]
    assert said["disturbances"][1]["push"]["force"] == row["push.force"]
    assert said["reference_numbers"]["single_support"] == 0.5
    assert len({each["key"] for each in results.rows}) == len(results.rows)


@pytest.mark.parametrize(("workers", "batch"), [(1, 3), (2, None)])
def test_the_bytes_are_the_same_for_any_workers_and_batch(swept, tmp_path, workers, batch):
    sweep(small_study(), tmp_path, workers=workers, batch=batch, progress=False)
    assert contents(tmp_path) == contents(swept[0])


def test_what_was_written_reads_back(swept):
    folder, results = swept
    read = read_results(folder)
    assert read.complete
    assert read.rows == results.rows
    assert read.limits() == results.limits()
    table = pyarrow.parquet.read_table(folder / "results.parquet")
    assert table.schema.field("push.force").metadata == {b"unit": b"N"}
    assert table.schema.field("push.duration").metadata == {b"unit": b"s"}


class Stopper:
    """Progress that stops a sweep after some runs, or counts the first runs that it hears of."""

    def __init__(self, after=10**9):
        self.after, self.at_first = after, None

    def __call__(self, done, expected):
        assert done <= expected
        self.at_first = done if self.at_first is None else self.at_first
        if done >= self.after:
            raise KeyboardInterrupt


def test_a_stopped_sweep_goes_on_where_it_was_and_ends_with_the_same_bytes(swept, tmp_path):
    with pytest.raises(KeyboardInterrupt, match=r"runs are kept in .*; --resume"):
        sweep(small_study(), tmp_path, workers=1, batch=4, progress=Stopper(after=6))
    partly = read_results(tmp_path)
    assert not partly.complete
    assert 6 <= len(partly.rows) < len(swept[1].rows)
    assert all(row in swept[1].rows for row in partly.rows)
    rest = Stopper()
    sweep(small_study(), tmp_path, workers=1, resume=True, progress=rest)
    assert rest.at_first == len(partly.rows)
    assert contents(tmp_path) == contents(swept[0])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results.parquet", "study.json"]
    again = Stopper()
    sweep(small_study(), tmp_path, workers=1, resume=True, progress=again)
    assert again.at_first == len(swept[1].rows)


def test_results_are_not_overwritten_without_a_word(swept):
    with pytest.raises(
        CircuitkitError, match=r"has 32 runs of the study 'push_limits'; go on .* by --resume"
    ):
        sweep(small_study(), swept[0], workers=1, progress=False)


def test_another_study_does_not_go_on_with_the_results(swept):
    other = small_study().with_({"seeds": {"count": 3}, "watch": "2 s"})
    with pytest.raises(InputError) as caught:
        sweep(other, swept[0], workers=1, resume=True, progress=False)
    said = str(caught.value)
    assert "for its runs are others: study: watch was 1 s, is 2 s; seeds.count was 2, is 3; " in said
    assert "undo that, or name another folder" in said


def test_a_circuit_that_says_something_else_is_another_study(tmp_path):
    mine, out = tmp_path / "mine.yaml", tmp_path / "out"
    lines = ("circuit: mine", "control_step: 10 ms", "timing: ordered")
    said = "\n".join([*lines, f"include: [{data_folder('circuits')}/binn_lateral.yaml]", ""])
    changed = {"circuit": str(mine), "reference.gait": "gait_march", "duration": "6 s"}
    study = make_study({"study": "x", "scenario": "nao_push", "seeds": {"count": 1}, "set": changed})
    mine.write_text(said)
    with pytest.raises(KeyboardInterrupt):
        sweep(study, out, workers=1, progress=Stopper(after=0))
    mine.write_text(said + "parameters: {w: 1 deg}\n")
    with pytest.raises(InputError, match=r"circuit .*mine\.yaml: parameters\.w was 1\.63 deg, is 1 deg; "):
        sweep(study.with_({}), out, workers=1, resume=True, progress=False)


def test_a_full_disk_is_told_and_keeps_what_is_there(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pyarrow.parquet, "write_table", full)
    study = small_study().with_({"search": None, "seeds": {"count": 1}, "axes": {"contender": ["open loop"]}})
    with pytest.raises(OutputError, match=r"No space left on device; the runs before are kept in .*--resume"):
        sweep(study, tmp_path, workers=1, progress=False)


def test_a_sweep_that_was_stopped_before_its_first_run_begins_again_without_a_word(tmp_path):
    study = small_study().with_({"search": None, "seeds": {"count": 1}, "axes": {"contender": ["open loop"]}})
    with pytest.raises(CircuitkitError, match="found 0 workers"):
        sweep(study, tmp_path, workers=0)
    with pytest.raises(CircuitkitError, match="has 0 runs of the study"):
        sweep(study.with_({"watch": "0.3 s"}), tmp_path, workers=1, progress=False)
    assert sweep(study, tmp_path, workers=1, progress=False).complete


def test_the_estimate_is_no_more_than_the_most():
    search = {"field": "push.force", "low": "0 N", "high": "10 N", "step": "5 N", "check_below": None}
    found = estimate(small_study().with_({"search": search, "seeds": {"count": 1}}))
    assert found.runs <= found.most


def test_a_folder_without_results_is_told(tmp_path):
    with pytest.raises(InputError, match=r"there are no results of a sweep in"):
        read_results(tmp_path)


# --- in memory ----------------------------------------------------------------------------------------------


def test_cases_come_back_in_their_order_and_the_wrong_ones_as_errors(swept):
    _, results = swept
    study = small_study()
    push = {"push.direction": "inward", "push.duration": "0.2 s", "reference.gait": "gait_march"}
    cases = [
        push | {"controller": "open_loop", "push.force": "30 N"},
        push | {"circuit.q1.slpoe": "3 /m"},
        push | {"reference.lift.height": "8 cm", "reference.knee": "3 deg"},
        push | {"push.body": "tail"},
        push | {"controller": "circuit", "push.force": "15 N"},
    ]
    with open_workers(1) as workers:
        found = run_cases(study, cases, [1, 0], workers)
    assert isinstance(found[1], InputError)
    assert "did you mean 'q1.slope'" in str(found[1])
    assert isinstance(found[2], SimulationError | InputError)
    assert "unknown body 'tail'" in str(found[3])
    for case, outcomes in ((cases[0], found[0]), (cases[4], found[4])):
        name = next(label for label, controller in CONTROLLER.items() if controller == case["controller"])
        rows = {
            row["seed"]: row
            for row in results.rows
            if row["contender"] == name
            and row["push.direction"] == "inward"
            and f"{row['push.force']:g} N" == case["push.force"]
        }
        assert [outcome.seed for outcome in outcomes] == [1, 0]
        for outcome in outcomes:
            assert outcome.row().items() <= rows[outcome.seed].items()


def test_studies_side_by_side_find_what_each_finds_alone(swept):
    tuned = small_study().with_({"axes": {"contender": ["tuned, towards the edge"]}})
    wrong = small_study().with_({"set": {"circuit.nothing": 3}})
    with open_workers(1) as workers:
        one, other, error = run_studies([tuned, small_study(), wrong], workers)
    assert isinstance(error, InputError)
    assert other.rows == swept[1].rows
    assert one.limits() == swept[1].limits()[2:]


def test_without_search_shares_are_found(tmp_path):
    study = small_study().with_({"search": None, "axes": {"contender": ["open loop"]}})
    shares = sweep(study, tmp_path, workers=1, progress=False).shares()
    assert [(share.survived, share.runs) for share in shares] == [(0, 2), (2, 2)]  # 20 N outward, inward
    with pytest.raises(CircuitkitError, match=r"has no search; ask for shares"):
        read_results(tmp_path).limits()


# --- workers ------------------------------------------------------------------------------------------------


def kill_the_first(number):
    """Progress that sends a signal to a worker, once something is done."""
    sent = []

    def progress(done, _):
        if done and not sent:
            sent.append(multiprocessing.active_children()[0].pid)
            os.kill(sent[0], number)

    return progress


def test_a_worker_that_is_killed_is_replaced_and_its_batch_is_run_again(swept, caplog):
    """In memory and, to the last byte, in a folder."""
    with open_workers(2) as workers:
        (results,) = run_studies([small_study()], workers, batch=1, progress=kill_the_first(signal.SIGKILL))
    assert results.rows == swept[1].rows
    assert re.search(
        r"worker process \d+ on '.+' was ended by signal 9 \(SIGKILL\); .*; its batch \(1 run of the "
        r"scenario 'nao_push' with seed \d\) is run again, try 2 of 3",
        caplog.text,
    )
    assert not multiprocessing.active_children()


def test_a_worker_that_is_stopped_is_ended_when_its_time_is_over(swept, caplog, monkeypatch):
    monkeypatch.setattr("circuitkit.study.batches._LEAST_S", 3.0)
    with open_workers(2) as workers:
        (results,) = run_studies([small_study()], workers, batch=1, progress=kill_the_first(signal.SIGSTOP))
    assert results.rows == swept[1].rows
    assert re.search(
        r"worker process \d+ on '.+' was stuck at it for \d+ s and was ended; its batch", caplog.text
    )
    assert not multiprocessing.active_children()


def test_a_batch_that_three_workers_did_not_survive_is_told():
    def kill_all(*_):
        for child in multiprocessing.active_children():
            with suppress(ProcessLookupError):  # it has just ended by itself
                os.kill(child.pid, signal.SIGKILL)

    message = (
        r"a batch was lost 3 times: 1 run of the scenario 'nao_push' with seed \d; the last time, worker "
        r"process \d+ on '.+' was ended by signal 9 \(SIGKILL\); .*fewer --workers"
    )
    with open_workers(2) as workers, pytest.raises(WorkerError, match=message):
        run_studies([small_study()], workers, batch=1, progress=kill_all)
    assert not multiprocessing.active_children()


def test_whoever_breaks_off_does_not_wait_for_what_is_under_way():
    def stop(done, _):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), open_workers(2) as workers:
        run_studies([small_study()], workers, batch=1, progress=stop)
    assert not multiprocessing.active_children()


def test_workers_go_on_after_a_call_that_was_broken_off(swept):
    """Outcomes of the first call are not taken for those of the second."""

    def stop(done, _):
        if done:
            raise KeyboardInterrupt

    with open_workers(2) as workers:
        with pytest.raises(KeyboardInterrupt):
            run_studies([small_study().with_({"seeds": {"first": 7}})], workers, batch=1, progress=stop)
        (results,) = run_studies([small_study()], workers)
    assert results.rows == swept[1].rows


def test_any_executor_will_do(swept):
    with ThreadPoolExecutor(1) as executor:
        (results,) = run_studies([small_study()], Workers(executor, lambda: 3))
    assert results.rows == swept[1].rows


@pytest.mark.parametrize("workers", [0, -1, 5000])
def test_numbers_of_workers_without_sense_are_refused(workers):
    with (
        pytest.raises(CircuitkitError, match=rf"found {workers} workers; allowed: 1 to"),
        open_workers(workers),
    ):
        pass


def test_a_batch_without_runs_is_refused():
    with (
        open_workers(1) as workers,
        pytest.raises(CircuitkitError, match=r"found a batch of 0; allowed: 1 or more"),
    ):
        run_studies([small_study()], workers, batch=0)


def test_no_flipped_bit_of_what_is_stored_changes_a_value_unnoticed(swept, tmp_path):
    """A part and the results are written alike; the bits are drawn with a seed."""
    folder = tmp_path / "sweep"
    shutil.copytree(swept[0], folder)
    whole, path = contents(folder), folder / "results.parquet"
    flipped = np.random.default_rng(0).integers(8 * len(whole), size=3000)
    for place in flipped:
        broken = bytearray(whole)
        broken[place // 8] ^= 1 << place % 8
        path.write_bytes(broken)
        with pytest.raises(DamagedFileError, match=r"is damaged: .*; take it away, and --resume runs what"):
            read_results(folder)


@pytest.mark.parametrize("damage", ["cut", "longer", "empty", "no checksum"])
def test_a_stored_file_that_is_not_what_was_written_is_told(swept, tmp_path, damage):
    folder = tmp_path / "sweep"
    shutil.copytree(swept[0], folder)
    whole, path = contents(folder), folder / "results.parquet"
    if damage == "no checksum":
        pyarrow.parquet.write_table(swept[1].table, path)
    else:
        path.write_bytes({"cut": whole[:-1], "longer": whole + b"x", "empty": b""}[damage])
    with pytest.raises(DamagedFileError, match=r"is damaged: .*; take it away, and --resume runs what"):
        read_results(folder)
