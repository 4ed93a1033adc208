"""Noise: the numbers that docs/engine.md defines, normal, and the same for every batch and way to step."""

import numpy as np
import pytest
from reference import normal
from scipy import stats

from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.graph import CircuitGraph, Neuron, Population
from circuitkit.circuit.models import neuron_model
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.noise import NormalNumbers


def noisy(sigma=0.5, model="identity", size=3):
    one = neuron_model(model)
    neuron = Neuron("a", one, "excitatory", {"gain": 1.0}, DIMENSIONLESS, noise=sigma)
    population = Population("p", size, one, "excitatory", {"gain": 1.0}, DIMENSIONLESS, noise=sigma)
    return CircuitGraph("noise", "", "ordered", 0.01, (), (neuron,), (), (), {}, 1, (population,))


@pytest.fixture(scope="module")
def drawn():
    """Shape (200 times, 100 streams, 20 seeds)."""
    numbers = NormalNumbers(np.arange(100, dtype=np.int32), 20)
    numbers.seed(np.arange(20, dtype=np.uint64))
    values = np.empty((200, 100, 20))
    for time in range(200):
        numbers.draw(time)
        values[time] = numbers.values
    return values


def test_the_numbers_are_those_of_the_definition(drawn):
    for time, stream, seed in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (199, 99, 19), (37, 5, 11)):
        np.testing.assert_allclose(drawn[time, stream, seed], normal(seed, stream, time), rtol=1e-14)
    numbers = NormalNumbers(np.array([2**31 - 1], dtype=np.int32), 1)
    numbers.seed(np.array([2**64 - 1], dtype=np.uint64))
    numbers.draw(2**40)
    np.testing.assert_allclose(numbers.values[0, 0], normal(2**64 - 1, 2**31 - 1, 2**40), rtol=1e-13)


def test_they_are_normal(drawn):
    assert stats.kstest(drawn.ravel(), "norm").pvalue > 0.01
    assert abs(drawn.mean()) < 5 / np.sqrt(drawn.size)
    assert abs(drawn.var() - 1) < 5 * np.sqrt(2 / drawn.size)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_neighbours_in_time_stream_and_seed_are_independent(drawn, axis):
    moved = np.moveaxis(drawn, axis, 0)
    for one, other in ((moved[:-1], moved[1:]), (moved[:-1] ** 2, moved[1:] ** 2)):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 5 / np.sqrt(one.size)


def test_a_neuron_gets_sigma_times_its_number():
    program = compile_circuit(noisy(0.5), "numpy")
    trace = run(program, np.zeros((4, 2, 0)), program.initial_state(2, seed=7))
    expected = [[[0.5 * normal(7 + b, n, t) for n in range(4)] for b in range(2)] for t in range(4)]
    np.testing.assert_allclose(trace.activation, expected, rtol=1e-13)


def test_a_member_gets_the_same_numbers_in_every_batch_and_in_parts():
    program = compile_circuit(noisy(), "numpy")
    together = run(program, np.zeros((9, 6, 0)), program.initial_state(6, seed=3))
    for member in (0, 2, 5):
        alone = run(program, np.zeros((9, 1, 0)), program.initial_state(1, seed=3 + member))
        assert alone.activation.tobytes() == together.activation[:, [member]].tobytes()
    first = run(program, np.zeros((4, 6, 0)), program.initial_state(6, seed=3))
    second = run(program, np.zeros((5, 6, 0)), first.state)
    assert second.output.tobytes() == together.output[4:].tobytes()


def test_white_noise_has_the_variance_of_an_ornstein_uhlenbeck_process():
    """tau v' = -v + sigma xi(t): the variance is sigma^2 / (2 tau), whatever the substeps."""
    from random_circuits import leaky

    tau, sigma, model = 0.02, 0.3, leaky("exact")
    population = Population(
        "p", 400, model, "excitatory", {"tau": tau}, DIMENSIONLESS, initial={"v": 0.0}, noise=sigma
    )
    for substeps in (20, 40):
        graph = CircuitGraph("noise", "", "ordered", 0.01, (), (), (), (), {}, substeps, (population,))
        trace = run(compile_circuit(graph, "numpy"), np.zeros((100, 1, 0)), record=[], states=True)
        assert abs(trace.states[30:].var() / (sigma**2 / (2 * tau)) - 1) < 0.05
