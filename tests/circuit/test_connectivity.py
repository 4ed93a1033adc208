"""Rules of connection: what they promise, for all sizes, and the statistics of the random ones."""

from __future__ import annotations

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from circuitkit.circuit.resolving import connectivity
from circuitkit.circuit.resolving.member_values import generator

sizes = st.integers(1, 30)
seeds = st.integers(0, 1000)
few = settings(max_examples=60, deadline=None)


def table(connections, n_source: int) -> np.ndarray:
    """The connections as a table of True and False, a row for every target."""
    indptr, sources = connections
    found = np.zeros((len(indptr) - 1, n_source), dtype=int)
    for row, (begin, end) in enumerate(pairwise(indptr)):
        assert (np.diff(sources[begin:end]) > 0).all()
        found[row, sources[begin:end]] = 1
    assert found.sum() == len(sources) == indptr[-1]
    assert (indptr.dtype, sources.dtype) == (np.int64, np.int32)
    return found


@given(sizes, sizes)
@few
def test_all_to_all(n_source, n_target):
    assert table(connectivity.all_to_all(n_source, n_target), n_source).all()


@given(st.integers(2, 30))
@few
def test_all_to_all_without_self(size):
    found = table(connectivity.all_to_all(size, size, without_self=True), size)
    assert (found == 1 - np.eye(size)).all()


@given(sizes)
@few
def test_one_to_one(size):
    assert (table(connectivity.one_to_one(size), size) == np.eye(size)).all()


@given(st.data(), sizes, sizes, seeds)
@few
def test_in_degree_gives_every_target_as_many_different_sources(data, n_source, n_target, seed):
    degree = data.draw(st.integers(1, n_source))
    found = table(connectivity.in_degree(degree, n_source, n_target, generator(seed, "a")), n_source)
    assert (found.sum(axis=1) == degree).all()


@given(st.data(), st.integers(2, 30), seeds)
@few
def test_in_degree_without_self(data, size, seed):
    degree = data.draw(st.integers(1, size - 1))
    found = table(connectivity.in_degree(degree, size, size, generator(seed, "a"), without_self=True), size)
    assert (found.sum(axis=1) == degree).all()
    assert not found.diagonal().any()


@pytest.mark.parametrize("degree", [2, 4])
def test_all_choices_of_sources_are_equally_likely(degree):
    """5 sources: 10 pairs or 5 choices of four, of which each should come in its share of 20 000 rows."""
    _, sources = connectivity.in_degree(degree, 5, 20_000, generator(3, "choices"))
    rows = sources.reshape(-1, degree)
    counts = np.unique(rows, axis=0, return_counts=True)[1]
    assert len(counts) == {2: 10, 4: 5}[degree]
    assert chisquare(counts).pvalue > 1e-3


@given(sizes, sizes, seeds, st.sampled_from([0.0, 0.1, 0.7, 1.0]))
@few
def test_probability_is_a_table_of_its_size(n_source, n_target, seed, chance):
    found = table(connectivity.probability(chance, n_source, n_target, generator(seed, "p")), n_source)
    assert found.shape == (n_target, n_source)
    assert chance not in {0.0, 1.0} or (found == chance).all()


@pytest.mark.parametrize("chance", [5e-324, 1e-300, 1e-19, 1e-12])
def test_very_small_probabilities_give_nothing(chance):
    indptr, sources = connectivity.probability(chance, 1_000, 1_000, generator(0, "s"))
    assert len(sources) == indptr[-1] == 0


@pytest.mark.parametrize("without_self", [False, True])
def test_pairs_are_connected_with_the_probability_and_independently(without_self):
    """Sums over rows and columns of 1 000 x 1 000 pairs are binomial: mean and variance fit."""
    size, chance = 1_000, 0.05
    drawn = connectivity.probability(chance, size, size, generator(5, "x"), without_self=without_self)
    found = table(drawn, size)
    assert found.diagonal().any() != without_self
    n = size - without_self
    for sums in (found.sum(axis=0), found.sum(axis=1)):
        variance = n * chance * (1 - chance)
        assert abs(sums.mean() - n * chance) < 5 * np.sqrt(variance / size)
        assert abs(sums.var() - variance) < 5 * variance * np.sqrt(2 / size)


def test_the_same_seed_and_name_give_the_same_and_others_do_not():
    draw = [
        connectivity.in_degree(3, 50, 50, generator(*key))[1]
        for key in ((0, "a"), (0, "a"), (1, "a"), (0, "b"))
    ]
    assert np.array_equal(draw[0], draw[1])
    assert not np.array_equal(draw[0], draw[2])
    assert not np.array_equal(draw[0], draw[3])


@pytest.mark.parametrize("rule", ["in_degree", "probability"])
def test_no_more_memory_than_the_result_and_a_block(rule):
    """A million synapses of 4 bytes; pairs of indices would need 16 bytes each, the dense table 12 GB."""
    tracemalloc.start()
    if rule == "in_degree":
        indptr, sources = connectivity.in_degree(10, 100_000, 100_000, generator(0, "m"))
    else:
        indptr, sources = connectivity.probability(1e-4, 100_000, 100_000, generator(0, "m"))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < indptr.nbytes + sources.nbytes + 10e6
