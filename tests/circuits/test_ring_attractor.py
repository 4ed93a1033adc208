"""The ring against the solution of Ben-Yishai et al. 1995: the height and width of the bump; it stays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

N = 64
ANGLES = 2 * np.pi * np.arange(N) / N


def _compiled(**changes):
    return compile_circuit(load_circuit("ring_attractor", changes))


@pytest.fixture(scope="module")
def program():
    return _compiled()


def _cued(program, angles, *, cue_steps=20, steps=220):
    """A batch, one member for each cue; the cue is there for `cue_steps`."""
    table = np.zeros((steps, len(angles), 2))
    table[:cue_steps, :, program.input_index["cue_x"]] = np.cos(angles)
    table[:cue_steps, :, program.input_index["cue_y"]] = np.sin(angles)
    return run(program, table)


def _ring(program, trace):
    first = program.neuron_index["ring[0]"]
    return trace.output[..., first : first + N]


def _heading(trace):
    return np.arctan2(trace.readout[..., 1], trace.readout[..., 0])


def _apart(a, b):
    return np.abs(np.angle(np.exp(1j * (a - b))))


def _bump(excitation, inhibition):
    """Half width [rad] and height of the solution."""

    def width(c):
        return excitation * (c - np.sin(2 * c) / 2) - 2 * np.pi

    half = brentq(width, 0.1, np.pi)
    # Mean of the ring's input: 0 = tonic + J0 X (sin c - c cos c) / pi + X cos c.
    slope = (excitation - inhibition) * (np.sin(half) - half * np.cos(half)) / np.pi + np.cos(half)
    return half, -1 / slope


def test_there_are_no_errors_and_no_warnings():
    assert check("ring_attractor") == ((), ())


def test_each_neuron_either_excites_or_inhibits():
    graph = load_circuit("ring_attractor")
    for projection in graph.projections:
        weights = np.broadcast_to(projection.weights, (projection.indptr[-1],))
        if projection.source == "ring":
            assert (weights >= 0).all()
        if projection.source == "global":
            assert (weights <= 0).all()


def test_the_bump_stays_where_the_cue_was(program):
    """For two seconds without a cue; with 64 members some places are preferred, a little."""
    angles = np.radians([0, 1, 2, 2.8125, 4, 45, 100, 180, 233.3, 359])
    trace = _cued(program, angles)
    assert _apart(_heading(trace)[-1], angles).max() < np.radians(0.2)
    assert _apart(_heading(trace)[-1], _heading(trace)[19]).max() < np.radians(0.2)


@pytest.mark.parametrize(("excitation", "inhibition"), [(4, 6), (4, 8), (3, 6), (6, 8)])
def test_width_and_height_of_the_bump_are_those_of_the_theory(excitation, inhibition):
    program = _compiled(excitation=excitation, inhibition=inhibition)
    ring = _ring(program, _cued(program, np.zeros(1), steps=400))[-1, 0]
    half, height = _bump(excitation, inhibition)
    expected = height * np.maximum(np.cos(ANGLES) - np.cos(half), 0)
    np.testing.assert_allclose(ring, expected, atol=0.01 * expected.max())


def test_half_the_ring_is_active_as_high_as_the_file_says(program):
    ring = _ring(program, _cued(program, np.zeros(1), steps=400))[-1, 0]
    assert ring.max() == pytest.approx(np.pi / 2, rel=0.002)
    assert abs((ring > 0).sum() - N / 2) <= 1


def test_turned_by_whole_members_everything_turns(program):
    turned = 2 * np.pi * np.array([0, 1, 17, 32, 63]) / N
    ring = _ring(program, _cued(program, 0.3 + turned))
    for member, places in enumerate((0, 1, 17, 32, 63)):
        np.testing.assert_allclose(ring[:, member], np.roll(ring[:, 0], places, axis=-1), atol=1e-9)


def test_a_new_cue_moves_the_bump(program):
    table = np.zeros((300, 1, 2))
    table[:20, 0] = [1.0, 0.0]
    table[100:140, 0] = [0.0, -1.0]
    trace = run(program, table)
    assert _apart(_heading(trace)[99, 0], 0.0) < np.radians(0.2)
    assert _apart(_heading(trace)[-1, 0], -np.pi / 2) < np.radians(3)


def test_without_enough_excitation_nothing_is_held():
    """J2 = 1.8 < 2: all return to tonic / (1 - J0) = 1 / 5.2."""
    program = _compiled(excitation=1.8)
    ring = _ring(program, _cued(program, np.zeros(1), steps=400))[-1, 0]
    np.testing.assert_allclose(ring, 1 / 5.2, rtol=1e-3)
