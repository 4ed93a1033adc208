"""Model predictive control of a linear inverted pendulum by its jerk, one axis (Wieber 2006).

State x = (y, y', y''), control u = y''' held for T; ZMP z = y - (h/g) y''. Over N steps ahead, with
z = P_x x + P_u u,

    minimise   q |z - z_ref|^2 + |u|^2   subject to   z_min <= z <= z_max.

With q = 0 this is Wieber's trajectory without a reference; with q > 0 and no bound reached it is Kajita's
preview control over a finite horizon. P_u is triangular with a diagonal of T^3/6 - h T/g, so every z can be
had by some u: the ZMPs themselves are taken as the unknowns, the constraints are bounds on them, and there
always is a solution. Everything that does not change is factorised once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from circuitkit.base.errors import DivergedError, MissingDependencyError
from circuitkit.biped.gait.lipm import GRAVITY_M_S2
from circuitkit.control.controller import Array

OWN = "daqp"  # the solver that is called through its own interface, which keeps its factorisation
_PURPOSE = "the controller kind wieber_mpc"

BoxSolver = Callable[[Array, Array], Array]


class Jerk(NamedTuple):
    """What the first step of the optimum is.

    Attributes:
        jerk: Shape (B,), [m/s^3].
        zmp_m: At the end of the step; shape (B,).
        bounded: Where a bound of the preview is reached; shape (B,).
    """

    jerk: Array
    zmp_m: Array
    bounded: NDArray[np.bool_]


def transition(step_s: float) -> tuple[Array, Array]:
    """A, shape (3, 3), and b, shape (3,), of x+ = A x + b u."""
    t = step_s
    matrix = np.array([[1.0, t, t**2 / 2], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    return matrix, np.array([t**3 / 6, t**2 / 2, t])


def zmp_row(com_height_m: float) -> Array:
    """The row c of z = c x; shape (3,)."""
    return np.array([1.0, 0.0, -com_height_m / GRAVITY_M_S2])


def preview_matrices(com_height_m: float, step_s: float, steps: int) -> tuple[Array, Array]:
    """P_x, shape (N, 3), and P_u, shape (N, N), of z = P_x x + P_u u."""
    matrix, control = transition(step_s)
    row = zmp_row(com_height_m)
    from_state, response = np.empty((steps, 3)), np.empty(steps)
    for k in range(steps):
        response[k] = row @ control
        row = row @ matrix
        from_state[k] = row
    number = np.arange(steps)
    lag = number[:, None] - number
    return from_state, np.where(lag >= 0, response[lag], 0.0)


class JerkMpc:
    """The optimum for B pendulums, each to the same bits whatever B is.

    Attributes:
        step_s: T.
        steps: N.
        hessian: H of the cost (z - z_free)' H (z - z_free), but for a factor; shape (N, N).
    """

    def __init__(
        self, com_height_m: float, step_s: float, steps: int, zmp_weight: float, solver: str = OWN
    ) -> None:
        """Factorise.

        Args:
            com_height_m: h.
            step_s: T.
            steps: N.
            zmp_weight: q, [1/s^6].
            solver: Name of a solver of qpsolvers.

        Raises:
            MissingDependencyError: qpsolvers or the solver is not installed.
        """
        self.step_s, self.steps = step_s, steps
        from_state, from_jerk = preview_matrices(com_height_m, step_s, steps)
        factor = cho_factor(np.eye(steps) + zmp_weight * from_jerk.T @ from_jerk)
        gain = zmp_weight * cho_solve(factor, from_jerk.T)
        # Without bounds u = gain (z_ref - P_x x), so z = along_reference z_ref + along_state x.
        self._along_reference = from_jerk @ gain
        self._along_state = from_state - self._along_reference @ from_state
        inverse = solve_triangular(from_jerk, np.eye(steps), lower=True)
        hessian = inverse.T @ inverse + zmp_weight * np.eye(steps)
        # A scale of the cost changes nothing but the solver's idea of a small number.
        self.hessian: Array = hessian / np.abs(hessian).max()
        self._solve = box_solver(solver, self.hessian)
        self._first_state, self._first_jerk = from_state[0], float(from_jerk[0, 0])

    def unbounded(self, state: Array, zmp_m: Array) -> Array:
        """ZMPs of the optimum without bounds, shape (B, N); see `solve`."""
        ahead = np.empty((len(state), self.steps))
        ahead[:] = self._along_reference @ zmp_m
        for column, weights in zip(state.T, self._along_state.T, strict=True):
            ahead += column[:, None] * weights
        return ahead

    def solve(self, state: Array, zmp_m: Array, low_m: Array, high_m: Array) -> Jerk:
        """The first step of the optimum.

        Args:
            state: x; shape (B, 3).
            zmp_m: z_ref at T, 2T ... NT from now; shape (N,).
            low_m: z_min there; shape (N,).
            high_m: z_max there; shape (N,).

        Raises:
            DivergedError: The solver found no optimum.
        """
        ahead = self.unbounded(state, zmp_m)
        bounded: NDArray[np.bool_] = np.any(np.logical_or(ahead < low_m, ahead > high_m), axis=1)
        first = ahead[:, 0].copy()
        for robot in np.flatnonzero(bounded):
            free = ahead[robot]
            first[robot] += self._solve(low_m - free, high_m - free)[0]
        known = sum(state[:, k] * self._first_state[k] for k in range(3))
        return Jerk((first - known) / self._first_jerk, first, bounded)

    def solve_all(self, state: Array, zmp_m: Array, low_m: Array, high_m: Array) -> Array:
        """All ZMPs of the optimum of one pendulum, shape (N,); `state` has the shape (3,)."""
        free = self.unbounded(state[None], zmp_m)[0]
        optimum: Array = free + self._solve(low_m - free, high_m - free)
        return optimum


def box_solver(name: str, hessian: Array, *, direct: bool = True) -> BoxSolver:
    """Minimises v' H v between bounds, cold from the start each time, so that no solution depends on another.

    Args:
        name: Of a solver of qpsolvers.
        hessian: H; shape (N, N).
        direct: Call daqp through its own interface, which keeps the factorised H; through qpsolvers, as all
            others are called, it takes several times as long (`benchmarks/bench_mpc.py`).

    Raises:
        MissingDependencyError: A package is missing.
    """
    return _daqp(hessian) if name == OWN and direct else _through_qpsolvers(name, hessian)


def _daqp(hessian: Array) -> BoxSolver:
    try:
        import daqp  # an extra
    except ImportError as error:
        package = "daqp"
        raise MissingDependencyError(package, "mpc", _PURPOSE) from error
    steps = len(hessian)
    inactive = np.zeros(steps, dtype=np.int32)
    one = np.ones(steps)
    model: Any = daqp.Model()
    model.setup(hessian, np.zeros(steps), np.zeros((0, steps)), one, -one, inactive)

    def solve(low: Array, high: Array) -> Array:
        # Handing the state of the constraints over again is what makes it start cold.
        model.update(bupper=high, blower=low, sense=inactive)
        solution, _, flag, _ = model.solve()
        if flag <= 0:
            message = f"daqp found no optimum (exit flag {flag})"
            raise DivergedError(message)
        found: Array = solution
        return found

    return solve


def _through_qpsolvers(name: str, hessian: Array) -> BoxSolver:
    try:
        import qpsolvers  # an extra
    except ImportError as error:
        package = "qpsolvers"
        raise MissingDependencyError(package, "mpc", _PURPOSE) from error
    if name not in qpsolvers.available_solvers:
        raise MissingDependencyError(name, "mpc", _PURPOSE)
    nothing = np.zeros(len(hessian))

    def solve(low: Array, high: Array) -> Array:
        found = qpsolvers.solve_qp(hessian, nothing, lb=low, ub=high, solver=name)
        if found is None:
            message = f"{name} found no optimum"
            raise DivergedError(message)
        solution: Array = found
        return solution

    return solve
