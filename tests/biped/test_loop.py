"""The closed loop: the same to the bit for any batch, threads and names; faults, falls and Ctrl-C."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from robots.nao_files import renamed_robot
from simulate.made_up import EDGES
from simulate.test_scenario import TEXT
from walking import a_push, assert_same_bits, fault, nao, plan_of, walk_alone

from circuitkit import parse_circuit
from circuitkit.base.errors import InputError
from circuitkit.base.units import parse_quantity
from circuitkit.robots import Plant, load_robot
from circuitkit.simulation import load_scenario, make_plan
from circuitkit.simulation.disturbance import Trial
from circuitkit.simulation.loop import has_fallen, run_and_watch, run_loop, run_to_see_who_stands
from circuitkit.simulation.scenario import Jitter, SensorNoise

CHANCE = {
    "jitter": Jitter.model_validate({"push_start": "20 ms", "base_velocity": "1 cm/s"}),
    "sensor_noise": SensorNoise.model_validate({"force_cells": "0.2 N"}),
}
TRIALS = (
    Trial(4, (a_push(force=12.0),)),
    Trial(5, (a_push(force=9.0, direction="outward"), a_push(body="Head", force=2.0, step=1))),
    Trial(6, ()),
)


@cache
def plan():
    """A march of 2.6 s with noise, under the circuit."""
    return plan_of(duration=2.6, **CHANCE)


@cache
def batch():
    """Three robots of different fates."""
    return run_loop(plan().setup("circuit", TRIALS), threads=2)


# --- the same to the bit ------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", range(3))
def test_a_robot_alone_does_what_it_does_in_a_batch(robot):
    alone = run_loop(plan().setup("circuit", TRIALS[robot : robot + 1]))
    assert_same_bits(batch(), alone, [robot])


def test_the_number_of_threads_changes_nothing():
    assert_same_bits(batch(), run_loop(plan().setup("circuit", TRIALS), threads=1), range(3))


def test_the_same_again_is_the_same_again():
    setup = plan().setup("circuit", TRIALS)
    assert_same_bits(run_loop(setup), run_loop(setup), range(3))


def test_the_robots_of_the_batch_did_different_things():
    last = batch().qpos[-1]
    assert np.abs(np.diff(last, axis=0)).max(axis=1).min() > 1e-4
    assert not np.isnan(batch().observations).any()


def test_a_nao_with_other_names_needs_only_another_robot_file(tmp_path):
    """Every body, joint, site and geom of the MJCF is called something else; the same happens to the bit."""
    path = renamed_robot(tmp_path)
    other_file = path.with_name("other.xml").read_text(encoding="utf-8")
    assert not any(f'"{name}"' in other_file for name in (*nao().actuated, "torso", "l_ankle"))
    trial = Trial(4, (a_push(force=12.0),))
    same = plan_of(duration=1.8, **CHANCE)
    other = plan_of(duration=1.8, robot=str(path), **CHANCE)
    np.testing.assert_array_equal(other.targets, same.targets)
    recording = run_loop(other.setup("circuit", [trial]))
    assert_same_bits(run_loop(same.setup("circuit", [trial])), recording)
    assert np.abs(recording.push_n).max() == 12.0


def test_a_robot_file_may_have_sensors_of_its_own_names(tmp_path):
    """The force cells are named by the robot file alone."""
    path = renamed_robot(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace("LFsr", "Links"), encoding="utf-8")
    assert list(load_robot(path).feet.left.cells) == ["LinksFL", "LinksFR", "LinksRL", "LinksRR"]
    recording = walk_alone(plan_of(duration=1.1, robot=str(path)))
    assert "LinksFL_n" in recording.columns()


# --- what happens in a tick ---------------------------------------------------------------------------------


def test_the_controller_reads_what_the_last_tick_left():
    """Without noise and below the cells' limit, observation t is the channel of reading t - 1."""
    recording = walk_alone(plan_of(duration=1.0))
    for i, name in enumerate(recording.observation_names):
        np.testing.assert_array_equal(recording.observations[1:, :, i], recording.channel(name)[:-1])


