"""`simulate` and `compare`: from a scenario to results, and what is said when something is not there."""

from __future__ import annotations

import json
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
from simulation.test_scenario import TEXT, WAYS, written
from walking import assert_same_bits, scenario

import circuitkit
from circuitkit.base.errors import InputError, UnknownNameError, listing
from circuitkit.base.source.data_files import data_folder
from circuitkit.control import shipped_controllers
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation import RunSpec, compare, load_scenario, loop, make_plan, plots, simulate

ROW = (
    "scenario", "controller", "seed", "push", "survived", "time_of_fall_s", "max_zmp_excursion_m",
    "recovery_time_s", "recording",
)  # fmt: skip


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Pictures have tests of their own, and take seconds."""
    monkeypatch.setattr(plots, "draw_result", lambda *_: None)
    monkeypatch.setattr(plots, "draw_comparison", lambda *_: None)


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
    assert row["push"] == {
        "force_n": 20.0, "torque_nm": None, "duration_s": 0.2, "direction": "inward", "pushes": 1,
    }  # fmt: skip
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
    assert one.specs[0].seed == 3


def test_push_circuit_and_controller_can_be_given(mine):
    path = mine()
    pushed = simulate(path, push="5N,100ms,outward", controller="open_loop")
    (push,) = pushed.pushes
    assert (push.force, push.direction) == (5.0, "outward")
    assert pushed.recording.push_n.sum() * 0.01 == pytest.approx(0.5)
    assert pushed.recording.controller == "open_loop"
    tuned = simulate(path, circuit="binn_lateral_tuned", push="5N,100ms,outward")
    assert tuned.recording.controller == "circuit"
    assert tuned.recording.circuit.name == "binn_lateral_tuned"


def test_the_package_offers_it(mine):
    assert circuitkit.simulate(mine(), controller="open_loop", push="1N,10ms,left").survived


def test_compared_controllers_meet_the_same_fate(mine, tmp_path):
    results = compare(mine(), ["open_loop", "circuit"], output=tmp_path / "out", seed=2)
    open_loop, circuit = (result.recording for result in results)
    assert [result.path.parent.name for result in results] == ["open_loop", "circuit"]
    np.testing.assert_array_equal(open_loop.effects.windows_s, circuit.effects.windows_s)
    np.testing.assert_array_equal(open_loop.motion.targets, circuit.motion.targets)
    # The first commands are small, so that after a tick all else is the same.
    np.testing.assert_allclose(open_loop.qpos[0], circuit.qpos[0], atol=1e-7)
    assert np.abs(simulate(mine(), seed=3).recording.qpos[0] - circuit.qpos[0]).max() > 1e-6
    np.testing.assert_array_equal(open_loop.push_n, circuit.push_n)


def test_the_paper_reproduces_in_one_seed():
    """Section 5.2: 20 N for 0.2 s fell the open loop and not the circuit."""
    open_loop, circuit = compare("nao_push", ["open_loop", "circuit"], seed=0)
    assert not open_loop.survived
    assert circuit.survived
    assert circuit.measures["recovery_time_s"] < 2.0
    after = circuit.recording.time_s[-1] - circuit.recording.effects.windows_s[0, 1]
    assert after >= 10


# --- wrong input --------------------------------------------------------------------------------------------


def test_an_unknown_servo_profile(mine):
    assert complaints(mine(("robot: nao", "robot: nao\nservo_profile: stal"))) == (
        "mine.yaml:3:16: servo_profile: unknown servo profile 'stal'; allowed: stall, bhuman, urdf; "
        "did you mean 'stall'?"
    )


def test_an_unknown_gait(mine):
    said = complaints(mine(("gait: gait_march", "gait: gait_marsh")))
    assert said.startswith(
        "mine.yaml:3:19: reference.gait: unknown name 'gait_marsh'; allowed: a path, or one of the "
    )
    assert said.endswith("did you mean 'gait_march'?")


def test_an_unknown_controller(mine):
    with pytest.raises(UnknownNameError) as caught:
        simulate(mine(), controller="mcp")
    names = ", ".join(shipped_controllers())
    assert str(caught.value).startswith(f"unknown controller 'mcp'; allowed: open_loop, circuit, {names}")
    with pytest.raises(UnknownNameError):
        compare(mine(), ["open_loop", "circuits"])


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
    assert said.startswith(
        "mine.yaml:1:1: control_step: found a control step of 5 ms; allowed: a multiple of "
    )


def test_a_circuit_that_writes_what_the_robot_does_not_take(mine, tmp_path):
    """The complaint is about the circuit file."""
    text = shipped("circuits", "binn_lateral")
    (tmp_path / "wrong.yaml").write_text(text.replace("  ankle_roll:\n", "  hip_swing:\n"), encoding="utf-8")
    said = complaints(mine(), circuit=tmp_path / "wrong.yaml").replace(str(tmp_path) + "/", "")
    assert said.startswith("wrong.yaml:")
    allowed = listing(build_model(load_robot("nao")).commands)
    assert f":3: outputs.hip_swing: the robot has no command 'hip_swing'; allowed: {allowed}" in said


def test_a_bad_push_is_told_before_anything_runs(mine, tmp_path):
    said = complaints(mine(), push="20 kg,200ms,inward", output=tmp_path / "out")
    assert said == "--push: force: found '20 kg'; allowed: more than 0, in a unit like N"
    assert not (tmp_path / "out").exists()
    said = complaints(mine(), push="20 N,200ms,inwards", output=tmp_path / "out")
    assert said == (
        f"--push: direction: unknown direction 'inwards'; allowed: {WAYS}, outward, inward, "
        "or an angle such as '15 deg'; did you mean 'inward'?"
    )


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

    monkeypatch.setattr("circuitkit.simulation.run.progress_bar", bar)


def test_what_was_recorded_until_ctrl_c_is_on_disk(mine, tmp_path, monkeypatch):
    whole = simulate(mine())
    interrupt_at(monkeypatch, 140)
    result = simulate(mine(), output=tmp_path / "out")
    assert result.recording.interrupted
    assert result.row()["interrupted"] is True
    assert result.survived
    table = pd.read_csv(tmp_path / "out" / "recording.csv")
    assert len(table) == 140
    np.testing.assert_allclose(table["zmp_y_m"], whole.recording.channel("zmp_y")[:140, 0], rtol=1e-8)


def test_ctrl_c_while_filming_says_what_is_there_and_what_is_not(mine, tmp_path, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("circuitkit.simulation.film.film", stopped)
    path = tmp_path / "out" / "video.mp4"
    result = simulate(mine(), output=tmp_path / "out", video=True)
    assert not result.recording.interrupted
    assert result.row()["interrupted"] is True
    assert result.notes == (
        f"no film: interrupted before '{path}' was whole; the recording and the plots are there",
    )
    assert (tmp_path / "out" / "recording.nc").is_file()
    assert not path.exists()


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
    assert plan.ticks == 240
    assert plan.body.motion.targets.shape == (240, 24)
    rest = tuple(each for each in plan.scenario.befalling if each.kind != "push")
    specs = [RunSpec(1, rest), RunSpec(2, plan.scenario.befalling)]
    setup = plan.setup(plan.controller("circuit"), specs)
    assert setup.specs == tuple(specs)
    np.testing.assert_array_equal(np.isnan(setup.effects.windows_s[:, 0]), [True, False])
    (fault,) = setup.effects.on_clipped
    assert (fault.first, fault.last) == (100, 110)


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
    alone = scenario("gait_walk_2cm", duration=2.0)
    result = simulate(alone, circuit=own)
    assert result.survived
    excursion = simulate(alone, controller="open_loop").measures["max_zmp_excursion_m"]
    assert result.measures["max_zmp_excursion_m"] == excursion
