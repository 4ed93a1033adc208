"""The predictive controller on a walk: its feedback, its lean, and each robot for itself."""

from __future__ import annotations

import re

import numpy as np
import pytest
from walking import a_push, assert_same_bits, interface_of, known_of, plan_of, walk_all

from circuitkit.base.errors import InputError
from circuitkit.control import load_controller
from circuitkit.simulation import RunSpec

NAMES = ("mpc", "mpc_full")
EXACT = {"walk_delay": "0 s", "walk_sway": "100 %"}


@pytest.fixture(scope="module")
def reference():
    return known_of(plan_of(duration=2.5))


def build(reference, name="mpc_full", **changes):
    return load_controller(name, EXACT | changes).bind(interface_of(reference))


def on_plan(reference, tick, com=0.0, velocity=0.0):
    """What a robot senses that is on its plan, but for an error of its CoM."""
    middle = reference.ankles_m[tick, :, 1].mean()
    return np.array(
        [
            [
                reference.com_m[tick, 1] - middle + com,
                reference.com_velocity[tick, 1] + velocity,
                reference.feet_apart_m[tick, 1],
            ]
        ]
    )


def run(controller, rows):
    trace = np.zeros((len(rows[0]), len(controller.trace_names)))
    steps = []
    for row in rows:
        commands = controller.step(row).copy()
        controller.store_trace(trace)
        steps.append((commands, trace.copy()))
    return tuple(np.array(each) for each in zip(*steps, strict=True))


def test_on_the_plan_it_adds_nothing_and_wants_the_planned_zmp_within_the_soles(reference):
    controller = build(reference)
    ticks = range(200)
    commands, trace = run(controller, [on_plan(reference, tick) for tick in ticks])
    np.testing.assert_allclose(commands, 0.0, atol=1e-9)
    com, zmp, _ = trace[:, 0].T
    np.testing.assert_allclose(com, reference.com_m[1:201, 1], atol=4e-3)
    assert (zmp >= reference.low_m[1:201, 1] - 1e-9).all()
    assert (zmp <= reference.high_m[1:201, 1] + 1e-9).all()


def test_pushed_to_the_left_it_leans_to_the_right_within_its_limit(reference):
    commands, trace = run(build(reference), [on_plan(reference, 0, com=0.01)])
    limit = load_controller("mpc_full").limit
    assert -limit <= commands[0, 0, 0] < 0.0
    assert trace[0, 0, 1] > reference.zmp_m[1, 1]
    far, _ = run(build(reference, limit="3 deg"), [on_plan(reference, 0, com=0.05)])
    assert far[0, 0, 0] == pytest.approx(-np.radians(3.0))


def test_left_and_right_are_alike(reference):
    """Standing, before the first step is in the preview."""
    rows = ([on_plan(reference, 0, sign * 0.008, sign * 0.05)] for sign in (1.0, -1.0))
    changes = {"preview_step": "10 ms", "preview_steps": 50}
    left, right = (run(build(reference, **changes), row)[0][0, 0, 0] for row in rows)
    assert left == pytest.approx(-right, abs=1e-9)
    assert abs(left) > 0.01


def test_a_robot_that_is_lost_is_left_to_its_walk(reference):
    commands, _ = run(build(reference), [on_plan(reference, 0, com=0.5)])
    assert commands[0, 0, 0] == 0.0


def test_a_missing_reading_gives_no_command_and_leaves_others_alone(reference):
    controller = build(reference)
    controller.reset(2)
    rows = [np.repeat(on_plan(reference, tick, com=0.0005 * (tick + 1)), 2, axis=0) for tick in range(7)]
    rows[6][0, 1] = np.nan
    commands, _ = run(controller, rows)
    assert np.argwhere(~np.isfinite(commands)).tolist() == [[6, 0, 0]]
    assert commands[6, 1, 0] != commands[5, 1, 0]


def test_a_gain_of_zero_never_moves(reference):
    controller = build(reference, position_gain="0 %", velocity_gain="0 %")
    commands, _ = run(controller, [on_plan(reference, tick, com=0.02) for tick in range(20)])
    assert (commands == 0.0).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"preview_step": "15 ms", "preview_steps": 50},
            "mpc_full: preview_step: found 15 ms; allowed: a multiple of the walk's control step, 10 ms",
        ),
        (
            {"margin": "50 mm"},
            "mpc_full: margin: found 50 mm; allowed: at most 41.0 mm, the planned ZMP's",
        ),
    ],
)
def test_what_does_not_fit_the_walk_is_told(reference, changes, message):
    with pytest.raises(InputError, match=re.escape(message)):
        build(reference, **changes)


def test_a_preview_that_costs_digits_is_refused():
    with pytest.raises(InputError, match="preview_steps of preview_step are 4 s; allowed: up to 2 s"):
        load_controller("mpc", {"preview_step": "20 ms", "preview_steps": 200})


@pytest.mark.parametrize("name", NAMES)
def test_a_robot_is_simulated_to_the_same_bits_in_every_batch(name):
    plan = plan_of(duration=1.6)
    specs = [RunSpec(seed, (a_push(force=force, at=0.1),)) for seed, force in ((100, 0.0), (101, 12.0))]
    together = walk_all(plan, name, specs)
    alone = walk_all(plan, name, specs[1:])
    assert_same_bits(together, alone, (1,))
    assert np.abs(alone.commands).max() > np.radians(0.5)


def test_it_holds_forward_as_well_as_sideways():
    """Both axes on a walk: pushed forward by what makes it lean, it comes back."""
    plan = plan_of(gait="gait_walk_2cm", duration=3.0)
    spec = load_controller("mpc_full", {"axes": ["lateral", "sagittal"]})
    push = a_push(force=12.0, direction="forward", at=0.1)
    recording = walk_all(plan, spec, [RunSpec(100, (push,))])
    assert recording.command_names == ("ankle_roll", "ankle_pitch")
    assert np.abs(recording.commands[:, 0, 1]).max() > np.radians(1.0)
    assert recording.channel("upright")[-1, 0] > 0.95
