"""Pushes, noise and faults as arrays: impulses to the last newton second, chance from the seed alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walking import a_push, fault, nao

from circuitkit.base.errors import InputError
from circuitkit.biped.gait import LEFT, RIGHT, load_gait, plan_walk
from circuitkit.biped.gait.schedule import EXTEND, LIFT, TRANSFER
from circuitkit.simulation.disturbance import (
    Trial,
    delay_ticks,
    direction_of,
    draw_fates,
    fault_values,
    push_start,
)
from circuitkit.simulation.scenario import Fault, Jitter, SensorNoise

LEGS = nao().spec.legs.geometry()
WALK = plan_walk(load_gait("gait_march"), LEGS, 400)[0]  # 1 s of standing, then five steps and a half
CALM = Jitter()
JITTER = Jitter.model_validate({"push_start": "20 ms", "base_velocity": "1 cm/s"})


def fates(*trials, jitter=CALM, noise_n=0.0, walk=WALK, **others):
    return draw_fates(trials, walk, nao(), jitter, SensorNoise(force_cells=f"{noise_n} N", **others))


def pushed(*pushes, seed=0, jitter=CALM):
    """The fate of one robot, its forces at every tick of the walk; shape (T, 3)."""
    found = fates(Trial(seed, pushes), jitter=jitter)
    forces = np.zeros((WALK.ticks + 200, 3))
    for push in found.pushes:
        forces[push.first_tick : push.first_tick + len(push.forces)] += push.forces[:, 0]
    return found, forces


# --- when ---------------------------------------------------------------------------------------------------


def test_a_push_starts_by_the_gait():
    """Step k begins at 1 + 0.55 k seconds; 5 ticks of transfer, then lift and extend share the rest."""
    transfer, support = push_start(a_push(step=2, at=0.0), WALK)
    lift = int((WALK.schedule.phase[WALK.schedule.step == 0] == LIFT).sum())
    assert support == LEFT
    assert transfer == pytest.approx(1 + 2 * 0.55 + 0.05)
    middle, _ = push_start(a_push(step=2, at=0.5), WALK)
    assert middle == pytest.approx(transfer + lift * 0.01 / 2)
    assert push_start(a_push(step=3, at=0.5), WALK) == (pytest.approx(middle + 0.55), RIGHT)


@pytest.mark.parametrize(("phase", "number"), [("transfer", TRANSFER), ("lift", LIFT), ("extend", EXTEND)])
def test_a_push_starts_within_its_phase(phase, number):
    push = a_push(step=3)
    start = push.start.model_copy(update={"phase": phase, "at": 0.3})
    moment, _ = push_start(push.model_copy(update={"start": start}), WALK)
    tick = int(moment / 0.01 + 1e-9)
    assert (WALK.schedule.step[tick], WALK.schedule.phase[tick]) == (3, number)


def test_a_push_starts_at_the_same_moment_in_a_walk_that_ends_within_the_phase():
    push = a_push(step=3, at=0.2)
    moment, _ = push_start(push, WALK)
    shorter, _ = plan_walk(load_gait("gait_march"), LEGS, int(moment / 0.01) + 6)
    assert push_start(push, shorter)[0] == moment


def test_a_push_after_the_end_is_refused():
    with pytest.raises(InputError) as caught:
        fates(Trial(0, (a_push(), a_push(step=9))))
    assert str(caught.value) == (
        "pushes[1].start: found step 9, and the walk ends before that 'lift'; "
        "allowed: steps 0 to 4, or a longer duration"
    )


def test_a_push_in_a_walk_without_a_step_is_refused():
    standing, _ = plan_walk(load_gait("gait_march"), LEGS, 100)
    with pytest.raises(InputError) as caught:
        fates(Trial(0, (a_push(),)), walk=standing)
    assert str(caught.value).endswith("the walk ends before that 'lift'; allowed: a longer duration")


def test_a_push_on_a_body_that_does_not_exist_is_refused():
    with pytest.raises(InputError) as caught:
        fates(Trial(0, (a_push(body="tors"),)))
    said = str(caught.value)
    assert said.startswith(
        "pushes[0].body: unknown body 'tors'; allowed: torso, left_foot, right_foot, Neck, Head, "
    )
    assert said.endswith("; did you mean 'torso'?")


# --- where to and how much ----------------------------------------------------------------------------------


def test_inward_is_towards_the_foot_in_the_air():
    """On the left foot to the right, on the right foot to the left; y points to the left."""
    np.testing.assert_array_equal(direction_of("inward", LEFT), [0, -1, 0])
    np.testing.assert_array_equal(direction_of("inward", RIGHT), [0, 1, 0])
    np.testing.assert_array_equal(direction_of("outward", LEFT), [0, 1, 0])
    np.testing.assert_array_equal(direction_of("outward", RIGHT), [0, -1, 0])


@pytest.mark.parametrize(
    ("name", "vector"),
    [("forward", [1, 0, 0]), ("backward", [-1, 0, 0]), ("left", [0, 1, 0]), ("right", [0, -1, 0])],
)
def test_other_directions_are_those_of_the_world(name, vector):
    for support in (LEFT, RIGHT, -1):
        np.testing.assert_array_equal(direction_of(name, support), vector)


@pytest.mark.parametrize(
    ("angle", "vector"),
    [
        ("0 deg", [1, 0]),
        ("90 deg", [0, 1]),
        ("-90 deg", [0, -1]),
        ("30deg", [0.75**0.5, 0.5]),
        ("1 rad", [np.cos(1), np.sin(1)]),
    ],
)
def test_an_angle_goes_from_forward_to_the_left(angle, vector):
    np.testing.assert_allclose(direction_of(angle, LEFT), [*vector, 0], atol=1e-15)


@given(
    force=st.floats(1, 60),
    height=st.floats(-0.2, 0.2),
    direction=st.sampled_from(["inward", "forward", "37 deg", "-100 deg"]),
)
def test_a_push_above_the_centre_of_mass_has_the_torque_of_its_lever(force, height, direction):
    """Force and torque together are a force along a line so far above; another one at the centre adds up."""
    low = a_push(force=5.0, direction="left")
    (push,) = fates(Trial(0, (low, a_push(force=force, height=height, direction=direction)))).pushes
    away = 0.2 * force * direction_of(direction, LEFT)
    np.testing.assert_allclose(push.forces[:, 0].sum(axis=0) * 0.01, away + np.array([0, 1, 0]), atol=1e-9)
    turn = np.zeros((1, 3)) if push.torques is None else push.torques[:, 0].sum(axis=0) * 0.01
    np.testing.assert_allclose(np.squeeze(turn), [-height * away[1], height * away[0], 0], atol=1e-9)
    assert (push.torques is None) == (height == 0)
    assert push.torques is None or not push.torques[-1].any()


@given(
    force=st.floats(0, 60),
    duration=st.floats(1e-4, 1.5),
    at=st.floats(0, 1),
    seed=st.integers(0, 10_000),
    direction=st.sampled_from(["inward", "outward", "forward", "left"]),
)
def test_the_impulse_is_force_times_duration_wherever_it_starts(force, duration, at, seed, direction):
    """Also where start and end lie within a tick; and no tick has more than the force."""
    push = a_push(force=force, duration=duration, at=at, step=1, direction=direction)
    found, forces = pushed(push, seed=seed, jitter=JITTER)
    impulse = forces.sum(axis=0) * 0.01
    np.testing.assert_allclose(impulse, force * duration * direction_of(direction, RIGHT), atol=1e-9)
    assert np.abs(forces).max() <= force * (1 + 1e-12)
    start, end = found.windows_s[0]
    assert end - start == pytest.approx(duration)
    active = np.flatnonzero(np.abs(forces).sum(axis=1) > force * 1e-6)
    if force > 0 and len(active):
        assert active[0] >= int(start / 0.01) - 1
        assert active[-1] <= int(end / 0.01) + 1
    assert not found.pushes[0].forces[-1].any()  # the push is taken off again


def test_the_start_moves_by_no_more_than_the_jitter():
    starts = [pushed(a_push(step=1), seed=seed, jitter=JITTER)[0].windows_s[0, 0] for seed in range(200)]
    middle, _ = push_start(a_push(step=1), WALK)
    assert np.abs(np.array(starts) - middle).max() <= 0.02
    assert np.std(starts) == pytest.approx(0.04 / np.sqrt(12), rel=0.15)  # uniform


def test_several_pushes_add_up():
    one, two = a_push(force=10.0), a_push(force=3.0, direction="forward", duration=0.1)
    head = a_push(body="Head", force=2.0, step=1)
    found, forces = pushed(one, two, head)
    assert len(found.pushes) == 2  # two bodies
    np.testing.assert_allclose(forces.sum(axis=0) * 0.01, [0.3, -2.0 + 0.4, 0.0], atol=1e-12)
    start, _ = push_start(one, WALK)
    np.testing.assert_allclose(found.windows_s[0], [start, start + 0.2])


def test_without_a_push_there_is_no_window():
    found = fates(Trial(0, ()), Trial(1, (a_push(),)))
    assert np.isnan(found.windows_s[0]).all()
    assert np.isfinite(found.windows_s[1]).all()
    assert not found.pushes[0].forces[:, 0].any()


# --- chance -------------------------------------------------------------------------------------------------


def test_everything_random_comes_from_the_seed():
    first, again, other = (fates(Trial(seed, (a_push(),)), jitter=JITTER, noise_n=0.2) for seed in (7, 7, 8))
    for name in ("windows_s", "base_velocity", "cell_noise"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
        assert (getattr(first, name) != getattr(other, name)).any()


def test_a_robot_draws_the_same_alone_and_in_any_batch():
    trials = [Trial(seed, (a_push(force=float(seed)),)) for seed in (3, 1, 4, 1)]
    batch = fates(*trials, jitter=JITTER, noise_n=0.2)
    for i, trial in enumerate(trials):
        alone = fates(trial, jitter=JITTER, noise_n=0.2)
        np.testing.assert_array_equal(alone.windows_s[0], batch.windows_s[i])
        np.testing.assert_array_equal(alone.base_velocity[0], batch.base_velocity[i])
        np.testing.assert_array_equal(alone.cell_noise[:, 0], batch.cell_noise[:, i])
        (mine,), (all_,) = alone.pushes, batch.pushes
        offset = mine.first_tick - all_.first_tick
        here = all_.forces[offset : offset + len(mine.forces), i]
        np.testing.assert_array_equal(mine.forces[: len(here), 0], here)
        assert not all_.forces[:offset, i].any()
        assert not all_.forces[offset + len(here) :, i].any()


def test_a_longer_run_begins_as_a_shorter_one():
    shorter, _ = plan_walk(load_gait("gait_march"), LEGS, 150)
    long, short = (fates(Trial(5, ()), jitter=JITTER, noise_n=0.2, walk=walk) for walk in (WALK, shorter))
    np.testing.assert_array_equal(long.cell_noise[:150], short.cell_noise)
    np.testing.assert_array_equal(long.base_velocity, short.base_velocity)


def test_noise_is_white_and_as_large_as_it_says():
    noise = fates(*(Trial(seed, ()) for seed in range(20)), noise_n=0.2).cell_noise
    assert noise.shape == (400, 20, 8)
    assert noise.std() == pytest.approx(0.2, rel=0.01)
    assert abs(noise.mean()) < 0.003
    neighbours = (noise[1:] * noise[:-1]).mean() / noise.var()
    assert abs(neighbours) < 0.02
    robots = np.corrcoef(noise.reshape(400, 20, 8)[:, :, 0].T)
    assert np.abs(robots - np.eye(20)).max() < 0.25


def test_noise_of_the_com_is_white_in_place_and_speed_and_changes_nothing_else():
    trials = [Trial(seed, ()) for seed in range(20)]
    found = fates(*trials, jitter=JITTER, noise_n=0.2, com="1 mm", com_velocity="1 cm/s")
    plain = fates(*trials, jitter=JITTER, noise_n=0.2)
    np.testing.assert_allclose(found.com_noise.std(axis=(0, 1)), [1e-3] * 3 + [1e-2] * 3, rtol=0.03)
    flat = found.com_noise.reshape(-1, 6)
    others = found.cell_noise.reshape(len(flat), 8)
    assert np.abs(np.corrcoef(np.hstack([flat, others]).T) - np.eye(14)).max() < 0.05
    np.testing.assert_array_equal(found.cell_noise, plain.cell_noise)
    np.testing.assert_array_equal(found.base_velocity, plain.base_velocity)
    slow = fates(*trials, com="1 mm").com_noise
    np.testing.assert_array_equal(slow[..., :3], found.com_noise[..., :3])
    assert not slow[..., 3:].any()
    (alone,) = fates(Trial(7, ()), com="1 mm").com_noise.transpose(1, 0, 2)
    np.testing.assert_array_equal(alone, slow[:, 7])


def test_without_noise_nothing_is_drawn():
    found = fates(Trial(3, ()))
    assert found.cell_noise is None
    assert found.com_noise is None
    np.testing.assert_array_equal(found.base_velocity, 0.0)


def test_velocities_have_the_deviation_asked_for():
    velocity = fates(*(Trial(seed, ()) for seed in range(400)), jitter=JITTER).base_velocity
    np.testing.assert_allclose(velocity.std(axis=0), 0.01, rtol=0.15)


# --- faults -------------------------------------------------------------------------------------------------


def test_a_fault_covers_its_ticks_and_its_cell():
    factors = fault_values(
        [fault("RFsrFR", "missing", 1.0, 0.05), fault("LFsrFL", "zero", 1.03, 0.04)], WALK, nao()
    )
    assert sorted(factors) == list(range(100, 107))
    assert np.isnan(factors[104][5])
    assert factors[104][0] == 0
    assert factors[106][0] == 0
    assert factors[106][5] == 1
    np.testing.assert_array_equal(factors[100][:5], 1)


def test_a_fault_ends_with_the_walk():
    factors = fault_values([fault(start=3.9, duration=9.0)], WALK, nao())
    assert sorted(factors) == list(range(390, 400))


def test_a_dead_cell_is_dead_from_the_first_tick_to_the_last():
    factors = fault_values([Fault(cell="LFsrRL", reading="zero")], WALK, nao())
    assert sorted(factors) == list(range(WALK.ticks))
    np.testing.assert_array_equal([factors[0], factors[399]], [[1, 1, 0, 1, 1, 1, 1, 1]] * 2)


def test_a_delay_is_a_whole_number_of_control_steps():
    assert [delay_ticks(delay, WALK) for delay in (0.0, 0.01, 0.03, 0.29)] == [0, 1, 3, 29]
    with pytest.raises(InputError) as caught:
        delay_ticks(0.025, WALK)
    assert str(caught.value) == (
        "sensor_delay: found 25 ms; allowed: a multiple of the control step of 10 ms"
    )


def test_a_fault_on_a_cell_that_does_not_exist_is_refused():
    with pytest.raises(InputError) as caught:
        fault_values([fault(), fault("LFsrXX")], WALK, nao())
    assert str(caught.value) == (
        "faults[1].cell: the robot has no force cell 'LFsrXX'; allowed: LFsrFL, LFsrFR, LFsrRL, LFsrRR, "
        "RFsrFL, RFsrFR, RFsrRL, RFsrRR; did you mean 'LFsrFL'?"
    )
