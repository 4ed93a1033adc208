"""Invalid physics: explosions made by hand, against MuJoCo's own counters and single runs."""

from __future__ import annotations

import json
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from small_robots import CART, CART_FILE, small_model, small_robot

from circuitkit.cli.main import main
from circuitkit.robots.validity import (
    KINDS,
    bad_position,
    bad_reading,
    counts_by_kind,
    describe_warning,
    first_fault,
    invalidates,
    quiet_mujoco,
)
from circuitkit.simulation import Scenario, load_scenario, make_plan, simulate
from circuitkit.simulation.disturbance import RunSpec
from circuitkit.simulation.loop import run_and_watch, run_loop
from circuitkit.study import make_study, sweep
from circuitkit.study.results import Results

HUGE = "1e9N,200ms,left"


def scenario(name: str = "nao_stands", duration: float = 3.0):
    return load_scenario(name).model_copy(update={"duration": duration})


def specs(forces_n):
    """A push of each force for a robot each."""
    plan = make_plan(scenario())
    found = []
    for seed, force in enumerate(forces_n):
        kept = tuple(
            each.model_copy(update={"force": force}) if each.kind == "push" else each
            for each in plan.scenario.befalling
        )
        found.append(RunSpec(seed, kept))
    return plan, found


def test_the_kinds_are_mujocos_own():
    assert len(KINDS) == int(mujoco.mjtWarning.mjNWARNING)
    assert [int(getattr(mujoco.mjtWarning, f"mjWARN_{kind}")) for kind in KINDS] == list(range(len(KINDS)))
    bad = {kind for kind in KINDS if invalidates(kind)}
    assert bad == {"BADQPOS", "BADQVEL", "BADQACC", "BADCTRL", "CONTACTFULL", "CNSTRFULL"}


FREE = """
<mujoco><worldbody><body><freejoint name="free"/><geom size=".1"/>
  <body><joint name="hinge"/><geom size=".1"/></body></body></worldbody>
  <actuator><motor name="m0" joint="hinge"/><motor name="m1" joint="hinge"/></actuator>
  <sensor><jointpos name="s0" joint="hinge"/><jointvel name="s1" joint="hinge"/></sensor></mujoco>
"""


@pytest.mark.parametrize(
    ("kind", "info", "said"),
    [
        ("BADQPOS", 0, "the position of joint 'free' is not finite, or beyond 1e+10 (BADQPOS)"),
        ("BADQPOS", 6, "the position of joint 'free' is not finite, or beyond 1e+10 (BADQPOS)"),
        ("BADQPOS", 7, "the position of joint 'hinge' is not finite, or beyond 1e+10 (BADQPOS)"),
        ("BADQVEL", 5, "the velocity of joint 'free' is not finite, or beyond 1e+10 (BADQVEL)"),
        ("BADQVEL", 6, "the velocity of joint 'hinge' is not finite, or beyond 1e+10 (BADQVEL)"),
        ("BADQACC", 6, "the acceleration of joint 'hinge' is not finite, or beyond 1e+10 (BADQACC)"),
        ("BADCTRL", 1, "the control of actuator 'm1' is not finite, or beyond 1e+10 (BADCTRL)"),
    ],
)
def test_a_warning_names_the_part_that_it_is_about(kind, info, said):
    model = mujoco.MjModel.from_xml_string(FREE)
    assert describe_warning(model, KINDS.index(kind), info) == said


def test_other_warnings_are_in_mujocos_words():
    model = mujoco.MjModel.from_xml_string(FREE)
    said = describe_warning(model, KINDS.index("CONTACTFULL"), 7)
    own = mujoco.mju_warningText(KINDS.index("CONTACTFULL"), 7)
    assert said == f"{own.rstrip('.')} (CONTACTFULL)"


