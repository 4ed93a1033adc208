"""The vehicle turns away from what is near, on either side alike, and does not touch anything in an arena."""

from __future__ import annotations

import numpy as np
import pytest

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run
from circuitkit.simulation import load_scenario, simulate

FORWARD, BACKWARD = 6.0, 2.0
WHEEL_RADIUS_M = 0.03
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
def test_in_the_arena_of_the_vehicle_it_drives_on_and_hardly_touches_anything(seed):
    scenario = load_scenario("vehicle_avoids").model_copy(update={"duration": 30.0})
    measures = simulate(scenario, seed=seed).measures
    assert measures["survived"]
    assert measures["touched_s"] < 0.5
    assert measures["path"] > 0.6 * 30 * FORWARD * WHEEL_RADIUS_M


def test_straight_in_front_of_a_wall_noise_decides():
    program = compile_circuit(load_circuit("braitenberg_avoider"))
    ahead = program.pack_inputs({"distance_left": 0.2, "distance_right": 0.2})
    ends = run(program, np.tile(ahead, (300, 8, 1))).readout[-1]  # of eight in a batch each has its own noise
    turned_right = [bool(wheels[0] > wheels[1]) for wheels in ends]
    assert all(abs(left - right) > FORWARD for left, right in ends)
    assert True in turned_right
    assert False in turned_right
