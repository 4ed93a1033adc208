"""The predictive controller against Kajita's preview control, a longer horizon, and another solver."""

from __future__ import annotations

import sys
from functools import cache

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are
from scipy.optimize import lsq_linear

from circuitkit.base.errors import MissingDependencyError
from circuitkit.biped.control.jerk_mpc import (
    JerkMpc,
    box_solver,
    preview_matrices,
    transition,
    zmp_row,
)
from circuitkit.biped.gait.lipm import natural_frequency

HEIGHT, STEP, STEPS, WEIGHT = 0.27, 0.02, 75, 1e6
OMEGA = natural_frequency(HEIGHT)


def footsteps(steps, step_s, start_s=0.0):
    """A ZMP that changes foot every 0.5 s, in 0.05 s, and the soles' edges around it."""
    time = start_s + step_s * np.arange(1, steps + 1)
    phase = (time % 1.1) / 0.55
    share = np.clip((phase % 1.0) * 0.55 / 0.05, 0.0, 1.0)
    side = np.where(phase < 1.0, 1.0, -1.0)
    zmp = 0.055 * side * (2.0 * share - 1.0)
    double = share < 1.0
    low = np.where(double, -0.1, np.where(side > 0, 0.011, -0.1))
    high = np.where(double, 0.1, np.where(side > 0, 0.1, -0.011))
    return zmp, low, high


STATES = st.tuples(st.floats(-0.03, 0.03), st.floats(-0.2, 0.2), st.floats(-1.0, 1.0)).map(np.array)


@cache
def mpc(steps=STEPS, weight=WEIGHT, solver="daqp"):
    """The controller, factorised once."""
    return JerkMpc(HEIGHT, STEP, steps, weight, solver)


FAR = 1e3  # a bound that nothing reaches


def kajita_gains(step_s, preview, weight):
    """Preview control of Kajita et al. 2003: u = -k x + sum f_i z_ref(i), from the Riccati equation."""
    a, b = transition(step_s)
    b, c = b[:, None], zmp_row(HEIGHT)[None]
    p = solve_discrete_are(a, b, weight * c.T @ c, np.eye(1))
    bottom = 1.0 + (b.T @ p @ b).item()
    state = (b.T @ p @ a / bottom)[0]
    closed = a - b @ state[None]
    ahead, vector = np.empty(preview), weight * c[0]
    for i in range(preview):
        ahead[i] = (b.T @ vector).item() / bottom
        vector = closed.T @ vector
    return state, ahead


