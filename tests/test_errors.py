"""Problems as text, and exceptions that survive pickling, as worker processes need."""

from __future__ import annotations

import pickle
import time

import pytest

from circuitkit.base.errors import (
    CircuitkitError,
    ExpressionError,
    InputError,
    MissingDependencyError,
    Problem,
    SimulationError,
    UnitError,
    UnknownNameError,
    listing,
    suggest,
)


@pytest.mark.parametrize(
    ("problem", "text"),
    [
        (Problem("a.yaml", 3, 5, "neurons.q1", "bad", "try this"), "a.yaml:3:5: neurons.q1: bad; try this"),
        (Problem("a.yaml", 3, 5, "neurons.q1", "bad"), "a.yaml:3:5: neurons.q1: bad"),
        (Problem("a.yaml", 1, 1, "", "bad"), "a.yaml:1:1: bad"),
        (Problem("", 0, 0, "", "bad"), "bad"),
    ],
)
def test_a_problem_says_where_and_what(problem, text):
    assert str(problem) == text


def test_an_input_error_lists_every_problem():
    error = InputError(Problem("a.yaml", 1, 2, "", "first"), Problem("a.yaml", 3, 4, "", "second"))
    assert str(error) == "a.yaml:1:2: first\na.yaml:3:4: second"
    assert len(error.problems) == 2


@pytest.mark.parametrize(
    "error",
    [
        InputError(Problem("a.yaml", 1, 2, "", "first")),
        UnknownNameError("neuron", "q9", ("q1", "q2")),
        UnitError("found 5"),
        ExpressionError("found x"),
        MissingDependencyError("imageio", "video", "writing a video"),
        SimulationError("the robot has left the world"),
    ],
)
def test_errors_survive_pickling(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.exit_code == error.exit_code


def test_exit_codes_tell_wrong_input_from_a_failed_run():
    assert {
        InputError.exit_code,
        UnknownNameError.exit_code,
        UnitError.exit_code,
        ExpressionError.exit_code,
    } == {1}
    assert {CircuitkitError.exit_code, SimulationError.exit_code, MissingDependencyError.exit_code} == {3}


def test_an_unknown_name_lists_those_there_are():
    error = UnknownNameError("neuron", "q11", ("q1", "q2"))
    assert str(error) == "unknown neuron 'q11'; allowed: q1, q2; did you mean 'q1'?"
    assert isinstance(error, LookupError)


def test_a_missing_package_is_named_with_the_extra_that_brings_it():
    assert str(MissingDependencyError("imageio", "video", "writing a video")) == (
        "writing a video needs the package 'imageio', which is not installed; "
        "install it with: pip install 'neurocircuitkit[video]'"
    )


NAMES = (
    *("lf", "q1", "p1", "left_edge", "right_edge"),
    *("inhibitory", "sigmoid", "threshold_linear", "ms", "mS", "deg"),
)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("q11", "q1"), ("Q1", "q1"), ("lg", "lf"), ("1q", "q1"), ("sigmiod", "sigmoid"), ("MS", "mS"),
        ("left-edge", "left_edge"), ("edge_right", "right_edge"), ("right_edg", "right_edge"), ("msec", "ms"),
        ("degrees", "deg"), ("inhib", "inhibitory"), ("inhibiting", "inhibitory"),
        ("linear_threshold", "threshold_linear"),
    ],
)  # fmt: skip
def test_the_nearest_name_is_suggested(name, meant):
    assert suggest(name, NAMES) == f"did you mean '{meant}'?"


@pytest.mark.parametrize("name", ["xyz", "", "z", "force", "tau"])
def test_nothing_is_suggested_if_nothing_is_near(name):
    assert suggest(name, NAMES) == ""


def test_the_nearest_of_many_names_is_found_soon():
    names = [f"neuron_{i}" for i in range(20_000)]
    begin = time.perf_counter()
    assert suggest("nueron_17391", names) == "did you mean 'neuron_17391'?"
    assert time.perf_counter() - begin < 5


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ((), "nothing"),
        (("a", "b"), "a, b"),
        (
            tuple("abcdefghijklmnopqrstuvw"),
            "a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t and 3 more",
        ),
    ],
)
def test_long_lists_of_names_are_cut(names, text):
    assert listing(names) == text
