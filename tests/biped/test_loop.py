"""The closed loop of a walk: the same to the bit for any batch, threads and names; faults, falls, Ctrl-C."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from biped.made_up import EDGES, judged
from biped.made_up import recording as made_up
from biped.nao_files import renamed_robot
from walking import (
    a_push,
    assert_same_bits,
    fault,
    known_of,
    nao,
    nao_body,
    plan_of,
    view_of,
    walk_all,
    walk_alone,
)

from circuitkit import parse_circuit
from circuitkit.biped.anatomy import ForceCells
from circuitkit.robots import load_robot
from circuitkit.simulation import RunSpec
from circuitkit.simulation.disturbances.body import Body
from circuitkit.simulation.disturbances.delay import Delay
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.disturbances.slope import Slope
from circuitkit.simulation.effects import Hook
from circuitkit.simulation.loop import run_and_watch, run_loop

JITTER, NOISE = Jitter(start=0.02, velocity=0.01), Noise(channel="*Fsr*", std="0.2 N")
SPECS = (
    RunSpec(4, (JITTER, NOISE, a_push(force=12.0))),
    RunSpec(
        5, (JITTER, NOISE, a_push(force=9.0, direction="outward"), a_push(body="Head", force=2.0, step=1))
    ),
    RunSpec(6, (JITTER, NOISE)),
)


@cache
def plan():
    """A march of 2.6 s, under the circuit."""
    return plan_of(duration=2.6)


@cache
def batch():
    """Three robots that are pushed differently."""
    return run_loop(setup_of(SPECS), threads=2)


def setup_of(specs, controller="circuit"):
    return plan().setup(plan().controller(controller), specs)


# --- the same to the bit ------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", range(3))
def test_a_robot_alone_does_what_it_does_in_a_batch(robot):
    alone = run_loop(setup_of(SPECS[robot : robot + 1]))
    assert_same_bits(batch(), alone, [robot])


def test_the_number_of_threads_changes_nothing():
    assert_same_bits(batch(), run_loop(setup_of(SPECS), threads=1), range(3))


def test_the_same_again_is_the_same_again():
    setup = setup_of(SPECS)
    assert_same_bits(run_loop(setup), run_loop(setup), range(3))


def test_the_robots_of_the_batch_did_different_things():
    last = batch().qpos[-1]
    assert np.abs(np.diff(last, axis=0)).max(axis=1).min() > 1e-4
    assert not np.isnan(batch().observations).any()


def test_a_nao_with_other_names_needs_only_another_robot_file(tmp_path):
    """Every body, joint, site and geom of the MJCF is called something else; the same happens to the bit."""
    path = renamed_robot(tmp_path)
    other_file = path.with_name("other.xml").read_text(encoding="utf-8")
    assert not any(f'"{name}"' in other_file for name in (*nao().names("actuator"), "torso", "l_ankle"))
    same, other = plan_of(duration=1.8), plan_of(duration=1.8, robot=str(path))
    np.testing.assert_array_equal(other.body.motion.targets, same.body.motion.targets)
    recording = walk_all(other, "circuit", SPECS[:1])
    assert_same_bits(walk_all(same, "circuit", SPECS[:1]), recording)
    assert np.abs(recording.push_n).max() == 12.0


def test_a_robot_file_may_have_sensors_of_its_own_names(tmp_path):
    """The force cells are named by the robot file alone."""
    path = renamed_robot(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace("LFsr", "Links"), encoding="utf-8")
    assert list(load_robot(path).biped.feet.left.cells) == ["LinksFL", "LinksFR", "LinksRL", "LinksRR"]
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
    plan = plan_of(str(tmp_path / "moving.yaml"), duration=1.0, disturbances=[NOISE])
    recording = walk_alone(plan)
    assert recording.observation_names == ("zmp_y", "gyro_x", "com_velocity_y")
    for i, name in enumerate(recording.observation_names):
        read, true = recording.observations[1:, :, i], recording.channel(name)[:-1]
        assert np.array_equal(read, true) == (name != "zmp_y")
        assert np.ptp(read) > 1e-3


def test_the_controller_reads_noise_and_the_robot_does_not():
    """The open loop is not touched by noise; what the circuit reads is."""
    quiet, noisy = plan_of(duration=1.0), plan_of(duration=1.0, disturbances=[NOISE])
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
    noise = Noise(std={"com": "2 mm", "com_velocity": "3 cm/s"})
    recording = walk_alone(plan_of(parse_circuit(text, "edges.yaml"), duration=1.0, disturbances=[noise]))
    for i, (name, deviation) in enumerate((("zmp_y", 0.0), ("com_y", 0.002), ("com_velocity_y", 0.03))):
        read, true = recording.observations[1:, :, i], recording.channel(name)[:-1]
        assert (read - true).std() == pytest.approx(deviation, rel=0.25)


def test_cells_read_no_less_and_no_more_than_their_range():
    """With 300 N of noise none reads less than 0, so the ZMP stays in their hull.

    Cells that can show 1 N at most all show that while the robot stands, so the ZMP is their mean.
    """
    loud = Noise(channel="*Fsr*", std="300 N")
    recording = walk_alone(plan_of(duration=0.5, disturbances=[loud]))
    zmp = list(recording.observation_names).index("zmp_y")
    assert np.abs(recording.observations[..., zmp]).max() <= 0.0799 + 1e-12

    file = load_robot("nao")
    biped = file.biped.model_copy(update={"force_cells": ForceCells(range=(0.0, 1.0))})
    recording = walk_alone(plan_of(duration=0.5))
    weak = walk_alone(plan_of(duration=0.5, robot=file.model_copy(update={"biped": biped})))
    assert np.abs(weak.observations[10:40, 0, zmp]).max() < 1e-12 < np.abs(recording.observations[40, 0, zmp])


def test_robots_start_with_the_velocity_that_was_drawn():
    """Standing legs take a part of it within the first tick."""
    specs = [RunSpec(seed, (Jitter(velocity=0.05),)) for seed in range(12)]
    recording = walk_all(plan_of(duration=0.02), "open_loop", specs)
    generators = [np.random.default_rng(seed) for seed in range(12)]
    drawn = np.array([(each.uniform(0, 0), each.normal(0.0, 0.05, 2))[1] for each in generators])
    found = view_of(recording).com_velocity[0, :, :2]
    for axis in (0, 1):
        assert np.corrcoef(drawn[:, axis], found[:, axis])[0, 1] > 0.95
        assert 0.2 < np.polyfit(drawn[:, axis], found[:, axis], 1)[0] < 1.1


def test_commands_turn_the_ankles():
    """What the circuit writes arrives at the robot: with it the joints differ, and by as much."""
    recording = walk_alone(plan_of(duration=2.4, disturbances=(a_push(force=14.0),)))
    without = walk_alone(plan_of(duration=2.4, disturbances=(a_push(force=14.0),)), "open_loop")
    first = int(np.flatnonzero(np.abs(recording.commands[:, 0, 0]) > 1e-2)[0])
    np.testing.assert_allclose(recording.qpos[: first - 20], without.qpos[: first - 20], atol=5e-3)
    place = recording.joints["LAnkleRoll"][0]
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
    pushed, calm = (
        walk_alone(plan_of(duration=2.0, disturbances=pushes), "open_loop") for pushes in ((push,), ())
    )
    after = round(pushed.effects.windows_s[0, 1] / 0.01) + 1
    faster = (view_of(pushed).com_velocity - view_of(calm).com_velocity)[after, 0]
    assert 0.6 < faster[1] / (60 * 0.02 / nao().mass_kg) < 1.0
    assert abs(faster[0]) < 0.03
    np.testing.assert_array_equal(pushed.qpos[: after - 5], calm.qpos[: after - 5])


def test_a_push_above_the_centre_of_mass_turns_the_torso_over():
    """To the left: about -x, the more the higher it acts; the force is the same."""
    rates, forces = [], []
    for height in (0.0, 0.08):
        push = a_push(force=30.0, duration=0.02, direction="90 deg", height=height)
        recording = walk_alone(plan_of(duration=1.4, disturbances=(push,)), "open_loop")
        after = round(recording.effects.windows_s[0, 1] / 0.01)
        rates.append(recording.channel("gyro_x")[after, 0])
        forces.append(recording.push_n)
    assert rates[1] < rates[0] - 0.05
    np.testing.assert_array_equal(*forces)


# --- robots that differ from what is known of them ----------------------------------------------------------


def test_a_heavier_robot_is_simulated_and_neither_walk_nor_controller_know():
    plain = plan_of(duration=1.2)
    other = plan_of(duration=1.2, disturbances=[Body(mass=1.1), Slope(left=np.radians(2))])
    np.testing.assert_array_equal(other.body.motion.targets, plain.body.motion.targets)
    np.testing.assert_array_equal(known_of(other).walk.pelvis_m, known_of(plain).walk.pelvis_m)
    assert other.robot.mass_kg == plain.robot.mass_kg
    recording = walk_alone(other)
    assert recording.robot.mass_kg == pytest.approx(1.1 * plain.robot.mass_kg)
    assert recording.channel("load")[100, 0] == pytest.approx(1.1 * plain.robot.mass_kg * 9.81, rel=0.02)
    assert np.abs(recording.qpos - walk_alone(plain).qpos).max() > 1e-3


# --- falling ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degrees", "height_m", "falls"),
    [(0, 0.27, False), (44, 0.27, False), (46, 0.27, True), (0, 0.17, False), (0, 0.15, True)],
)
def test_fallen_is_who_leans_beyond_45_degrees_or_lies(degrees, height_m, falls):
    """The shipped scenario: upright < 0.7 or com_z < 0.6 * first(com_z)."""
    readings = made_up(lean_deg={3: degrees}, ticks=6).readings
    readings[3:, 0, nao_body().layout.com.start + 2] = height_m
    found = judged(readings, (RunSpec(0),))
    assert found.measures[0]["survived"] is not falls
    assert found.measures[0]["time_of_fall_s"] == (pytest.approx(0.04) if falls else None)


HARD = a_push(force=60.0, duration=0.3, direction="forward")


def test_a_run_ends_soon_after_all_have_fallen_and_not_before():
    one = plan_of(duration=6.0)
    recording = walk_all(one, "open_loop", [RunSpec(0, (HARD,))])
    fallen = int(recording.end_tick[0])
    assert fallen > 0
    assert 60 <= recording.ticks - fallen <= 85
    assert recording.ticks < 400
    both = walk_all(one, "open_loop", [RunSpec(0, (HARD,)), RunSpec(0)])
    assert both.ticks == 600
    assert_same_bits(both, recording, [0])


def test_who_has_fallen_is_stepped_no_further_if_only_the_measures_count():
    """The others go on to the same bits; the fallen one stays where it was within 20 ticks of its fall."""
    specs = [RunSpec(0), RunSpec(0, (HARD,)), RunSpec(1)]
    seen = []
    watch = Hook(0, 260, lambda _, worlds: seen.append(worlds.readings.copy()))
    setup = setup_of(specs)
    setup.effects.on_worlds.append(watch)
    watched = run_and_watch(setup)
    recording = run_loop(setup_of(specs))
    assert watched.measures() == recording.measures
    np.testing.assert_array_equal(watched.end_tick, recording.end_tick)
    before = np.array(seen)  # of each tick
    np.testing.assert_array_equal(before[1:, [0, 2]], recording.readings[:-1, [0, 2]])
    fall = int(recording.end_tick[1])
    still = np.flatnonzero((np.diff(before[:, 1], axis=0) == 0).all(axis=1))
    assert fall < still[0] <= fall + 21
    np.testing.assert_array_equal(still, np.arange(still[0], len(before) - 1))
    np.testing.assert_array_equal(before[1 : still[0], 1], recording.readings[: still[0] - 1, 1])


# --- old readings -------------------------------------------------------------------------------------------


def test_a_delay_shifts_what_is_read_by_whole_ticks_and_nothing_else():
    """Under a circuit without outputs that matter the robot does the same, so every reading is just older."""
    text = EDGES.replace("readout: {out: 1 deg}", "readout: {out: 0 deg}")
    for ticks, delay in ((1, 0.01), (3, 0.03)):
        now, later = (idle_reader(text, delay=each) for each in (0.0, delay))
        np.testing.assert_array_equal(later.qpos, now.qpos)
        np.testing.assert_array_equal(later.observations[ticks:], now.observations[:-ticks])
        np.testing.assert_array_equal(later.observations[:ticks], now.observations[[0] * ticks])
        assert np.ptp(now.observations) > 1e-3


@cache
def idle_reader(text, delay):
    """A run of a circuit that reads noise and commands nothing."""
    befalling = [NOISE, fault("LFsrFL", "zero", 0.3, 0.2), Delay(channel="*", by=delay)]
    return walk_alone(plan_of(parse_circuit(text, "edges.yaml"), duration=0.8, disturbances=befalling))


def test_a_missing_reading_arrives_late_as_well():
    broken = fault("LFsrFL", "missing", 0.3, 0.1)
    recording = walk_alone(plan_of(duration=0.6, disturbances=[broken, Delay(channel="*", by=0.02)]))
    missing = np.isnan(recording.observations).any(axis=(1, 2))
    np.testing.assert_array_equal(missing.nonzero()[0], range(32, 42))


# --- missing readings and interruptions ---------------------------------------------------------------------


def test_a_missing_cell_holds_the_command_and_the_run_goes_on():
    """A cell fails during a push; until it is back the ankle stays where it was."""
    push, broken = a_push(force=14.0, at=0.2), fault("LFsrFL", "missing", 1.3, 0.1)
    recording = walk_alone(plan_of(duration=2.4, disturbances=(push, broken)))
    whole = walk_alone(plan_of(duration=2.4, disturbances=(push,)))
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
    setup = setup_of(SPECS)
    column = nao_body().layout.forces.start + 2

    def break_one(_, readings):
        readings[1, column] = np.nan

    setup.effects.on_clipped.append(Hook(125, 160, break_one))
    recording = run_loop(setup)
    assert np.isnan(recording.observations[125:160, 1]).any(axis=1).all()
    for name in ("readings", "qpos", "commands", "trace", "observations"):
        found, whole = getattr(recording, name)[:, [0, 2]], getattr(batch(), name)[:, [0, 2]]
        np.testing.assert_array_equal(found.view(np.int64), whole.view(np.int64))
    held = recording.commands[125:160, 1]
    np.testing.assert_array_equal(held, np.repeat(recording.commands[124:125, 1], 35, axis=0))


def test_a_dead_cell_reads_zero_and_the_circuit_goes_on_with_it():
    recording = walk_alone(plan_of(duration=0.6, disturbances=(fault("LFsrFL", "zero", 0.2, 0.1),)))
    assert not np.isnan(recording.observations).any()
    zmp = recording.observations[..., list(recording.observation_names).index("zmp_y")]
    assert zmp[25, 0] < zmp[15, 0] - 0.002
    assert not recording.columns()["input_missing"].any()


def test_ctrl_c_keeps_what_was_recorded():
    def stop(done):
        if done == 120:
            raise KeyboardInterrupt

    setup = setup_of(SPECS)
    recording = run_loop(setup, stop)
    assert recording.interrupted
    assert recording.ticks == 120
    for name in ("readings", "qpos", "observations", "commands", "trace"):
        np.testing.assert_array_equal(getattr(recording, name), getattr(batch(), name)[:120])
    assert not batch().interrupted


def test_progress_is_told_how_much_is_done():
    told = []
    one = plan_of(duration=1.0)
    run_loop(one.setup(one.controller("open_loop"), [RunSpec(0)]), told.append)
    assert told == [20, 40, 60, 80, 100]
