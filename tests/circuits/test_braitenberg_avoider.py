"""The vehicle turns away from what is near, on either side alike, and does not touch anything in an arena."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

ARENA = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "avoid_the_walls.py"))
FORWARD, BACKWARD = 6.0, 2.0
CALM = {"near_left.noise": "0 cm", "near_right.noise": "0 cm"}


@pytest.fixture(scope="module")
def program():
    return compile_circuit(load_circuit("braitenberg_avoider", CALM))


def _wheels(program, left_m, right_m, steps=60):
    """Speeds of the left and the right wheel, [rad/s], after both distances were held."""
    inputs = program.pack_inputs({"distance_left": left_m, "distance_right": right_m})
    trace = run(program, np.tile(inputs, (steps, 1, 1)))
    return [trace.readout[-1, 0, program.output_index[f"wheel_{side}"]] for side in ("left", "right")]


def test_there_are_no_errors_and_no_warnings():
    assert check("braitenberg_avoider") == ((), ())


def test_with_nothing_near_it_drives_straight_on(program):
    """Each motor neuron says sigmoid(5) = 0.99331."""
    assert _wheels(program, 1.0, 1.0) == pytest.approx([0.99331 * FORWARD] * 2, rel=1e-4)


@pytest.mark.parametrize("far", [0.5, 1.0])
@pytest.mark.parametrize("near", [0.05, 0.1, 0.2])
def test_it_turns_away_from_the_nearer_side(program, near, far):
    left, right = _wheels(program, near, far)
    assert left > 0.9 * FORWARD
    assert right == pytest.approx(-BACKWARD, abs=0.2 * BACKWARD)
    left, right = _wheels(program, far, near)
    assert right > 0.9 * FORWARD
    assert left == pytest.approx(-BACKWARD, abs=0.2 * BACKWARD)


def test_in_a_corner_the_nearer_side_wins_and_keeps_on_winning(program):
    """Both are near: one silences the other, and a small change of sides does not change that."""
    approach = np.tile(program.pack_inputs({"distance_left": 0.14, "distance_right": 0.16}), (60, 1, 1))
    turning = np.tile(program.pack_inputs({"distance_left": 0.16, "distance_right": 0.14}), (60, 1, 1))
    readout = run(program, np.concatenate([approach, turning])).readout[:, 0]
    for step in (59, 119):
        left, right = readout[step]
        assert left > 0.9 * FORWARD
        assert right < 0


def test_the_mirror_image_gives_the_mirror_image(program):
    distances = np.random.default_rng(0).uniform(0, 1, (200, 1, 2))
    one, other = run(program, distances).readout, run(program, distances[..., ::-1].copy()).readout
    np.testing.assert_allclose(one[:, 0], other[:, 0, ::-1], atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_in_an_arena_it_drives_on_and_touches_nothing(seed):
    path = ARENA["drive"](30.0, (0.3, 0.3, 0.4 + seed), seed=seed)
    assert ARENA["clearance_m"](path) > ARENA["AXLE_M"] / 2
    length = np.hypot(*np.diff(path[-1000:, :2], axis=0).T).sum()
    assert length > 0.6 * 10 * FORWARD * ARENA["WHEEL_RADIUS_M"]


def test_straight_in_front_of_a_wall_noise_decides():
    ends = [ARENA["drive"](8.0, (1.0, 0.4, -math.pi / 2), seed=seed)[-1] for seed in range(4)]
    assert all(abs(math.remainder(heading + math.pi / 2, 2 * math.pi)) > 0.5 for *_, heading in ends)
