"""`circuitkit simulate` and `compare`: what they hand on and what they print."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import circuitkit.simulation as room
from circuitkit.control import shipped_controllers

ROW = {
    "scenario": "nao_push",
    "controller": "circuit",
    "seed": 3,
    "push": {"force_n": 20.0, "duration_s": 0.2, "direction": "inward"},
    "survived": True,
    "time_of_fall_s": None,
    "max_zmp_excursion_m": 0.0123,
    "recovery_time_s": 0.84,
    "interrupted": False,
    "recording": "out/recording.nc",
}
FALLEN = {
    **ROW,
    "controller": "open_loop",
    "survived": False,
    "time_of_fall_s": 4.5678,
    "recovery_time_s": float("nan"),
    "push": None,
}


@pytest.fixture
def calls(monkeypatch):
    """What the room was called with; it answers at once."""
    heard = []

    def answer(*rows):
        results = [SimpleNamespace(row=lambda row=row: row, backend="backend numpy") for row in rows]

        def called(*args, **options):
            heard.append((args, options))
            return results if len(results) > 1 else results[0]

        return called

    monkeypatch.setattr(room, "simulate", answer(ROW))
    monkeypatch.setattr(room, "compare", answer(FALLEN, ROW))
    return heard


def test_simulate_hands_on_what_was_asked_for(circuitkit, calls):
    words = (
        "--circuit",
        "my.yaml",
        "--set",
        "w=2 deg",
        "--set",
        "q1.slope=50",
        "--backend",
        "compiled",
        "--push",
        "20N,200ms,inward",
        "--seed",
        "3",
        "-o",
        "out",
        "--video",
        "--view",
    )
    outcome = circuitkit("simulate", "nao_push", *words)
    assert (outcome.code, outcome.err) == (0, "wrote out\n")
    ((args, options),) = calls
    assert args == ("nao_push",)
    assert options == {
        "controller": None,
        "circuit": "my.yaml",
        "settings": {"w": "2 deg", "q1.slope": "50"},
        "backend": "compiled",
        "push": "20N,200ms,inward",
        "seed": 3,
        "output": Path("out"),
        "video": True,
        "view": True,
        "progress": True,
    }


@pytest.mark.usefixtures("calls")
def test_simulate_prints_the_verdict(circuitkit):
    out = circuitkit("simulate", "nao_push").out
    assert "nao_push" in out
    row = out.splitlines()[-2].split()
    assert " ".join(row) == "circuit 3 20 N, 200 ms, inward stood 12.3 mm 0.84 s"


@pytest.mark.parametrize("words", [("simulate", "nao_push"), ("compare", "nao_push", "--controllers", "a,b")])
@pytest.mark.usefixtures("calls")
def test_verbose_says_what_ran_the_circuit(circuitkit, words):
    assert circuitkit(*words, "--verbose").err == "backend numpy\n"
    assert circuitkit(*words).err == ""


def test_compare_prints_one_line_a_controller(circuitkit, calls):
    outcome = circuitkit("compare", "nao_push", "--controllers", "open_loop, circuit", "-o", "out")
    assert (outcome.code, outcome.err) == (0, "wrote out\n")
    ((args, _),) = calls
    assert args == ("nao_push", ["open_loop", "circuit"])
    rows = [" ".join(line.split()) for line in outcome.out.splitlines()[-3:-1]]
    assert rows == [
        "open_loop 3 none fell at 4.57 s 12.3 mm -",
        "circuit 3 20 N, 200 ms, inward stood 12.3 mm 0.84 s",
    ]


@pytest.mark.parametrize("words", [("simulate", "nao_push"), ("compare", "nao_push", "--controllers", "a,b")])
@pytest.mark.usefixtures("calls")
def test_json_is_a_list_with_the_keys_of_the_contract(circuitkit, words):
    rows = json.loads(circuitkit(*words, "--json").out)
    assert [list(row) for row in rows] == [list(ROW)] * len(rows)
    assert rows[-1] == ROW
    assert rows[0]["recovery_time_s"] in (None, 0.84)


@pytest.mark.usefixtures("calls")
def test_compare_wants_names(circuitkit):
    outcome = circuitkit("compare", "nao_push", "--controllers", " , ")
    assert outcome.code == 2
    assert (
        "Invalid value for --controllers: name at least one controller, such as open_loop,circuit"
        in outcome.err
    )


def test_an_interrupted_run_is_reported_and_ends_the_command_so(circuitkit, monkeypatch):
    row = {**ROW, "interrupted": True}
    monkeypatch.setattr(room, "simulate", lambda *_, **__: SimpleNamespace(row=lambda: row, backend=""))
    outcome = circuitkit("simulate", "nao_push", "-o", "out")
    assert (outcome.code, outcome.err) == (130, "wrote out\ninterrupted\n")
    assert "stood until interrupted" in outcome.out


@pytest.mark.parametrize("command", ["simulate", "compare"])
def test_help_names_every_controller_that_ships(circuitkit, command):
    said = " ".join(circuitkit(command, "--help").out.replace("│", " ").split())
    for name in ("open_loop", "circuit", *shipped_controllers()):
        assert re.search(rf"[ ,]{name}[ ,.]", said), name
    assert "mpc" in said.partition("circuitkit ")[2]  # an example


@pytest.mark.usefixtures("calls")
def test_what_set_cannot_change_is_told(circuitkit, monkeypatch):
    assert "--set" not in circuitkit("compare", "nao_push", "--controllers", "a,b", "--set", "w=1deg").err
    result = SimpleNamespace(row=lambda: FALLEN, backend="")
    monkeypatch.setattr(room, "simulate", lambda *_, **__: result)
    words = ("simulate", "nao_push", "--controller", "open_loop", "--json")
    outcome = circuitkit(*words, "--set", "w=1deg")
    told = "--set changes no run: it is for the controller circuit, and here is only open_loop\n"
    assert (outcome.code, outcome.err) == (0, told)
    assert circuitkit(*words).err == ""
