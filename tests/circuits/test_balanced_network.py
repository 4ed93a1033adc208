"""The balanced network at a twentieth of its size: rate by mean-field theory, irregular, asynchronous."""

from __future__ import annotations

import numpy as np
import pytest
from mean_field import self_consistent

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

N = 5000
SMALL = {"excitatory.size": 4000, "inhibitory.size": 1000}
STEP_S = 0.0005
SETTLED = round(0.2 / STEP_S)


@pytest.fixture(scope="module")
def spikes():
    """Whether each neuron spiked in each substep, (T, N), after 200 ms; a control step is a substep here."""
    changes = {**SMALL, "control_step": "0.5 ms", "substeps": 1}
    program = compile_circuit(load_circuit("balanced_network", changes))
    output = run(program, np.zeros((SETTLED + round(0.6 / STEP_S), 1, 0))).output
    return output[SETTLED:, 0] > 0


def test_there_are_no_errors_and_no_warnings():
    assert check("balanced_network") == ((), ())


def test_it_is_a_large_network_without_noise():
    graph = load_circuit("balanced_network")
    assert sum(population.size for population in graph.populations) == 100_000
    assert sum(int(projection.indptr[-1]) for projection in graph.projections) == 5_000_000
    for projection in graph.projections:
        degree = 40 if projection.source == "excitatory" else 10
        assert (np.diff(projection.indptr) == degree).all()
    assert all(np.all(population.noise == 0) for population in graph.populations)


def test_the_rate_is_that_of_the_mean_field_theory(spikes):
    expected, mean_mv, _ = self_consistent()
    rate = spikes.mean() / STEP_S
    assert rate == pytest.approx(expected, rel=0.08)
    assert mean_mv < 20  # the mean input does not reach the threshold: spikes come from fluctuations


def test_each_neuron_spikes_irregularly(spikes):
    """As irregularly as a Poisson process: standard deviation of the intervals over their mean near 1."""
    variation = []
    for i in range(N):
        intervals = np.diff(np.flatnonzero(spikes[:, i]))
        if len(intervals) > 8:
            variation.append(intervals.std() / intervals.mean())
    assert len(variation) > N / 2
    assert 0.8 < np.mean(variation) < 1.15


def test_neurons_spike_at_their_own_times(spikes):
    """Counts in 10 ms of different neurons are hardly correlated."""
    bins = spikes[: len(spikes) // 20 * 20].reshape(-1, 20, N).sum(axis=1, dtype=float)
    some = bins[:, :: N // 250]
    correlation = np.corrcoef(some[:, some.std(axis=0) > 0].T)
    others = correlation[~np.eye(len(correlation), dtype=bool)]
    assert abs(others.mean()) < 0.02


def test_excitatory_and_inhibitory_neurons_fire_alike(spikes):
    """They have the same input, so the same rate."""
    assert spikes[:, :4000].mean() == pytest.approx(spikes[:, 4000:].mean(), rel=0.03)


def test_the_whole_network_runs():
    """40 ms of 100 000 neurons; after a first volley the rate is near what the theory has for it."""
    program = compile_circuit(load_circuit("balanced_network"))
    trace = run(program, np.zeros((4, 1, 0)))
    assert trace.output.shape == (4, 1, 100_000)
    assert trace.readout[-2:, 0, 0].mean() / 0.01 == pytest.approx(self_consistent()[0], rel=0.15)