def test_a_circuit_may_read_any_sensor(tmp_path):
    """Here the gyro and the speed of the CoM, with noise on the force cells: those alone are noisy."""
    text = EDGES.replace(
        "neurons:",
        "  gyro_x: {unit: deg/s, range: [-100 deg/s, 100 deg/s]}\n"
        "  com_velocity_y: {unit: m/s, range: [-1 m/s, 1 m/s]}\n"
        "neurons:\n"
        "  g: {model: sigmoid, role: excitatory, slope: 1 s/rad, shift: 0 rad/s}\n"
        "  v: {model: sigmoid, role: excitatory, slope: 1 s/m, shift: 0 m/s}",
    ).replace(
        "synapses:",
        "synapses:\n  - {from: gyro_x, to: g, weight: 1}\n  - {from: com_velocity_y, to: v, weight: 1}",
    )
    text = text.replace("readout: {out: 1 deg}", "readout: {out: 1 deg, g: 0.1 deg, v: 0.1 deg}")
    (tmp_path / "moving.yaml").write_text(text, encoding="utf-8")
    plan = plan_of(str(tmp_path / "moving.yaml"), duration=1.0, sensor_noise=CHANCE["sensor_noise"])
    recording = walk_alone(plan)
    assert recording.observation_names == ("zmp_y", "gyro_x", "com_velocity_y")
    for i, name in enumerate(recording.observation_names):
        read, true = recording.observations[1:, :, i], recording.channel(name)[:-1]
        assert np.array_equal(read, true) == (name != "zmp_y")
        assert np.ptp(read) > 1e-3


def test_the_controller_reads_noise_and_the_robot_does_not():
    """The open loop is not touched by noise; what the circuit reads is."""
    quiet, noisy = plan_of(duration=1.0), plan_of(duration=1.0, sensor_noise=CHANCE["sensor_noise"])
    assert_same_bits(walk_alone(quiet, "open_loop"), walk_alone(noisy, "open_loop"))
    difference = walk_alone(noisy).observations[2:60] - walk_alone(quiet).observations[2:60]
    zmp = list(walk_alone(noisy).observation_names).index("zmp_y")
    # Eight cells of 0.2 N each about 70 mm from the middle, over 51 N.
    assert difference[..., zmp].std() == pytest.approx(0.2 * np.sqrt(8) * 0.055 / 51, rel=0.3)


def test_noise_of_the_com_is_read_in_the_channels_of_the_com_alone():
    text = EDGES.replace(
        "neurons:",
        "  com_y: {unit: m, range: [-1 m, 1 m]}\n  com_velocity_y: {unit: m/s, range: [-1 m/s, 1 m/s]}\n"
        "neurons:\n"
        "  c: {model: sigmoid, role: excitatory, slope: 1 /m, shift: 0 m}\n"
        "  v: {model: sigmoid, role: excitatory, slope: 1 s/m, shift: 0 m/s}",
    ).replace(
        "synapses:",
        "synapses:\n  - {from: com_y, to: c, weight: 1}\n  - {from: com_velocity_y, to: v, weight: 1}",
    )
    text = text.replace("readout: {out: 1 deg}", "readout: {out: 1 deg, c: 0.1 deg, v: 0.1 deg}")
    noise = SensorNoise.model_validate({"com": "2 mm", "com_velocity": "3 cm/s"})
    noisy = plan_of(duration=1.0, sensor_noise=noise)
    recording = walk_alone(replace(noisy, circuit=parse_circuit(text, "edges.yaml")))
    for i, (name, deviation) in enumerate((("zmp_y", 0.0), ("com_y", 0.002), ("com_velocity_y", 0.03))):
        read, true = recording.observations[1:, :, i], recording.channel(name)[:-1]
        assert (read - true).std() == pytest.approx(deviation, rel=0.25)


def test_cells_read_no_less_and_no_more_than_their_range():
    """With 300 N of noise none reads less than 0, so the ZMP stays in their hull.

    Cells that can show 1 N at most all show that while the robot stands, so the ZMP is their mean.
    """
    loud = SensorNoise.model_validate({"force_cells": "300 N"})
    recording = walk_alone(plan_of(duration=0.5, sensor_noise=loud))
    zmp = list(recording.observation_names).index("zmp_y")
    assert np.abs(recording.observations[..., zmp]).max() <= 0.0799 + 1e-12

    cells = nao().spec.force_cells.model_copy(update={"range": (0.0, 1.0)})
    spec = nao().spec.model_copy(update={"force_cells": cells})
    recording = walk_alone(plan_of(duration=0.5))
    weak = walk_alone(replace(plan_of(duration=0.5), robot=replace(nao(), spec=spec)))
    assert np.abs(weak.observations[10:40, 0, zmp]).max() < 1e-12 < np.abs(recording.observations[40, 0, zmp])


