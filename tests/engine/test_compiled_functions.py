"""Our own exponential and what is made of it, against decimal arithmetic with 50 digits."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from programs import program_of

from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.engine.backends.compiled_backend import CompiledKernel
from circuitkit.engine.backends.numpy_backend import NumpyKernel
from circuitkit.engine.operations import Map

pytestmark = pytest.mark.usefixtures("no_fallback")
NAMES = ("exp", "expm1", "exprel", "sigmoid", "tanh")
TINY = Decimal("1e-30")


def truth(name, x):
    """The value to 50 digits."""
    grown = x.exp() - 1 if abs(x) > TINY else x + x * x / 2
    return {
        "exp": x.exp(),
        "expm1": grown,
        "exprel": grown / x if x else Decimal(1),
        "sigmoid": 1 / (1 + (-x).exp()),
        "tanh": ((2 * x).exp() - 1) / ((2 * x).exp() + 1) if abs(x) > TINY else x,
    }[name]


@pytest.fixture(scope="module")
def compute(tmp_path_factory):
    """A function that computes all five of many numbers, side by side or one by one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CIRCUITKIT_CACHE", str(tmp_path_factory.getbasetemp() / "compiled"))
        maps = [
            Map(1, ((2 + i, parse_expression(f"{name}(x)", ("x",))),), {"x": 1})
            for i, name in enumerate(NAMES)
        ]
        program = program_of(maps, 2 + len(NAMES), lasting=range(2, 2 + len(NAMES)), backend="compiled")

        def values(numbers):
            kernel = CompiledKernel(program, len(numbers))
            kernel.load(program.initial_state(len(numbers)))
            kernel.inputs[:, 0] = numbers
            kernel.advance()
            state = program.initial_state(len(numbers))
            kernel.store(state)
            return dict(zip(NAMES, state.states.T, strict=True))

        values(np.zeros(1))
        values(np.zeros(2))
        yield values


def some_numbers():
    rng = np.random.default_rng(0)
    small = 10.0 ** rng.uniform(-25, 0, 300) * rng.choice([-1, 1], 300)
    return np.concatenate([rng.uniform(-745, 709.7, 600), rng.uniform(-3, 3, 600), small, [0.0, 1.0, -1.0]])


# The error of the sigmoid grows with -x, as its argument of the power of two is rounded once.
@pytest.mark.parametrize(
    ("name", "low", "ulps"),
    [
        ("exp", -708.0, 1.5),
        ("expm1", -745.0, 2.5),
        ("exprel", -708.0, 3.5),
        ("sigmoid", -3.0, 5.0),
        ("sigmoid", -40.0, 8.0),
        ("sigmoid", -708.0, 100.0),
        ("tanh", -745.0, 4.0),
    ],
)
def test_functions_are_as_close_as_doubles_allow(compute, name, low, ulps):
    numbers = some_numbers()
    numbers = numbers[numbers >= low]
    found = compute(numbers)[name]
    with localcontext(prec=50):
        for x, y in zip(numbers.tolist(), found.tolist(), strict=True):
            exact = truth(name, Decimal(x))
            assert abs(Decimal(y) - exact) <= Decimal(ulps) * Decimal(math.ulp(float(exact))), x


def test_the_ends_are_right(compute):
    """Overflow, gradual underflow, infinities and NaN."""
    numbers = np.array([709.8, 1e300, math.inf, -740.0, -746.0, -1e300, -math.inf, math.nan])
    found = compute(numbers)
    below = [math.exp(-740.0), 0.0, 0.0, 0.0]
    np.testing.assert_array_equal(found["exp"], [math.inf, math.inf, math.inf, *below, math.nan])
    np.testing.assert_array_equal(found["expm1"], [*[math.inf] * 3, *[-1.0] * 4, math.nan])
    np.testing.assert_allclose(found["sigmoid"], [1, 1, 1, 0, 0, 0, 0, math.nan], atol=1e-300)
    np.testing.assert_array_equal(found["tanh"], [*[1.0] * 3, *[-1.0] * 4, math.nan])


def test_a_number_alone_gives_the_bits_of_many_side_by_side(compute):
    numbers = some_numbers()[::7]
    many = compute(numbers)
    for k, x in enumerate(numbers):
        alone = compute(np.array([x]))
        assert all(alone[name][0] == many[name][k] for name in NAMES)


def test_functions_of_two_arguments_are_those_of_math(tmp_path, monkeypatch):
    monkeypatch.setenv("CIRCUITKIT_CACHE", str(tmp_path))
    names = ("atan2", "hypot")
    maps = [
        Map(1, ((3 + i, parse_expression(f"{name}(y, x)", ("y", "x"))),), {"y": 1, "x": 2})
        for i, name in enumerate(names)
    ]
    some = [0.0, -0.0, 1.0, -1.0, 3e-200, -4e200, 0.3, -7.1, math.inf]
    pairs = np.array([(y, x) for y in some for x in some] + [(math.nan, 1.0), (1.0, math.nan)])
    values = {}
    for backend, kernel_of in (("compiled", CompiledKernel), ("numpy", NumpyKernel)):
        program = program_of(maps, 5, n_inputs=2, lasting=range(3, 5), backend=backend)
        kernel = kernel_of(program, len(pairs))
        kernel.load(program.initial_state(len(pairs)))
        kernel.inputs[...] = pairs
        kernel.advance()
        state = program.initial_state(len(pairs))
        kernel.store(state)
        values[backend] = state.states
    expected = np.array([[math.atan2(y, x), math.hypot(y, x)] for y, x in pairs])
    for found in values.values():
        np.testing.assert_allclose(found, expected, rtol=4e-16, atol=0)
        assert np.array_equal(np.signbit(found[: len(some) ** 2]), np.signbit(expected[: len(some) ** 2]))
