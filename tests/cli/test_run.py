"""`circuitkit run`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from circuitkit.cli._realtime import Limit
from circuitkit.engine.backends import BACKEND_NAMES
from circuitkit.engine.backends.c import build

INPUTS = ["force_difference", "zmp_y"]
POPULATION = """\
circuit: c
control_step: 10 ms
timing: ordered
populations: {p: {size: 2, model: identity, role: excitatory}}
outputs: {y: {unit: "1", readout: {p: 1}}}
"""
NEURONS = ["lf", "bf", "rf", "q1", "q2", "q3", "q4", "h1", "h2", "p1", "p2"]


def test_csv_goes_to_standard_output(circuitkit):
    outcome = circuitkit(
        "run", "binn_lateral", "--input", "zmp_y=70mm", "--input", "force_difference=0", "--steps", "3"
    )
    assert (outcome.code, outcome.err) == (0, "")
    header, *rows = [line.split(",") for line in outcome.out.splitlines()]
    assert header == ["time_s", *INPUTS, *NEURONS, "ankle_roll"]
    assert [row[:3] for row in rows] == [
        ["0.0", "0.0", "70.0"],
        ["0.01", "0.0", "70.0"],
        ["0.02", "0.0", "70.0"],
    ]


def test_a_negative_value_and_spaces(circuitkit):
    outcome = circuitkit(
        "run", "binn_lateral", "--input", "zmp_y = -9 cm", "--input", "force_difference=-1", "--steps", "1"
    )
    assert outcome.code == 0
    assert outcome.out.splitlines()[1].startswith("0.0,-1.0,-90.0,")


def test_the_file_is_named_afterwards_and_notes_are_on_stderr(circuitkit):
    outcome = circuitkit(
        "run", "binn_lateral", "--input", "zmp_y=200 mm", "--steps", "2", "-o", "new/out.csv"
    )
    assert (outcome.code, outcome.out) == (0, "")
    assert outcome.err.splitlines() == [
        "note: held at 0, for no value was given: force_difference",
        "note: zmp_y leaves its range, -150 mm to 150 mm, in 2 of 2 steps",
        "wrote new/out.csv: 2 steps of 10 ms",
    ]
    assert len(Path("new/out.csv").read_text(encoding="utf-8").splitlines()) == 3


def test_json_is_a_summary(circuitkit):
    outcome = circuitkit(
        "run", "binn_lateral", "--input", "zmp_y=70mm", "--steps", "4", "--json", "-o", "out.nc"
    )
    summary = json.loads(outcome.out)
    assert list(summary) == ["circuit", "steps", "step_s", "units", "last", "recording", "backend"]
    assert (summary["circuit"], summary["steps"], summary["step_s"]) == ("binn_lateral", 4, 0.01)
    assert summary["units"]["ankle_roll"] == "deg"
    assert summary["last"]["zmp_y"] == 70
    assert summary["recording"] == "out.nc"
    assert Path("out.nc").stat().st_size > 0


def test_a_table_of_inputs(circuitkit):
    Path("in.csv").write_text("force_difference,zmp_y\n1,10\n1,20\n", encoding="utf-8")
    outcome = circuitkit("run", "binn_lateral", "--inputs", "in.csv")
    assert (outcome.code, outcome.err) == (0, "")
    assert [line.split(",")[:3] for line in outcome.out.splitlines()[1:]] == [
        ["0.0", "1.0", "10.0"],
        ["0.01", "1.0", "20.0"],
    ]


def test_wrong_input_is_told_before_anything_is_written(circuitkit):
    outcome = circuitkit("run", "binn_lateral", "--input", "zmp_x=70mm", "--steps", "3", "-o", "out.csv")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == (
        "inputs: unknown input 'zmp_x'; allowed: force_difference, zmp_y; did you mean 'zmp_y'?\n"
    )
    assert not Path("out.csv").exists()


def test_an_unknown_format_is_told_before_the_circuit_is_read(circuitkit):
    outcome = circuitkit("run", "no_such_circuit", "--steps", "3", "-o", "out.xls")
    assert (outcome.code, outcome.err) == (1, "out.xls: found the suffix '.xls'; allowed: .csv, .nc\n")


def test_a_value_is_given_once(circuitkit):
    outcome = circuitkit(
        "run", "binn_lateral", "--input", "zmp_y=1mm", "--input", "zmp_y=2mm", "--steps", "3"
    )
    assert outcome.code == 2
    assert "Error: Invalid value for --input: 'zmp_y' is given twice" in outcome.err


def test_values_of_the_circuit_can_be_set(circuitkit):
    words = (
        "run",
        "binn_lateral",
        "--input",
        "zmp_y=-200mm",
        "--input",
        "force_difference=0",
        "--steps",
        "1",
    )
    before, after = (
        float(circuitkit(*words, *more).out.splitlines()[1].split(",")[-1])
        for more in ((), ("--set", "w=3.26 deg", "--set", "ankle_roll.limits.1=3 deg"))
    )
    assert before > 1.6
    assert after == 3.0  # twice as much, up to the limit


def test_what_cannot_be_set_names_the_option(circuitkit):
    outcome = circuitkit("run", "binn_lateral", "--steps", "1", "--set", "q1.slop=50 /m")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err.startswith("--set: unknown name 'q1.slop'; allowed: ")
    assert outcome.err.endswith("; did you mean 'q1.slope'?\n")
    outcome = circuitkit("run", "binn_lateral", "--steps", "1", "--set", "w=2mm")
    assert outcome.code == 1
    assert outcome.err.endswith(
        ": parameters.w.value: found 2 mm (length); allowed: angle, such as '1 deg', "
        "since the file has 1.63 deg (with --set)\n"
    )


def test_only_what_was_asked_for_is_recorded(circuitkit):
    words = ("run", "matsuoka_half_centre", "--steps", "2", "--record", "flexor.v", "--record", "joint_angle")
    outcome = circuitkit(*words, "--input", "feedback=0")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.splitlines()[0] == "time_s,feedback,joint_angle,flexor.v"
    outcome = circuitkit("run", "matsuoka_half_centre", "--steps", "2", "--record", "flexr")
    assert (outcome.code, outcome.out) == (1, "")
    assert "unknown neuron, output or state 'flexr'" in outcome.err


def test_noise_has_a_seed(circuitkit):
    def outputs(seed):
        return circuitkit("run", "noisy.yaml", "--steps", "3", "--seed", str(seed), "--backend", "numpy").out

    Path("noisy.yaml").write_text(
        "circuit: c\ncontrol_step: 10 ms\ntiming: ordered\nneurons:\n"
        "  n: {model: identity, role: excitatory, noise: 1}\noutputs:\n  y: {unit: '1', readout: {n: 1}}\n",
        encoding="utf-8",
    )
    assert outputs(1) == outputs(1)
    assert outputs(1) != outputs(2)


def test_a_large_circuit_records_its_outputs(circuitkit):
    Path("large.yaml").write_text(
        "circuit: c\ncontrol_step: 10 ms\ntiming: ordered\npopulations:\n"
        "  cells: {size: 2000, model: identity, role: excitatory}\n"
        "outputs:\n  y: {unit: '1', readout: {cells: 1}}\n",
        encoding="utf-8",
    )
    outcome = circuitkit("run", "large.yaml", "--steps", "2", "--backend", "numpy")
    assert outcome.out.splitlines()[0] == "time_s,y"
    assert outcome.err == (
        "note: the 2000 neurons are not recorded; name those that are wanted with --record\n"
    )
    header = (
        circuitkit("run", "large.yaml", "--steps", "2", "--record", "cells").out.splitlines()[0].split(",")
    )
    assert header[1:3] == ["cells[0]", "cells[1]"]
    assert len(header) == 2001


def test_verbose_says_which_backend_ran_it(circuitkit):
    words = ("run", "binn_lateral", "--input", "zmp_y=0mm", "--input", "force_difference=0", "--steps", "1")
    assert circuitkit(*words, "--backend", "numpy", "--verbose").err == "backend numpy\n"
    assert circuitkit(*words, "--verbose").err.startswith("backend ")
    assert circuitkit(*words).err == ""


def test_verbose_says_what_runs_in_place_of_the_compiled_backend(circuitkit, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(build, "_library", build._library.__wrapped__)  # nothing is loaded already
    words = ("run", "binn_lateral", "--input", "zmp_y=0mm", "--input", "force_difference=0", "--steps", "1")
    reason = "no C compiler was found (looked for $CC, cc, gcc, clang)"
    assert f"backend numpy: {reason}" in circuitkit(*words, "--backend", "compiled", "--verbose").err
    summary = json.loads(circuitkit(*words, "--backend", "compiled", "--json").out)
    assert summary["backend"] == f"backend numpy: {reason}"


def test_a_seed_of_more_than_64_bits(circuitkit):
    outcome = circuitkit("run", "binn_lateral", "--steps", "3", "--seed", str(2**64), "--backend", "numpy")
    assert (outcome.code, outcome.out) == (2, "")
    assert "--seed" in outcome.err
    assert "less than or equal to 9223372036854775807" in outcome.err


def test_more_steps_than_any_machine_has_memory_for(circuitkit):
    outcome = circuitkit("run", "binn_lateral", "--steps", str(10**23), "--backend", "numpy")
    assert (outcome.code, outcome.out) == (1, "")
    assert f"steps: found {10**23} steps, which need about " in outcome.err


def test_members_are_written_once(circuitkit):
    Path("c.yaml").write_text(POPULATION, encoding="utf-8")
    outcome = circuitkit("run", "c.yaml", "--steps", "1", "--record", "p[1]", "--record", "p")
    assert outcome.out.splitlines()[0] == "time_s,p[1],p[0]"


def test_an_unknown_backend(circuitkit):
    outcome = circuitkit("run", "binn_lateral", "--steps", "1", "--backend", "numba")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err.startswith("unknown backend 'numba'; allowed: ")


def test_single_precision(circuitkit):
    words = ("run", "binn_lateral", "--input", "zmp_y=70mm", "--steps", "1", "--backend", "numpy", "--json")
    one, other = (json.loads(circuitkit(*words, "--precision", p).out) for p in ("float64", "float32"))
    assert one["last"]["q4"] != other["last"]["q4"]
    assert abs(one["last"]["q4"] - other["last"]["q4"]) < 1e-5


def test_a_real_time_run_reports_how_late_it_was(circuitkit):
    words = (
        "run",
        "binn_lateral",
        "--input",
        "zmp_y=70mm",
        "--realtime",
        "0.2",
        "--backend",
        "numpy",
        "--max-missed",
        "100%",
    )
    report = json.loads(circuitkit(*words, "--rate", "200", "--json").out)
    assert (report["ticks"], report["rate_hz"], report["backend"]) == (40, 200.0, "numpy")
    assert list(report["lateness_s"]) == ["50.0", "90.0", "99.0", "99.9", "99.99"]
    assert 0 <= report["missed"] <= 40
    outcome = circuitkit(*words, "--verbose")
    assert (outcome.code, outcome.err) == (0, "backend numpy\n")
    lines = outcome.out.splitlines()
    assert lines[0] == "binn_lateral, backend numpy: 20 ticks at 100 Hz"  # of the control step
    assert lines[1].startswith("missed deadlines: ")
    assert [line.split()[0] for line in lines if line.strip()][-6:] == [
        "p50", "p90", "p99", "p99.9", "p99.99", "largest",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--realtime", "1", "--steps", "3"), "--realtime measures and records nothing; leave out --steps"),
        (("--realtime", "1", "-o", "out.csv"), "--realtime measures and records nothing; leave out --steps"),
        (("--rate", "100", "--steps", "3"), "--rate goes with --realtime SECONDS"),
        (("--max-missed", "3", "--steps", "3"), "--max-missed goes with --realtime SECONDS"),
        (("--priority", "3", "--steps", "3"), "--priority goes with --realtime SECONDS"),
        (("--realtime", "1", "--max-missed", "some"), "found 'some'; allowed: a number of ticks such as 3"),
        (("--realtime", "1", "--max-missed", "-1"), "found '-1'; allowed: a number of ticks such as 3"),
        (("--realtime", "1", "--max-missed", "101%"), "found '101%'; allowed: a number of ticks such as 3"),
    ],
)
def test_what_a_real_time_run_cannot_do(circuitkit, more, message):
    outcome = circuitkit("run", "binn_lateral", *more)
    assert outcome.code == 2
    assert message in outcome.err


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system stops no process")
def test_a_process_that_was_stopped_for_a_second_says_so(tmp_path):
    """The promise was broken: the exit code says so, and no burst of ticks made up for it."""
    words = ["run", "binn_lateral", "--backend", "numpy", "--json", "--realtime", "3", "--rate", "100"]
    program = (
        "import sys; from circuitkit.cli import _realtime; from circuitkit.cli.main import main; "
        f"print('ready', flush=True); sys.exit(main({[*words, '--max-missed', '90']}))"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}, cwd=tmp_path,
    ) as process:  # fmt: skip
        assert process.stdout.readline() == "ready\n"
        time.sleep(1.5)  # it reads the circuit, and is somewhere in its three seconds
        process.send_signal(signal.SIGSTOP)
        time.sleep(1.2)
        process.send_signal(signal.SIGCONT)
        out, err = process.communicate(timeout=60)
    report = json.loads(out)
    assert process.returncode == 3
    assert 100 <= report["missed"] <= report["skipped"] + 100
    assert report["skipped"] >= 100
    assert err.startswith(f"missed {report['missed']} of 300 deadlines; allowed: 90 (--max-missed); ")


@pytest.mark.parametrize(
    ("limit", "missed", "kept"),
    [("0", 0, True), ("0", 1, False), ("3", 3, True), ("3", 4, False), ("1%", 10, True), ("1%", 11, False),
     ("0.5 %", 5, True), ("0%", 1, False), ("100%", 1000, True)],
)  # fmt: skip
def test_how_many_deadlines_may_be_missed(limit, missed, kept):
    assert Limit.read(limit).is_kept(SimpleNamespace(missed=missed, ticks=1000)) is kept


def test_a_rate_of_nothing(circuitkit):
    outcome = circuitkit("run", "binn_lateral", "--realtime", "1", "--rate", "-5", "--backend", "numpy")
    assert (outcome.code, outcome.err) == (
        1,
        "rate: found -5; allowed: numbers above 0, up to 100000\n",
    )


def test_the_help_names_every_backend(circuitkit):
    said = " ".join(circuitkit("run", "--help").out.split())
    *most, last = BACKEND_NAMES
    assert f"auto, {', '.join(most)} or {last}; auto takes the fastest" in said