def test_robots_start_with_the_velocity_that_was_drawn():
    """Standing legs take a part of it within the first tick."""
    hasty = Jitter.model_validate({"base_velocity": "5 cm/s"})
    setup = plan_of(duration=0.02, jitter=hasty).setup("open_loop", [Trial(seed, ()) for seed in range(12)])
    drawn, found = setup.fates.base_velocity, run_loop(setup).com_velocity[0, :, :2]
    for axis in (0, 1):
        assert np.corrcoef(drawn[:, axis], found[:, axis])[0, 1] > 0.95
        assert 0.2 < np.polyfit(drawn[:, axis], found[:, axis], 1)[0] < 1.1


def test_commands_turn_the_ankles():
    """What the circuit writes arrives at the robot: with it the joints differ, and by as much."""
    recording = walk_alone(plan_of(duration=2.4, pushes=(a_push(force=14.0),)))
    without = walk_alone(plan_of(duration=2.4, pushes=(a_push(force=14.0),)), "open_loop")
    first = int(np.flatnonzero(np.abs(recording.commands[:, 0, 0]) > 1e-2)[0])
    np.testing.assert_allclose(recording.qpos[: first - 20], without.qpos[: first - 20], atol=5e-3)
    place = recording.robot.qpos_index[list(recording.robot.actuated).index("LAnkleRoll")]
    turned = (recording.qpos - without.qpos)[:, 0, place]
    assert np.corrcoef(turned[first : first + 25], recording.commands[first : first + 25, 0, 0])[0, 1] > 0.8


def test_the_open_loop_follows_the_plan_and_records_no_neurons():
    recording = walk_alone(plan_of(duration=0.3), "open_loop")
    assert recording.commands.shape == (30, 1, 0)
    assert recording.trace.shape == (30, 1, 0)
    assert recording.controller == "open_loop"


def test_a_push_gives_its_impulse_to_the_robot():
    """Right after a short hard push the CoM is faster by F d / m, less what the standing leg takes."""
    push = a_push(force=60.0, duration=0.02, direction="outward", at=0.5)
    pushed, calm = (walk_alone(plan_of(duration=2.0, pushes=pushes), "open_loop") for pushes in ((push,), ()))
    after = round(pushed.fates.windows_s[0, 1] / 0.01) + 1
    faster = (pushed.com_velocity - calm.com_velocity)[after, 0]
    assert 0.6 < faster[1] / (60 * 0.02 / nao().mass_kg) < 1.0
    assert abs(faster[0]) < 0.03
    np.testing.assert_array_equal(pushed.qpos[: after - 5], calm.qpos[: after - 5])


def test_a_push_above_the_centre_of_mass_turns_the_torso_over():
    """To the left: about -x, the more the higher it acts; the force is the same."""
    rates, forces = [], []
    for height in (0.0, 0.08):
        push = a_push(force=30.0, duration=0.02, direction="90 deg", height=height)
        recording = walk_alone(plan_of(duration=1.4, pushes=(push,)), "open_loop")
        after = round(recording.fates.windows_s[0, 1] / 0.01)
        rates.append(recording.channel("gyro_x")[after, 0])
        forces.append(recording.push_n)
    assert rates[1] < rates[0] - 0.05
    np.testing.assert_array_equal(*forces)


# --- the plant ----------------------------------------------------------------------------------------------


def test_a_plant_is_simulated_and_neither_walk_nor_controller_know():
    plain = plan_of(duration=1.2)
    other = plan_of(duration=1.2, plant=Plant(mass=1.1, slope={"left": "2 deg"}))
    np.testing.assert_array_equal(other.targets, plain.targets)
    np.testing.assert_array_equal(other.walk.pelvis_m, plain.walk.pelvis_m)
    assert other.robot.mass_kg == plain.robot.mass_kg
    setup = other.setup("circuit", [Trial(0, ())])
    assert setup.robot.mass_kg == pytest.approx(1.1 * plain.robot.mass_kg)
    recording = run_loop(setup)
    assert recording.channel("load")[100, 0] == pytest.approx(1.1 * plain.robot.mass_kg * 9.81, rel=0.02)
    assert np.abs(recording.qpos - walk_alone(plain).qpos).max() > 1e-3