def test_the_first_fault_is_what_was_newly_warned_of_most_often_and_invalidates():
    warned = np.zeros((len(KINDS), 2), dtype=np.int32)
    for kind, info, count in (("BADQPOS", 7, 9), ("BADQVEL", 6, 3), ("BADQACC", 0, 5), ("INERTIA", 0, 99)):
        warned[KINDS.index(kind)] = info, count
    known = np.zeros(len(KINDS), dtype=np.int32)
    known[KINDS.index("BADQPOS")] = 8
    assert first_fault(mujoco.MjModel.from_xml_string(FREE), warned, known).startswith(
        "the acceleration of joint 'free' is"
    )
    counts = counts_by_kind(warned[:, 1].astype(np.int64))
    assert counts == {"INERTIA": 99, "BADQPOS": 9, "BADQVEL": 3, "BADQACC": 5}


def test_what_is_no_number_is_named():
    model = mujoco.MjModel.from_xml_string(FREE)
    assert bad_position(model, 6) == "the position of joint 'free' is not finite"
    assert bad_position(model, 7) == "the position of joint 'hinge' is not finite"
    assert bad_reading(model, 1) == "the reading of sensor 's1' is not finite"


def test_mujoco_itself_says_nothing():
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = True
    config.set()
    quiet_mujoco()
    assert not mujoco.MjLogConfig.get().logto_file
    assert not mujoco.MjLogConfig.get().logto_console


def test_the_model_is_never_reset(tmp_path):
    model = small_model(tmp_path, CART, **CART_FILE).model
    assert model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def test_one_of_three_explodes_and_the_others_are_as_if_alone():
    plan, three = specs([5.0, 1e9, 8.0])
    whole = run_loop(plan.setup(plan.controller(), three))
    assert [why is None for why in whole.invalid] == [True, False, True]
    for robot in (0, 2):
        alone = run_loop(plan.setup(plan.controller(), [three[robot]]))
        for name in ("qpos", "readings", "observations", "commands", "trace"):
            np.testing.assert_array_equal(getattr(whole, name)[:, robot], getattr(alone, name)[:, 0])
        assert whole.measures[robot] == alone.measures[0]
    end = int(whole.end_tick[1])
    assert np.isnan(whole.qpos[end + 1 :, 1]).all()
    watched = run_and_watch(plan.setup(plan.controller(), three))
    assert watched.invalid == list(whole.invalid)
    assert watched.measures() == whole.measures
    assert set(watched.measures()[1].values()) == {None}
    assert set(watched.effort()[1].values()) == {None}


@pytest.mark.parametrize("name", ["nao_stands", "quadruped_trots"])
@pytest.mark.parametrize("direction", ["left", "right", "forward", "backward", "up", "down"])
def test_a_force_of_1e8_n_is_never_stood(name, direction):
    result = simulate(scenario(name, 6.0), push=f"1e8N,200ms,{direction}")
    assert result.invalid is not None
    assert result.outcome.startswith("invalid at ")
    assert result.recording.ticks == int(result.recording.end_tick[0]) + 1
    assert result.row()["survived"] is None


def test_until_does_not_win_over_an_explosion_in_the_same_tick():
    base = scenario()
    with_bound = base.model_copy(update={"valid": "upright > 0.7"})
    fell, invalid = (simulate(each, push="100N,200ms,left") for each in (base, with_bound))
    assert fell.invalid is None
    assert fell.recording.end_tick[0] >= 0
    assert invalid.invalid.endswith(": 'upright > 0.7' does not hold")


