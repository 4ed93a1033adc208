"""`circuitkit simulate` and `compare`: what they hand on and what they print."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

import circuitkit.simulation as package
from circuitkit.base.catalogue import catalogue
from circuitkit.base.units import parse_unit
from circuitkit.simulation import load_scenario

ROW = {
    "scenario": "nao_push",
    "controller": "circuit",
    "seed": 3,
    "push": {"force_n": 20.0, "torque_nm": None, "duration_s": 0.2, "direction": "inward", "pushes": 1},
    "survived": True,
    "time_of_fall_s": None,
    "largest_lean": 0.2,
    "max_zmp_excursion_m": 0.0123,
    "recovery_time_s": 0.84,
    "invalid": None,
    "interrupted": False,
    "recording": "out/recording.nc",
}
FALLEN = {
    **ROW,
    "controller": "open_loop",
    "survived": False,
    "time_of_fall_s": 4.5678,
    "recovery_time_s": None,
    "push": None,
}
UNITS = {
    "survived": None,
    "time_of_fall_s": parse_unit("s"),
    "largest_lean": parse_unit("rad"),
    "max_zmp_excursion_m": parse_unit("m"),
    "recovery_time_s": parse_unit("s"),
}
LONGEST_S = {"hexapod": 6.0, "nao": 9.0}  # both are harmed after 5 s; others are tried for two seconds


def made_up(row, outcome="stood"):
    return SimpleNamespace(row=lambda: row, backend="backend numpy", outcome=outcome, units=UNITS, remarks=())


@pytest.fixture
def calls(monkeypatch):
    """What the room was called with; it answers at once."""
    heard = []

    def answer(*rows):
        results = [made_up(row, "stood" if row["survived"] else "fell at 4.57 s") for row in rows]

        def called(*args, **options):
            heard.append((args, options))
            return results if len(results) > 1 else results[0]

        return called

    monkeypatch.setattr(package, "simulate", answer(ROW))
    monkeypatch.setattr(package, "compare", answer(FALLEN, ROW))
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
        "--robot",
        "mine.yaml",
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
        "robot": "mine.yaml",
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
    assert " ".join(row) == "circuit 3 20 N, 200 ms, inward stood 11.5 deg 12.3 mm 0.84 s"


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
        "open_loop 3 none fell at 4.57 s 11.5 deg 12.3 mm -",
        "circuit 3 20 N, 200 ms, inward stood 11.5 deg 12.3 mm 0.84 s",
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
    monkeypatch.setattr(package, "simulate", lambda *_, **__: made_up(row, "stood until interrupted"))
    outcome = circuitkit("simulate", "nao_push", "-o", "out")
    assert (outcome.code, outcome.err) == (130, "wrote out\ninterrupted\n")
    assert "stood until interrupted" in outcome.out


@pytest.mark.parametrize("command", ["simulate", "compare"])
def test_help_says_where_the_controllers_are_listed(circuitkit, command):
    said = " ".join(circuitkit(command, "--help").out.split())
    assert "open_loop, circuit, a controller file, or a shipped one of `circuitkit list controllers`" in said
    listed = circuitkit("list", "controllers").out
    assert all(each.name in listed for each in catalogue("controllers"))


@pytest.mark.usefixtures("calls")
def test_what_set_cannot_change_is_told(circuitkit, monkeypatch):
    assert "--set" not in circuitkit("compare", "nao_push", "--controllers", "a,b", "--set", "w=1deg").err
    result = made_up(FALLEN)
    monkeypatch.setattr(package, "simulate", lambda *_, **__: result)
    words = ("simulate", "nao_push", "--controller", "open_loop", "--json")
    outcome = circuitkit(*words, "--set", "w=1deg")
    told = "--set changes no run: it is for the controller circuit, and here is only open_loop\n"
    assert (outcome.code, outcome.err) == (0, told)
    assert circuitkit(*words).err == ""


@pytest.mark.parametrize(
    ("push", "words"),
    [
        ({"force_n": None, "torque_nm": 0.3, "duration_s": 2.5, "direction": "up"}, "0.3 N*m, 2.5 s, up"),
        ({"force_n": 8.0, "duration_s": 10.0, "direction": "15 deg"}, "8 N, 10 s, 15 deg"),
        ({"pushes": 5}, "20 N, 200 ms, inward, and 4 more"),
    ],
)
def test_a_push_is_told_in_its_own_units(circuitkit, monkeypatch, push, words):
    row = {**ROW, "push": {**ROW["push"], **push}}
    monkeypatch.setattr(package, "simulate", lambda *_, **__: made_up(row))
    assert f" {words} " in " ".join(circuitkit("simulate", "nao_push").out.split())


def test_without_pushes_there_is_no_column_for_them(circuitkit, monkeypatch):
    monkeypatch.setattr(package, "simulate", lambda *_, **__: made_up(FALLEN))
    assert "push  " not in circuitkit("simulate", "nao_push").out.replace("nao_push", "")


# -- the commands themselves, with every scenario that ships


def short(tmp_path, name):
    """The file of a shipped scenario that lasts as long as a test may, without what would begin later."""
    file = next(each.path for each in catalogue("scenarios") if each.name == name)
    scenario = load_scenario(name)
    seconds = min(scenario.duration, LONGEST_S.get(str(scenario.robot), 2.0))
    data = yaml.safe_load(file.read_text(encoding="utf-8")) | {"duration": f"{seconds} s"}
    begins = [each.begins for each in scenario.befalling]
    data["disturbances"] = [
        item
        for item, start in zip(data.get("disturbances", ()), begins, strict=True)
        if not isinstance(start, float) or start < seconds
    ]
    path = tmp_path / f"{name}.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", [each.name for each in catalogue("scenarios")])
def test_every_shipped_scenario_prints_its_measures(circuitkit, tmp_path, name):
    path = short(tmp_path, name)
    done = circuitkit("simulate", str(path), "--json")
    assert (done.code, done.err) == (0, "")
    (row,) = json.loads(done.out)
    scenario = load_scenario(path)
    assert row["scenario"] == name
    assert set(scenario.formulas) <= set(row)
    assert {"controller", "seed", "push", "survived", "interrupted", "notes", "recording"} <= set(row)
    assert (row["push"] is None) == (not scenario.pushes)


def test_the_measures_of_a_scenario_stand_in_the_table(circuitkit, tmp_path):
    done = circuitkit("compare", str(short(tmp_path, "vehicle_avoids")), "--controllers", "open_loop,circuit")
    assert done.code == 0
    heading = next(line for line in done.out.splitlines() if "controller" in line)
    assert heading.split() == ["controller", "seed", "outcome", "stuck", "path", "touched"]
    stood, drove = (line.split() for line in done.out.splitlines() if " s " in line)
    assert stood[:3] == ["open_loop", "0", "failed"]  # it is stuck where it stands
    assert drove[:3] == ["circuit", "0", "passed"]


def test_a_measure_without_a_value_is_a_dash_and_null(circuitkit, tmp_path):
    """Also a yes or no that nobody knows."""
    path = short(tmp_path, "vehicle_avoids")
    measures = "measures:\n  late: last(after(speed > 1 m/s, 900 s))\n  fast: time_of(speed > 900 m/s)\n"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.partition("measures:")[0] + measures, encoding="utf-8")
    lines = [line.split() for line in circuitkit("simulate", str(path)).out.splitlines()]
    assert next(line for line in lines if "controller" in line)[-2:] == ["late", "fast"]
    assert next(line for line in lines if "circuit" in line)[-2:] == ["-", "-"]
    (row,) = json.loads(circuitkit("simulate", str(path), "--json").out)
    assert row["late"] is row["fast"] is None


def test_the_keys_of_a_pushed_walk_are_those_of_the_contract(circuitkit, tmp_path):
    (row,) = json.loads(circuitkit("simulate", str(short(tmp_path, "nao_push")), "--json").out)
    kept = ["survived", "time_of_fall_s", "max_zmp_excursion_m", "recovery_time_s"]
    assert {"scenario", "controller", "seed", "push", *kept, "recording"} <= set(row)
    assert {"force_n", "duration_s", "direction"} <= set(row["push"])


def test_a_robot_of_one_s_own_takes_the_place_of_the_scenario_s(circuitkit, tmp_path):
    original = next(each.path for each in catalogue("robots") if each.name == "cartpole")
    text = original.read_text(encoding="utf-8").replace("robot: cartpole", "robot: mine")
    mjcf = next(original.parent.glob("*.xml"))
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    (tmp_path / mjcf.name).write_text(mjcf.read_text(encoding="utf-8"), encoding="utf-8")
    scenario = str(short(tmp_path, "cartpole_balances"))
    own, mine = (
        json.loads(circuitkit("simulate", scenario, *words, "--json").out)
        for words in ((), ("--robot", "mine.yaml"))
    )
    assert own == mine


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("simulate", "nao_psh"),
            "nao_psh:1:1: unknown name 'nao_psh'; allowed: a path, or one of the shipped",
        ),
        (
            ("simulate", "nao_push", "--controller", "mcp"),
            "unknown controller 'mcp'; allowed: open_loop, circuit",
        ),
        (
            ("compare", "nao_push", "--controllers", "circuit,mcp"),
            "unknown controller 'mcp'; allowed: open_loop",
        ),
        (
            ("simulate", "nao_push", "--circuit", "bin"),
            "bin:1:1: unknown name 'bin'; allowed: a path, or one of",
        ),
        (("simulate", "nao_push", "--robot", "noa"), "unknown robot "),
        (("simulate", "nao_push", "--set", "ww=2"), "settings: unknown name 'ww'; allowed: "),
        (
            ("simulate", "nao_push", "--push", "20N"),
            "--push: found '20N'; allowed: FORCE,DURATION,DIRECTION such",
        ),
        (
            ("simulate", "nao_push", "--push", "2N,1s,up,"),
            "--push: found '2N,1s,up,'; allowed: FORCE,DURATION,DI",
        ),
        (
            ("simulate", "arm_rhythm", "--push", "2N,1s,up"),
            "--push: the scenario 'arm_rhythm' has no push to ch",
        ),
        (
            ("simulate", "nao_push", "--backend", "gpu"),
            "unknown backend 'gpu'; allowed: auto, compiled, numpy",
        ),
    ],
)
def test_a_wrong_name_is_told_with_what_is_allowed(refused, words, said):
    assert refused(*words).startswith(said)


def test_a_wrong_name_in_a_file_is_told_with_its_place(circuitkit, tmp_path):
    path = short(tmp_path, "vehicle_avoids")
    path.write_text(
        path.read_text(encoding="utf-8").replace("circuit: braitenberg_avoider", "circuit: braten")
    )
    done = circuitkit("simulate", path.name)
    assert done.code == 1
    assert "unknown name 'braten'" in done.err
