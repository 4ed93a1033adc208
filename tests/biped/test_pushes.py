"""Pushes, noise and faults of a walk: impulses to the last newton second, chance from the seed alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walking import a_push, fault, nao, nao_body

from circuitkit.base.errors import InputError
from circuitkit.biped.gait import LEFT, RIGHT, load_gait, plan_walk
from circuitkit.biped.gait.schedule import EXTEND, LIFT, TRANSFER
from circuitkit.biped.references import GaitReference
from circuitkit.simulation import RunSpec
from circuitkit.simulation.disturbance import draw_effects
from circuitkit.simulation.disturbances.delay import Delay
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.disturbances.push import direction_of

LEGS = nao_body().block.legs.geometry()
TICKS = 400
REFERENCE = GaitReference(load_gait("gait_march"))
WALK = plan_walk(REFERENCE.gait, LEGS, TICKS)[0]  # 1 s of standing, then five steps and a half
JITTER, NOISE = Jitter(start=0.02, velocity=0.01), Noise(channel="*Fsr*", std="0.2 N")
CELLS = nao_body().layout.forces


def effects(*specs, ticks=TICKS):
    return draw_effects(specs, nao(), REFERENCE, ticks, 0.01)


def pushed(*pushes, seed=0, jitter=()):
    """What befalls one robot, and its forces at every tick of the walk; shape (T, 3)."""
    found = effects(RunSpec(seed, (*jitter, *pushes)))
    forces = np.zeros((TICKS + 200, 3))
    for push in found.forces:
        forces[push.first_tick : push.first_tick + len(push.forces)] += push.forces[:, 0]
    return found, forces


def push_start(push, duration_s=TICKS * 0.01):
    """When a push begins, and which way outward is."""
    moment = REFERENCE.moment(push.start, duration_s)
    return moment.time_s, moment.directions["outward"][1]


def direction(name, support):
    """A direction while a foot carries."""
    outward = np.array([0.0, {LEFT: 1.0, RIGHT: -1.0}[support], 0.0])
    return direction_of(name, SimpleNamespace(directions={"outward": outward, "inward": -outward}))


def applied(hooks, start, ticks=TICKS):
    """What hooks make of the same values in every tick; shape (T, ...)."""
    rows = np.repeat(start[np.newaxis], ticks, axis=0)
    for first, last, act in hooks:
        for tick in range(first, last):
            act(tick, rows[tick])
    return rows


def noise_of(found):
    """What is added to the readings; shape (T, B, s)."""
    return applied(found.on_readings, np.zeros((found.batch, nao().model.nsensordata)), found.ticks)


def velocity_of(found):
    """The velocity that the bases start with; shape (B, 2)."""
    worlds = SimpleNamespace(qvel=np.zeros((found.batch, nao().model.nv)))
    for act in found.at_once:
        act(worlds)
    return worlds.qvel[:, :2]


# --- when ---------------------------------------------------------------------------------------------------


def test_a_push_starts_by_the_gait():
    """Step k begins at 1 + 0.55 k seconds; 5 ticks of transfer, then lift and extend share the rest."""
    transfer, outward = push_start(a_push(step=2, at=0.0))
    lift = int((WALK.schedule.phase[WALK.schedule.step == 0] == LIFT).sum())
    assert outward == 1  # the left foot carries
    assert transfer == pytest.approx(1 + 2 * 0.55 + 0.05)
    middle, _ = push_start(a_push(step=2, at=0.5))
    assert middle == pytest.approx(transfer + lift * 0.01 / 2)
    assert push_start(a_push(step=3, at=0.5)) == (pytest.approx(middle + 0.55), -1)


@pytest.mark.parametrize(("phase", "number"), [("transfer", TRANSFER), ("lift", LIFT), ("extend", EXTEND)])
def test_a_push_starts_within_its_phase(phase, number):
    moment, _ = push_start(a_push(step=3, phase=phase, at=0.3))
    tick = int(moment / 0.01 + 1e-9)
    assert (WALK.schedule.step[tick], WALK.schedule.phase[tick]) == (3, number)


def test_a_push_starts_at_the_same_moment_in_a_walk_that_ends_within_the_phase():
    push = a_push(step=3, at=0.2)
    moment, _ = push_start(push)
    assert push_start(push, int(moment / 0.01) * 0.01 + 0.06)[0] == moment


def test_a_push_after_the_end_is_refused():
    with pytest.raises(InputError) as caught:
        effects(RunSpec(0, (a_push(), a_push(step=9))))
    assert str(caught.value) == (
        "disturbances[1].push.start: found step 9, and the walk ends before that 'lift'; "
        "allowed: steps 0 to 4, or a longer duration"
    )


def test_a_push_in_a_walk_without_a_step_is_refused():
    with pytest.raises(InputError) as caught:
        effects(RunSpec(0, (a_push(),)), ticks=100)
    assert str(caught.value).endswith("the walk ends before that 'lift'; allowed: a longer duration")


def test_a_push_on_a_body_that_does_not_exist_is_refused():
    with pytest.raises(InputError) as caught:
        effects(RunSpec(0, (a_push(body="tors"),)))
    said = str(caught.value)
    assert said.startswith(
        "disturbances[0].push.body: unknown body 'tors'; allowed: torso, left_foot, right_foot, Neck, Head, "
    )
    assert said.endswith("; did you mean 'torso'?")


# --- where to and how much ----------------------------------------------------------------------------------


def test_inward_is_towards_the_foot_in_the_air():
    """On the left foot to the right, on the right foot to the left; y points to the left."""
    np.testing.assert_array_equal(direction("inward", LEFT), [0, -1, 0])
    np.testing.assert_array_equal(direction("inward", RIGHT), [0, 1, 0])
    np.testing.assert_array_equal(direction("outward", LEFT), [0, 1, 0])
    np.testing.assert_array_equal(direction("outward", RIGHT), [0, -1, 0])


@pytest.mark.parametrize(
    ("name", "vector"),
    [
        ("forward", [1, 0, 0]),
        ("backward", [-1, 0, 0]),
        ("left", [0, 1, 0]),
        ("right", [0, -1, 0]),
        ("up", [0, 0, 1]),
        ("down", [0, 0, -1]),
    ],
)
def test_other_directions_are_those_of_the_world(name, vector):
    for support in (LEFT, RIGHT):
        np.testing.assert_array_equal(direction(name, support), vector)


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
    np.testing.assert_allclose(direction(angle, LEFT), [*vector, 0], atol=1e-15)


@given(
    force=st.floats(1, 60),
    height=st.floats(-0.2, 0.2),
    way=st.sampled_from(["inward", "forward", "37 deg", "-100 deg"]),
)
def test_a_push_above_the_centre_of_mass_has_the_torque_of_its_lever(force, height, way):
    """Force and torque together are a force along a line so far above; another one at the centre adds up."""
    low = a_push(force=5.0, direction="left")
    (push,) = effects(RunSpec(0, (low, a_push(force=force, height=height, direction=way)))).forces
    away = 0.2 * force * direction(way, LEFT)
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
    way=st.sampled_from(["inward", "outward", "forward", "left"]),
)
def test_the_impulse_is_force_times_duration_wherever_it_starts(force, duration, at, seed, way):
    """Also where start and end lie within a tick; and no tick has more than the force."""
    push = a_push(force=force, duration=duration, at=at, step=1, direction=way)
    found, forces = pushed(push, seed=seed, jitter=[JITTER])
    impulse = forces.sum(axis=0) * 0.01
    np.testing.assert_allclose(impulse, force * duration * direction(way, RIGHT), atol=1e-9)
    assert np.abs(forces).max() <= force * (1 + 1e-12)
    start, end = found.windows_s[0]
    assert end - start == pytest.approx(duration)
    active = np.flatnonzero(np.abs(forces).sum(axis=1) > force * 1e-6)
    if force > 0 and len(active):
        assert active[0] >= int(start / 0.01) - 1
        assert active[-1] <= int(end / 0.01) + 1
    assert not found.forces[0].forces[-1].any()  # the push is taken off again


def test_the_start_moves_by_no_more_than_the_jitter():
    starts = [pushed(a_push(step=1), seed=seed, jitter=[JITTER])[0].windows_s[0, 0] for seed in range(200)]
    middle, _ = push_start(a_push(step=1))
    assert np.abs(np.array(starts) - middle).max() <= 0.02
    assert np.std(starts) == pytest.approx(0.04 / np.sqrt(12), rel=0.15)  # uniform


def test_several_pushes_add_up():
    one, two = a_push(force=10.0), a_push(force=3.0, direction="forward", duration=0.1)
    head = a_push(body="Head", force=2.0, step=1)
    found, forces = pushed(one, two, head)
    assert len(found.forces) == 2  # two bodies
    np.testing.assert_allclose(forces.sum(axis=0) * 0.01, [0.3, -2.0 + 0.4, 0.0], atol=1e-12)
    start, _ = push_start(one)
    np.testing.assert_allclose(found.windows_s[0], [start, start + 0.2])


def test_without_a_push_there_is_no_window():
    found = effects(RunSpec(0), RunSpec(1, (a_push(),)))
    assert np.isnan(found.windows_s[0]).all()
    assert np.isfinite(found.windows_s[1]).all()
    assert not found.forces[0].forces[:, 0].any()


# --- chance -------------------------------------------------------------------------------------------------


def test_everything_random_comes_from_the_seed():
    first, again, other = (effects(RunSpec(seed, (JITTER, NOISE, a_push()))) for seed in (7, 7, 8))
    for drawn in (lambda found: found.windows_s, velocity_of, noise_of):
        np.testing.assert_array_equal(drawn(first), drawn(again))
        assert (drawn(first) != drawn(other)).any()


def test_a_robot_draws_the_same_alone_and_in_any_batch():
    specs = [RunSpec(seed, (JITTER, NOISE, a_push(force=float(seed)))) for seed in (3, 1, 4, 1)]
    batch = effects(*specs)
    noise, velocity = noise_of(batch), velocity_of(batch)
    for i, spec in enumerate(specs):
        alone = effects(spec)
        np.testing.assert_array_equal(alone.windows_s[0], batch.windows_s[i])
        np.testing.assert_array_equal(velocity_of(alone)[0], velocity[i])
        np.testing.assert_array_equal(noise_of(alone)[:, 0], noise[:, i])
        (mine,), (all_,) = alone.forces, batch.forces
        offset = mine.first_tick - all_.first_tick
        here = all_.forces[offset : offset + len(mine.forces), i]
        np.testing.assert_array_equal(mine.forces[: len(here), 0], here)
        assert not all_.forces[:offset, i].any()
        assert not all_.forces[offset + len(here) :, i].any()


def test_a_longer_run_begins_as_a_shorter_one():
    long, short = (effects(RunSpec(5, (JITTER, NOISE)), ticks=ticks) for ticks in (TICKS, 150))
    np.testing.assert_array_equal(noise_of(long)[:150], noise_of(short))
    np.testing.assert_array_equal(velocity_of(long), velocity_of(short))


def test_noise_is_white_as_large_as_it_says_and_in_the_cells_alone():
    readings = noise_of(effects(*(RunSpec(seed, (NOISE,)) for seed in range(20))))
    noise = readings[..., CELLS]
    assert np.count_nonzero(readings) == noise.size == 400 * 20 * 8
    assert noise.std() == pytest.approx(0.2, rel=0.01)
    assert abs(noise.mean()) < 0.003
    neighbours = (noise[1:] * noise[:-1]).mean() / noise.var()
    assert abs(neighbours) < 0.02
    robots = np.corrcoef(noise[:, :, 0].T)
    assert np.abs(robots - np.eye(20)).max() < 0.25


def test_noise_of_the_com_is_white_in_place_and_speed_and_changes_nothing_else():
    com = Noise(std={"com": "1 mm", "com_velocity": "1 cm/s"}, stream=1)
    found, plain = (
        effects(*(RunSpec(seed, (JITTER, NOISE, *more)) for seed in range(20))) for more in ((com,), ())
    )
    layout = nao_body().layout
    both = noise_of(found)
    of_com = np.concatenate([both[..., layout.com], both[..., layout.com_velocity]], axis=-1)
    np.testing.assert_allclose(of_com.std(axis=(0, 1)), [1e-3] * 3 + [1e-2] * 3, rtol=0.03)
    flat, others = of_com.reshape(-1, 6), both[..., CELLS].reshape(-1, 8)
    assert np.abs(np.corrcoef(np.hstack([flat, others]).T) - np.eye(14)).max() < 0.05
    np.testing.assert_array_equal(both[..., CELLS], noise_of(plain)[..., CELLS])
    np.testing.assert_array_equal(velocity_of(found), velocity_of(plain))
    alone = noise_of(effects(RunSpec(7, (com,))))
    np.testing.assert_array_equal(alone[:, 0, layout.com], both[:, 7, layout.com])


def test_velocities_have_the_deviation_asked_for():
    velocity = velocity_of(effects(*(RunSpec(seed, (JITTER,)) for seed in range(400))))
    np.testing.assert_allclose(velocity.std(axis=0), 0.01, rtol=0.15)


# --- faults -------------------------------------------------------------------------------------------------


def cells_under(*faults):
    """What cells that show 1 N show under faults; shape (T, 8)."""
    found = effects(RunSpec(0, faults))
    return applied(found.on_clipped, np.ones((1, nao().model.nsensordata)))[:, 0, CELLS]


def test_a_fault_covers_its_ticks_and_its_cell():
    shown = cells_under(fault("RFsrFR", "missing", 1.0, 0.05), fault("LFsrFL", "zero", 1.03, 0.04))
    np.testing.assert_array_equal(np.flatnonzero((shown != 1).any(axis=1)), range(100, 107))
    assert np.isnan(shown[104, 5])
    assert shown[104, 0] == 0
    assert shown[106, 0] == 0
    assert shown[106, 5] == 1
    np.testing.assert_array_equal(shown[100, :5], 1)


def test_a_fault_ends_with_the_walk():
    shown = cells_under(fault(start=3.9, duration=9.0))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(shown).any(axis=1)), range(390, 400))


def test_a_dead_cell_is_dead_from_the_first_tick_to_the_last():
    shown = cells_under(Fault(channel="LFsrRL", reading="zero"))
    np.testing.assert_array_equal(shown, [[1, 1, 0, 1, 1, 1, 1, 1]] * TICKS)


@pytest.mark.parametrize("by", [0.0, 0.01, 0.03, 0.29])
def test_a_delay_is_a_whole_number_of_control_steps(by):
    found = draw_effects(
        [RunSpec(0, (Delay(channel="zmp_y", by=by),))], nao(), REFERENCE, TICKS, 0.01, ["zmp_y"]
    )
    rows = np.arange(TICKS, dtype=float).reshape(-1, 1, 1)
    for tick, row in enumerate(rows):
        for hook in found.on_channels:
            hook.act(tick, row)
    np.testing.assert_array_equal(rows[:, 0, 0], np.maximum(np.arange(TICKS) - round(by / 0.01), 0))


def test_a_delay_between_control_steps_is_refused():
    with pytest.raises(InputError) as caught:
        effects(RunSpec(0, (Delay(channel="*", by=0.025),)))
    assert str(caught.value) == (
        "disturbances[0].delay.by: found 25 ms; allowed: a multiple of the control step of 10 ms"
    )


def test_a_fault_on_a_cell_that_does_not_exist_is_refused():
    with pytest.raises(InputError) as caught:
        cells_under(fault(), fault("LFsrXX"))
    said = str(caught.value)
    assert said.startswith("disturbances[1].fault.channel: unknown channel 'LFsrXX'; allowed: zmp_x, zmp_y, ")
    assert said.endswith("; did you mean 'LFsrFL'?")
