"""`simulate` and `compare`: from a scenario to results, and what is said when something is not there."""

from __future__ import annotations

import json
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
from simulate.test_scenario import TEXT, written
from walking import assert_same_bits, scenario

import circuitkit
from circuitkit.base.errors import InputError, UnknownNameError, listing
from circuitkit.base.source.data_files import data_folder
from circuitkit.control import shipped_controllers
from circuitkit.robots import load_robot
from circuitkit.simulation import compare, load_scenario, loop, make_plan, pictures, simulate, watch
from circuitkit.simulation.disturbance import Trial

ROW = (
    "scenario", "controller", "seed", "push", "survived", "time_of_fall_s", "max_zmp_excursion_m",
    "recovery_time_s", "recording",
)  # fmt: skip


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Pictures have tests of their own, and take seconds."""
    monkeypatch.setattr(pictures, "draw_result", lambda *_: None)
    monkeypatch.setattr(pictures, "draw_comparison", lambda *_: None)


@pytest.fixture
def mine(tmp_path):
    """A scenario file of two seconds, to be changed."""

    def write(*changes):
        text = TEXT.replace("duration: 4 s", "duration: 2.4 s")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        return written(tmp_path, text)

    return write


def shipped(folder, name):
    """The text of a shipped file."""
    return (data_folder(folder) / f"{name}.yaml").read_text(encoding="utf-8")


def complaints(path, **options):
    with pytest.raises(InputError) as caught:
        simulate(path, **options)
    return str(caught.value).replace(str(path), "mine.yaml")


# --- results ------------------------------------------------------------------------------------------------


def test_a_run_leaves_a_recording_and_a_verdict(mine, tmp_path):
    result = simulate(mine(), output=tmp_path / "out")
    assert result.path == tmp_path / "out" / "recording.nc"
    assert (tmp_path / "out" / "recording.csv").is_file()
    row = json.loads(json.dumps(result.row()))
    assert set(ROW) <= set(row)
    assert row["push"] == {"force_n": 20.0, "duration_s": 0.2, "direction": "inward"}
    assert (row["scenario"], row["controller"], row["seed"]) == ("mine", "circuit", 0)
    assert row["recording"] == str(result.path)
    assert row["interrupted"] is False
    table = pd.read_csv(tmp_path / "out" / "recording.csv")
    assert len(table) == result.recording.ticks
    assert table["push_n"].sum() * 0.01 == pytest.approx(20 * 0.2)


def test_without_a_folder_nothing_is_written(mine, tmp_path, monkeypatch):
    path = mine()
    monkeypatch.chdir(tmp_path)
    result = simulate(path)
    assert result.path is None
    assert result.row()["recording"] is None
    assert [each.name for each in tmp_path.iterdir()] == ["mine.yaml"]


def test_a_run_without_a_push_has_none_to_report():
    assert simulate(scenario(duration=0.2)).row()["push"] is None


def test_the_seed_decides_all_chance(mine):
    path = mine()
    one, same, other = (simulate(path, seed=seed).recording for seed in (3, 3, 4))
    assert_same_bits(one, same)
    assert (one.observations[5] != other.observations[5]).all()
    assert one.trials[0].seed == 3


def test_push_circuit_and_controller_can_be_given(mine):
    path = mine()
    pushed = simulate(path, push="5N,100ms,outward", controller="open_loop")
    assert (pushed.push.force, pushed.push.direction) == (5.0, "outward")
    assert pushed.recording.push_n.sum() * 0.01 == pytest.approx(0.5)
    assert pushed.recording.controller == "open_loop"
    tuned = simulate(path, circuit="binn_lateral_tuned", push="5N,100ms,outward")
    assert tuned.recording.controller == "circuit"
    assert tuned.recording.circuit.name == "binn_lateral_tuned"


def test_the_package_is_called_by_the_same_name(mine):
    assert circuitkit.simulation(mine(), controller="open_loop", push="1N,10ms,left").verdict.survived


def test_compared_controllers_meet_the_same_fate(mine, tmp_path):
    results = compare(mine(), ["open_loop", "circuit"], output=tmp_path / "out", seed=2)
    open_loop, circuit = (result.recording for result in results)
    assert [result.path.parent.name for result in results] == ["open_loop", "circuit"]
    np.testing.assert_array_equal(open_loop.fates.windows_s, circuit.fates.windows_s)
    np.testing.assert_array_equal(open_loop.fates.cell_noise, circuit.fates.cell_noise)
    np.testing.assert_array_equal(open_loop.walk.joints_rad, circuit.walk.joints_rad)
    np.testing.assert_array_equal(open_loop.fates.base_velocity, circuit.fates.base_velocity)


def test_the_paper_reproduces_in_one_seed():
    """Section 5.2: 20 N for 0.2 s fell the open loop and not the circuit."""
    open_loop, circuit = compare("nao_push", ["open_loop", "circuit"], seed=0)
    assert not open_loop.verdict.survived
    assert circuit.verdict.survived
    assert circuit.verdict.recovery_time_s < 2.0
    after = circuit.recording.time_s[-1] - circuit.recording.fates.windows_s[0, 1]
    assert after >= 10


# --- wrong input --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("robot: nao", "robot: noa",
         "mine.yaml:2:8: robot: unknown robot (a path to a robot.yaml is allowed as well) 'noa'; "
         "allowed: nao; did you mean 'nao'?"),
        ("robot: nao", "robot: nao\nservo_profile: stal",
         "mine.yaml:3:16: servo_profile: unknown servo profile 'stal'; allowed: stall, bhuman, urdf; "
         "did you mean 'stall'?"),
        ("body: torso", "body: belly",
         "mine.yaml:7:11: pushes[0].body: unknown body 'belly'; allowed: torso, left_foot, right_foot, "
         "Neck, Head, LPelvis, LHip, LThigh, LTibia, LAnklePitch, l_ankle, RPelvis, RHip, RThigh, RTibia, "
         "RAnklePitch, r_ankle, LShoulder, LBicep, LElbow and 7 more"),
        ("step: 1,", "step: 12,",
         "mine.yaml:11:12: pushes[0].start: found step 12, and the walk ends before that 'lift'; "
         "allowed: steps 0 to 1, or a longer duration"),
        ("cell: LFsrFL", "cell: LFsr",
         "mine.yaml:13:12: faults[0].cell: the robot has no force cell 'LFsr'; allowed: LFsrFL, LFsrFR, "
         "LFsrRL, LFsrRR, RFsrFL, RFsrFR, RFsrRL, RFsrRR; did you mean 'LFsrFL'?"),
        ("duration: 2.4 s", "duration: 4 ms",
         "mine.yaml:1:1: the fault of LFsrFL starts after the end; allowed: before 0.004 s"),
    ],
)  # fmt: skip
def test_a_name_that_is_not_there(mine, old, new, said):
    assert complaints(mine((old, new))) == said


def test_an_unknown_gait(mine):
    said = complaints(mine(("gait: gait_march", "gait: gait_marsh")))
    assert said.startswith(
        "gait_marsh:1:1: unknown name 'gait_marsh'; allowed: a path, or one of the shipped gaits: "
    )
    assert said.endswith("did you mean 'gait_march'?")


def test_an_unknown_controller(mine):
    with pytest.raises(UnknownNameError) as caught:
        simulate(mine(), controller="mcp")
    names = ", ".join(shipped_controllers())
    assert str(caught.value).startswith(f"unknown controller 'mcp'; allowed: open_loop, circuit, {names}")
    with pytest.raises(UnknownNameError):
        compare(mine(), ["open_loop", "circuits"])


def test_an_unknown_controller_in_the_file(mine):
    assert complaints(mine(("robot: nao", "robot: nao\ncontroller: open_lop"))) == (
        "mine.yaml:3:13: controller: unknown controller 'open_lop'; allowed: open_loop, circuit, "
        f"{', '.join(shipped_controllers())}; did you mean 'open_loop'?"
    )


def test_a_walk_shorter_than_a_control_step():
    with pytest.raises(InputError) as caught:
        make_plan(scenario(duration=0.004))
    assert str(caught.value).endswith("duration: found 0.004 s; allowed: a control step of 0.01 s, or more")


def test_a_gait_that_does_not_fit_the_time_step(mine, tmp_path):
    gait = shipped("sims/gaits", "gait_march")
    (tmp_path / "quick.yaml").write_text(
        gait.replace("control_step: 10 ms", "control_step: 5 ms"), encoding="utf-8"
    )
    said = complaints(mine(("gait: gait_march", "gait: quick.yaml")))
    assert "control_step is 5 ms; allowed: a multiple of the model's 2 ms" in said


def test_a_circuit_that_writes_what_the_robot_does_not_take(mine, tmp_path):
    """The complaint is about the circuit file."""
    text = shipped("circuits", "binn_lateral")
    (tmp_path / "wrong.yaml").write_text(text.replace("  ankle_roll:\n", "  hip_swing:\n"), encoding="utf-8")
    said = complaints(mine(), circuit=tmp_path / "wrong.yaml").replace(str(tmp_path) + "/", "")
    assert said.startswith("wrong.yaml:")
    allowed = listing(load_robot("nao").commands)
    assert f":3: outputs.hip_swing: the robot has no command 'hip_swing'; allowed: {allowed}" in said


def test_a_bad_push_is_told_before_anything_runs(mine, tmp_path):
    said = complaints(mine(), push="20 kg,200ms,inward", output=tmp_path / "out")
    assert said == "--push: force: found '20 kg'; allowed: more than 0, in a unit like N"
    assert not (tmp_path / "out").exists()


def test_an_unknown_scenario():
    with pytest.raises(InputError, match="did you mean 'nao_push'"):
        simulate("nao_pushed")


# --- Ctrl-C -------------------------------------------------------------------------------------------------


def interrupt_at(monkeypatch, tick):
    """Let the bar be stopped by Ctrl-C at a tick, as a terminal would."""

    @contextmanager
    def bar(*_, **__):
        def advance(done):
            if done >= tick:
                raise KeyboardInterrupt

        yield advance

    monkeypatch.setattr(watch, "progress_bar", bar)


def test_what_was_recorded_until_ctrl_c_is_on_disk(mine, tmp_path, monkeypatch):
    whole = simulate(mine())
    interrupt_at(monkeypatch, 140)
    result = simulate(mine(), output=tmp_path / "out")
    assert result.recording.interrupted
    assert result.row()["interrupted"] is True
    assert result.verdict.survived
    table = pd.read_csv(tmp_path / "out" / "recording.csv")
    assert len(table) == 140
    np.testing.assert_allclose(table["zmp_y_m"], whole.recording.channel("zmp_y")[:140, 0], rtol=1e-8)


def test_a_comparison_stops_with_the_run_that_was_stopped(mine, tmp_path, monkeypatch):
    interrupt_at(monkeypatch, 40)
    results = compare(mine(), ["open_loop", "circuit"], output=tmp_path / "out")
    assert [result.recording.controller for result in results] == ["open_loop"]
    assert (tmp_path / "out" / "open_loop" / "recording.nc").is_file()
    assert not (tmp_path / "out" / "circuit").exists()


def test_ctrl_c_before_the_first_tick_leaves_nothing(mine, tmp_path, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(loop, "_ticks", stopped)
    with pytest.raises(KeyboardInterrupt):
        simulate(mine(), output=tmp_path / "out")
    assert not (tmp_path / "out").exists()


# --- plans --------------------------------------------------------------------------------------------------


def test_a_plan_serves_several_runs(mine):
    plan = make_plan(load_scenario(mine()))
    assert plan.walk.ticks == 240
    assert plan.targets.shape == (240, 24)
    setup = plan.setup("circuit", [Trial(1, ()), Trial(2, plan.scenario.pushes)])
    assert len(setup.trials) == 2
    assert setup.fates.cell_noise.shape == (240, 2, 8)
    assert sorted(setup.cell_factors) == list(range(100, 110))


def test_a_circuit_of_ones_own_needs_no_neurons_at_the_edges(tmp_path):
    """The thresholds of the scenario's circuit count then, as they do for the open loop."""
    own = tmp_path / "own.yaml"
    own.write_text(
        """
circuit: own
control_step: 10 ms
timing: ordered
inputs: {gyro_x: {unit: rad/s, range: [-5 rad/s, 5 rad/s]}}
neurons: {tilting: {model: sigmoid, role: excitatory, slope: 10 s/rad, shift: 1 rad/s}}
synapses: [{from: gyro_x, to: tilting, weight: 1}]
outputs: {ankle_roll: {unit: deg, readout: {tilting: 1 deg}}}
"""
    )
    scenario = load_scenario("nao_push").model_copy(update={"duration": 2.0, "pushes": ()})
    result = simulate(scenario, circuit=own)
    assert result.verdict.survived
    assert (
        result.verdict.max_zmp_excursion_m
        == simulate(scenario, controller="open_loop").verdict.max_zmp_excursion_m
    )