def test_the_matrices_are_the_pendulum_step_by_step():
    rng = np.random.default_rng(1)
    state, jerks = rng.normal(size=3), rng.normal(size=6)
    a, b = transition(STEP)
    from_state, from_jerk = preview_matrices(HEIGHT, STEP, 6)
    expected, x = [], state
    for jerk in jerks:
        x = a @ x + b * jerk
        expected.append(x[0] - HEIGHT / 9.81 * x[2])
    np.testing.assert_allclose(from_state @ state + from_jerk @ jerks, expected, rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(state=STATES, start=st.floats(0.0, 1.1))
def test_without_a_bound_in_reach_it_is_kajitas_preview_control(state, start):
    """Equal but for the horizon's end, which e^(-omega N T) of a motion still feels."""
    steps = 100
    zmp, _, _ = footsteps(steps, STEP, start)
    jerk = mpc(steps).solve(state[None], zmp, np.full(steps, -FAR), np.full(steps, FAR))
    assert not jerk.bounded[0]
    gain, ahead = kajita_gains(STEP, steps, WEIGHT)
    assert jerk.jerk[0] == pytest.approx(-gain @ state + ahead @ zmp, abs=1e-4 * np.abs(gain).max())


def test_the_preview_of_a_second_and_a_half_is_long_enough():
    """Against three seconds, solved for the jerks as Wieber writes it, from states as after a push."""
    steps, active = 150, 0
    from_state, from_jerk = preview_matrices(HEIGHT, STEP, steps)
    hessian = np.eye(steps) + WEIGHT * from_jerk.T @ from_jerk
    scale = np.abs(hessian).max()
    for start in np.arange(0.0, 1.1, 0.275):
        for push in (-0.03, 0.0, 0.03):
            zmp, low, high = footsteps(steps, STEP, start)
            state = np.array([push, 0.0, 0.0])
            free = from_state @ state
            gradient = WEIGHT * from_jerk.T @ (free - zmp)
            rows, ends = np.vstack([from_jerk, -from_jerk]), np.concatenate([high - free, free - low])
            jerks = qpsolvers.solve_qp(hessian / scale, gradient / scale, rows, ends, solver="daqp")
            found = mpc().solve(state[None], zmp[:STEPS], low[:STEPS], high[:STEPS])
            active += int(found.bounded[0])
            assert found.zmp_m[0] == pytest.approx((free + from_jerk @ jerks)[0], abs=1e-4)
    assert active > 5


@settings(max_examples=40, deadline=None)
@given(state=STATES, start=st.floats(0.0, 1.1), weight=st.sampled_from([0.0, 1e4, 1e6]))
def test_the_bounds_hold_and_the_optimum_is_that_of_another_solver(state, start, weight):
    control = mpc(weight=weight)
    zmp, low, high = footsteps(STEPS, STEP, start)
    found = control.solve_all(state, zmp, low, high)
    assert (found >= low - 1e-9).all()
    assert (found <= high + 1e-9).all()

    # The same problem as it is written down, by bounded least squares: |u|^2 + q |z - z_ref|^2, u by z.
    from_state, from_jerk = preview_matrices(HEIGHT, STEP, STEPS)
    inverse = np.linalg.inv(from_jerk)
    matrix = np.vstack([inverse, np.sqrt(weight) * np.eye(STEPS)])
    wanted = np.concatenate([inverse @ from_state @ state, np.sqrt(weight) * zmp])
    scale = np.abs(inverse).max()
    other = lsq_linear(matrix / scale, wanted / scale, (low, high), method="bvls", tol=1e-14).x

    def cost(z):
        return float(np.sum(((matrix @ z - wanted) / scale) ** 2))

    assert cost(found) == pytest.approx(cost(other), rel=1e-6, abs=1e-12)
    assert found[0] == pytest.approx(other[0], abs=1e-5)


def test_it_brings_a_pushed_pendulum_back_and_keeps_the_zmp_inside():
    control = mpc()
    a, b = transition(STEP)
    states = np.array([[0.0, 0.0, 0.0], [0.02, 0.12, 0.0]])
    for tick in range(220):
        zmp, low, high = footsteps(STEPS, STEP, tick * STEP)
        jerk = control.solve(states, zmp, low, high)
        assert (jerk.zmp_m >= low[0] - 1e-9).all()
        assert (jerk.zmp_m <= high[0] + 1e-9).all()
        states = states @ a.T + jerk.jerk[:, None] * b
        np.testing.assert_allclose(states @ zmp_row(HEIGHT), jerk.zmp_m, atol=1e-9)
    np.testing.assert_allclose(states[1], states[0], atol=1e-4)


def test_a_dcm_outside_the_soles_is_lost_and_one_inside_is_not():
    """Standing, with 40 mm to the edge: the DCM tells."""
    control = mpc()
    edge = np.full(STEPS, 0.04)
    a, b = transition(STEP)
    for dcm, stays in ((0.030, True), (0.045, False)):
        state = np.array([[0.0, dcm * OMEGA, 0.0]])
        for _ in range(75):
            jerk = control.solve(state, np.zeros(STEPS), -edge, edge).jerk
            state = state @ a.T + jerk[:, None] * b
        assert (abs(state[0, 0]) < 0.04) == stays


def test_a_robot_gets_the_same_bits_in_every_company_and_order():
    control = mpc()
    rng = np.random.default_rng(3)
    states = rng.normal(size=(12, 3)) * [0.02, 0.1, 0.5]
    zmp, low, high = footsteps(STEPS, STEP, 0.3)
    together = control.solve(states, zmp, low, high)
    assert together.bounded.any()
    for number in (11, 0, 5, 5):
        alone = control.solve(states[number : number + 1], zmp, low, high)
        assert alone.jerk[0] == together.jerk[number]
        assert alone.zmp_m[0] == together.zmp_m[number]


def test_every_solver_that_is_installed_finds_the_same():
    """Among them daqp itself, called through qpsolvers instead of through its own interface."""
    hessian = mpc().hessian
    own = box_solver("daqp", hessian)
    rng = np.random.default_rng(4)
    for name in set(qpsolvers.dense_solvers) - {"osqp", "scs", "ecos"}:  # those solve to millimetres
        other = box_solver(name, hessian, direct=False)
        for middle in rng.normal(0.0, 0.05, (5, STEPS)):
            low, high = middle - 0.04, middle + 0.04
            np.testing.assert_allclose(other(low, high), own(low, high), atol=1e-6, err_msg=name)


@pytest.mark.parametrize(("solver", "package"), [("daqp", "daqp"), ("quadprog", "qpsolvers")])
def test_a_missing_package_is_named_with_the_extra_that_brings_it(monkeypatch, solver, package):
    monkeypatch.setitem(sys.modules, package, None)
    message = f"the controller kind wieber_mpc needs the package '{package}'.*neurocircuitkit\\[mpc\\]"
    with pytest.raises(MissingDependencyError, match=message):
        box_solver(solver, np.eye(2))


def test_a_solver_that_is_not_there_is_named():
    with pytest.raises(MissingDependencyError, match="the package 'proximal_dreams'"):
        box_solver("proximal_dreams", np.eye(2))