def test_a_payload_nowhere_is_told_with_its_line(tmp_path):
    text = TEXT + "plant: {payload: {body: r_hand, mass: 0.3 kg}}\n"
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        make_plan(load_scenario(path))
    said = str(caught.value).replace(str(path), "mine.yaml")
    assert said.startswith("mine.yaml:22:25: plant.payload.body: unknown body 'r_hand'; allowed: torso, ")


def test_a_delay_between_control_steps_is_told_with_its_line(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT + "sensor_delay: 25 ms\n", encoding="utf-8")
    plan = make_plan(load_scenario(path))
    with pytest.raises(InputError) as caught:
        plan.setup("open_loop", [Trial(0, ())])
    assert str(caught.value).replace(str(path), "mine.yaml") == (
        "mine.yaml:22:15: sensor_delay: found 25 ms; allowed: a multiple of the control step of 10 ms"
    )


# --- falling ------------------------------------------------------------------------------------------------


def test_fallen_is_who_leans_beyond_45_degrees_or_lies():
    layout = nao().layout
    first = np.zeros((1, layout.width))
    first[:, layout.com] = [0, 0, 0.27]
    readings = np.repeat(first, 5, axis=0)[:, None]
    angles = np.radians([0, 44, 46, 0, 0])
    readings[:, 0, layout.torso_up] = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    readings[3, 0, layout.com.start + 2] = 0.17
    readings[4, 0, layout.com.start + 2] = 0.15
    assert has_fallen(readings, nao(), first)[:, 0].tolist() == [False, False, True, False, True]


def test_a_run_ends_soon_after_all_have_fallen_and_not_before():
    hard = a_push(force=60.0, duration=0.3, direction="forward")
    one = plan_of(duration=9.0)
    recording = run_loop(one.setup("open_loop", [Trial(0, (hard,))]))
    fallen = has_fallen(recording.readings, nao(), recording.readings[0])[:, 0]
    assert fallen.any()
    assert 60 <= recording.ticks - int(fallen.argmax()) <= 85
    assert recording.ticks < 400
    both = run_loop(one.setup("open_loop", [Trial(0, (hard,)), Trial(0, ())]))
    assert both.ticks == 900
    assert_same_bits(both, recording, [0])


def test_seeing_who_stands_is_what_a_recording_shows():
    hard = a_push(force=60.0, duration=0.3, direction="forward")
    setup = plan_of(duration=3.0).setup("circuit", [Trial(0, ()), Trial(0, (hard,)), Trial(1, ())])
    recording = run_loop(setup)
    stands = ~has_fallen(recording.readings, nao(), recording.readings[0]).any(axis=0)
    np.testing.assert_array_equal(run_to_see_who_stands(setup), stands)
    assert stands.tolist() == [True, False, True]


def test_who_has_fallen_is_stepped_no_further_if_only_the_verdict_counts():
    """The others go on to the same bits; the fallen one stays where it was within 20 ticks of its fall."""
    hard = a_push(force=60.0, duration=0.3, direction="forward")
    setup = plan().setup("circuit", [Trial(0, ()), Trial(0, (hard,)), Trial(1, ())])
    recording = run_loop(setup)
    every = range(nao().layout.width)
    watched = run_and_watch(setup, every)
    np.testing.assert_array_equal(watched.readings[:, [0, 2]], recording.readings[:, [0, 2]])
    np.testing.assert_array_equal(watched.commands[:, [0, 2]], recording.commands[:, [0, 2]])
    np.testing.assert_array_equal(watched.first, recording.readings[0])
    fall = int(has_fallen(recording.readings, nao(), recording.readings[0])[:, 1].argmax())
    still = np.flatnonzero((np.diff(watched.readings[:, 1], axis=0) == 0).all(axis=1))
    assert fall <= still[0] <= fall + 20
    assert len(still) == recording.ticks - 1 - still[0]
    np.testing.assert_array_equal(watched.readings[: still[0], 1], recording.readings[: still[0], 1])


# --- old readings -------------------------------------------------------------------------------------------


def test_a_delay_shifts_what_is_read_by_whole_ticks_and_nothing_else():
    """Under a circuit without outputs that matter the robot does the same, so every reading is just older."""
    text = EDGES.replace("readout: {out: 1 deg}", "readout: {out: 0 deg}")
    for ticks, delay in ((1, "10 ms"), (3, "30 ms")):
        now, later = (idle_reader(text, delay=each) for each in ("0 ms", delay))
        np.testing.assert_array_equal(later.qpos, now.qpos)
        np.testing.assert_array_equal(later.observations[ticks:], now.observations[:-ticks])
        np.testing.assert_array_equal(later.observations[:ticks], now.observations[[0] * ticks])
        assert np.ptp(now.observations) > 1e-3