def test_simulate_says_it_and_exits_with_3(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = main(["simulate", "nao_stands", "--push", HUGE, "--json", "-o", "out"])
    printed = capsys.readouterr()
    (row,) = json.loads(printed.out) if printed.out.startswith("[") else [json.loads(printed.out)]
    assert code == 3
    assert row["invalid"].startswith("at 2.0")
    assert row["survived"] is None
    assert "invalid at 2.0" in printed.err
    assert (tmp_path / "out" / "channels.png").is_file() or (tmp_path / "out" / "recording.nc").is_file()
    assert not list(tmp_path.rglob("MUJOCO_LOG*"))


def test_a_process_that_only_imports_the_robots_leaves_no_log(tmp_path):
    text = (
        "import circuitkit.robots, mujoco, threading\n"
        'm = mujoco.MjModel.from_xml_string(\'<mujoco><worldbody><body><joint/><geom size=".1"/></body>'
        "</worldbody></mujoco>')\n"
        "def step():\n"
        "    d = mujoco.MjData(m); d.qpos[0] = float('nan'); mujoco.mj_step(m, d)\n"
        "step(); t = threading.Thread(target=step); t.start(); t.join()\n"
    )
    done = subprocess.run([sys.executable, "-c", text], cwd=tmp_path, capture_output=True, check=True)
    assert done.stderr == b""
    assert list(tmp_path.iterdir()) == []


def study(**more):
    return make_study(
        {
            "study": "made_up",
            "scenario": "nao_stands",
            "set": {"duration": "3 s"},
            "seeds": {"first": 0, "count": 2},
            **more,
        }
    )


@pytest.mark.parametrize("workers", [1, 2])
def test_a_sweep_counts_the_invalid_apart(tmp_path, workers, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = study(axes={"push.force": ["2 N", "1e9 N"]})
    results = sweep(asked, tmp_path / "out", workers=workers)
    calm, huge = results.shares()
    assert (calm.survived, calm.runs, calm.invalid) == (2, 2, 0)
    assert (huge.survived, huge.runs, huge.invalid, huge.unknown) == (0, 0, 2, 0)
    assert huge.interval == (0.0, 1.0)
    assert [row["invalid"] is None for row in results.rows] == [True, True, False, False]
    assert results.table.column("invalid").null_count == 2
    assert results.remarks()[0].startswith("2 of 4 runs are invalid")
    assert not list(tmp_path.rglob("MUJOCO_LOG*"))


def test_limits_tell_holes_and_what_nobody_knows():
    """30 N 6 of 6, 36 N 2 of 6, 44 N 6 of 6, 52 N 0 of 6, 60 N invalid."""
    stood = {30: 6, 36: 2, 44: 6, 52: 0, 60: None}
    asked = study(
        seeds={"first": 0, "count": 6},
        search={"field": "push.force", "low": "20 N", "high": "60 N", "step": "2 N"},
    )
    rows = tuple(
        {
            "push.force": float(force),
            "seed": seed,
            "invalid": "at 2.010 s: x" if count is None else None,
            "survived": None if count is None else seed < count,
        }
        for force, count in stood.items()
        for seed in range(6)
    )
    results = Results(asked, rows)
    (limit,) = results.limits()
    assert (limit.largest, limit.fails_at, limit.unknown_at) == (30.0, 36.0, 60.0)
    assert [(each.value, each.survived, each.runs) for each in limit.hole] == [(36.0, 2, 6)]
    assert [each.value for each in limit.holds_again] == [44.0]
    assert results.remarks() == (
        "6 of 30 runs are invalid and count as neither held nor failed; the first at 2.010 s: x",
        "there is a hole: it does not hold at 36 N (2 of 6), but again at 44 N (6 of 6)",
    )


def test_energy_and_joint_speed_are_those_of_a_swinging_pole(tmp_path):
    """Nothing is damped: the energy grows by the motor's 1.5 N times the cart's way."""
    robot = small_robot(tmp_path, CART, **{**CART_FILE, "key": "swung", "hold": {}})
    found = simulate(
        Scenario(
            robot=robot, control_step="2 ms", duration="2 s", valid="joint_speed() < 50 rad/s",
            measures={
                "first": "first(energy())", "gain": "last(energy()) - first(energy())",
                "error": "max(abs(energy() - first(energy()) - 1.5 N * (place - first(place))))",
                "same": "max(abs(joint_speed() - abs(rate(hinge))))",
            },
        )
    )  # fmt: skip
    assert found.invalid is None
    assert found.measures["same"] == 0.0
    assert found.measures["gain"] > 1.0
    assert found.measures["error"] < 0.02 * found.measures["gain"]
    # The cart is 1 m above the ground; the pole's middle, with its centre of mass, half a metre below.
    start = 9.81 * (2 * 1 + 0.5 * (1 - 0.5 * np.cos(0.5)))
    assert found.measures["first"] == pytest.approx(start, rel=1e-3)