@cache
def idle_reader(text, delay):
    """A run of a circuit that reads noise and commands nothing."""
    circuit = parse_circuit(text, "edges.yaml")
    changes = {"sensor_noise": CHANCE["sensor_noise"], "faults": (fault("LFsrFL", "zero", 0.3, 0.2),)}
    delayed = plan_of(duration=0.8, sensor_delay=parse_quantity(delay).value_si, **changes)
    return walk_alone(replace(delayed, circuit=circuit))


def test_a_missing_reading_arrives_late_as_well():
    broken = fault("LFsrFL", "missing", 0.3, 0.1)
    recording = walk_alone(plan_of(duration=0.6, faults=(broken,), sensor_delay=0.02))
    missing = np.isnan(recording.observations).any(axis=(1, 2))
    np.testing.assert_array_equal(missing.nonzero()[0], range(32, 42))


# --- missing readings and interruptions ---------------------------------------------------------------------


def test_a_missing_cell_holds_the_command_and_the_run_goes_on():
    """A cell fails during a push; until it is back the ankle stays where it was."""
    pushes = (a_push(force=14.0, at=0.2),)
    broken = fault("LFsrFL", "missing", 1.3, 0.1)
    recording = walk_alone(plan_of(duration=2.4, pushes=pushes, faults=(broken,)))
    whole = walk_alone(plan_of(duration=2.4, pushes=pushes))
    assert recording.ticks == 240
    np.testing.assert_array_equal(
        np.isnan(recording.observations).any(axis=(1, 2)).nonzero()[0], range(130, 140)
    )
    held = recording.commands[129]
    np.testing.assert_array_equal(recording.commands[130:140], np.repeat(held[None], 10, axis=0))
    assert abs(held[0, 0]) > 0
    assert np.isfinite(recording.commands).all()
    assert np.isfinite(recording.qpos).all()
    np.testing.assert_array_equal(recording.commands[:130], whole.commands[:130])
    assert (recording.commands[140:] != whole.commands[140:]).any()
    missing = recording.columns()["input_missing"]
    np.testing.assert_array_equal(missing.nonzero()[0], range(130, 140))


def test_a_fault_of_one_robot_does_not_touch_the_others():
    setup = plan().setup("circuit", TRIALS)
    factors = np.ones((3, 8))
    factors[1, 2] = np.nan
    recording = run_loop(replace(setup, cell_factors=dict.fromkeys(range(125, 160), factors)))
    assert np.isnan(recording.observations[125:160, 1]).any(axis=1).all()
    for name in ("readings", "qpos", "commands", "trace", "observations"):
        found, whole = getattr(recording, name)[:, [0, 2]], getattr(batch(), name)[:, [0, 2]]
        np.testing.assert_array_equal(found.view(np.int64), whole.view(np.int64))
    held = recording.commands[125:160, 1]
    np.testing.assert_array_equal(held, np.repeat(recording.commands[124:125, 1], 35, axis=0))


def test_a_dead_cell_reads_zero_and_the_circuit_goes_on_with_it():
    recording = walk_alone(plan_of(duration=0.6, faults=(fault("LFsrFL", "zero", 0.2, 0.1),)))
    assert not np.isnan(recording.observations).any()
    zmp = recording.observations[..., list(recording.observation_names).index("zmp_y")]
    assert zmp[25, 0] < zmp[15, 0] - 0.002
    assert not recording.columns()["input_missing"].any()


def test_ctrl_c_keeps_what_was_recorded():
    def stop(done):
        if done == 120:
            raise KeyboardInterrupt

    setup = plan().setup("circuit", TRIALS)
    recording = run_loop(setup, stop)
    assert recording.interrupted
    assert recording.ticks == 120
    for name in ("readings", "qpos", "observations", "commands", "trace"):
        np.testing.assert_array_equal(getattr(recording, name), getattr(batch(), name)[:120])
    assert not batch().interrupted


def test_progress_is_told_how_much_is_done():
    told = []
    run_loop(plan_of(duration=1.0).setup("open_loop", [Trial(0, ())]), told.append)
    assert told == [20, 40, 60, 80, 100]
