"""How states advance by their derivatives over a time dt, all from the old values.

For x' = f(x), with J the derivative of f by x and phi1(z) = (exp(z) - 1) / z:

- `euler`: x + dt f.
- `exponential_euler`, state by state: x + dt phi1(dt J) f. Exact if f is linear in x and the rest stands
  still.
- `exact`, all states of a linear model together: x + Q f, Q = dt phi1(dt J) with J a matrix; exact for any
  dt.
- `rk4`: the classical fourth-order method of Runge and Kutta.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number
from circuitkit.circuit.expressions.symbolic import derivative
from circuitkit.circuit.models.model import DT, Method
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.lowering.arithmetic import make_map
from circuitkit.engine.lowering.plan import Table
from circuitkit.engine.operations import FloatArray, IndexArray, Map

STAGES = 4  # of rk4
_FRACTIONS = (0.5, 0.5, 1.0)  # of dt at which its states are tried


@dataclass(frozen=True, eq=False)
class System:
    """Equations of many neurons or synapses side by side.

    Attributes:
        name: Of the model, for messages.
        count: How many.
        states: First row of every state.
        derivatives: Change per second of states.
        rows: First row of whatever else the equations use.
        picks: Rows of what stands in no neighbouring ones.
        constants: Values of the parameters.
        dt: Time to advance, [s].
    """

    name: str
    count: int
    states: Mapping[str, int]
    derivatives: Mapping[str, Expression]
    rows: Mapping[str, int]
    picks: Mapping[str, IndexArray]
    constants: Mapping[str, FloatArray]
    dt: float

    def map(self, results: list[tuple[int, Expression]], states: Mapping[str, int] | None = None) -> Map:
        """Return the operation that gives rows the values of expressions in terms of the equations' names."""
        rows = {**self.rows, **(self.states if states is None else states)}
        constants = {**self.constants, DT: np.array(self.dt)}
        return make_map(self.count, results, rows, constants, self.picks)


def advance(system: System, method: Method, table: Table) -> Iterator[Map]:
    """Advance the states by a method, with all else held."""
    if method == "rk4":
        stages = RungeKutta(system, table)
        for stage in range(STAGES):
            yield stages.slope(stage, {})
            yield from stages.trial(stage)
        yield stages.result()
        return
    changed = _exact(system) if method == "exact" else _alone(system, method)
    yield replace(system, constants=changed[1]).map(changed[0])


def _alone(system: System, method: Method) -> tuple[list[tuple[int, Expression]], Mapping[str, FloatArray]]:
    results = []
    for name, slope in system.derivatives.items():
        time: Expression = Name(DT)
        jacobian = derivative(slope, name)
        if method == "exponential_euler" and jacobian != Number(0.0):
            time = Binary("*", time, Call("exprel", (Binary("*", time, jacobian),)))
        results.append((system.states[name], _moved(name, time, slope)))
    return results, system.constants


def _exact(system: System) -> tuple[list[tuple[int, Expression]], Mapping[str, FloatArray]]:
    """Return new states x + Q f with Q the upper right part of exp(dt [[J, 1], [0, 0]])."""
    names = tuple(system.derivatives)
    jacobian = [[derivative(system.derivatives[i], j) for j in names] for i in names]
    if not all(entry.names() <= system.constants.keys() for row in jacobian for entry in row):
        message = "found equations that are not linear in the states; allowed: other methods than exact"
        raise InputError(Problem("", 0, 0, f"model {system.name}", message))
    values = [np.asarray(e.evaluate(system.constants, NUMPY_FUNCTIONS)) for row in jacobian for e in row]
    matrices = np.stack(np.broadcast_arrays(*values), axis=-1)
    weights = _propagators(matrices.reshape(-1, len(names), len(names)), system.dt)
    reached = _reached([{j for j, entry in enumerate(row) if entry != Number(0.0)} for row in jacobian])
    constants, results = dict(system.constants), []
    for i, name in enumerate(names):
        value: Expression = Name(name)
        for j, other in enumerate(names):
            weight = Name(f"exact_{i}_{j}")
            constants[weight.name] = weights[:, i, j].reshape(matrices.shape[:-1])
            if j in reached[i]:
                value = Binary("+", value, Binary("*", weight, system.derivatives[other]))
        results.append((system.states[name], value))
    return results, constants


def _reached(direct: list[set[int]]) -> list[set[int]]:
    """For every state those that it depends on, itself included, in one step or in many."""
    reached = [each | {i} for i, each in enumerate(direct)]
    for _ in reached:
        reached = [each.union(*(reached[j] for j in each)) for each in reached]
    return reached


def _propagators(jacobians: FloatArray, dt: float) -> FloatArray:
    """Find dt phi1(dt J) for every matrix, shape (m, k, k); equal ones are computed once."""
    from scipy.linalg import expm  # 0.1 s, which only coupled linear equations need

    k = jacobians.shape[-1]
    different, place = np.unique(jacobians.reshape(len(jacobians), -1), axis=0, return_inverse=True)
    extended = np.zeros((len(different), 2 * k, 2 * k))
    extended[:, :k, :k] = different.reshape(-1, k, k)
    extended[:, :k, k:] = np.eye(k)
    exponentials: FloatArray = expm(dt * extended)[:, :k, k:]
    return exponentials[place.reshape(-1)]


class RungeKutta:
    """The four stages of `rk4` for one system: slopes k, from states tried at the middle and at the end."""

    def __init__(self, system: System, table: Table) -> None:
        self.system = system
        self.trials = {name: table.take(system.count) for name in system.derivatives}
        self._slopes = [
            {name: table.take(system.count) for name in system.derivatives} for _ in range(STAGES)
        ]

    @property
    def states(self) -> Mapping[str, int]:
        """Rows of the states as they are tried; those that do not advance stand where they always do."""
        return {**self.system.states, **self.trials}

    def slope(self, stage: int, rows: Mapping[str, int]) -> Map:
        """Return the slopes of a stage, from 0; `rows` take the place of the system's own."""
        states = self.system.states if stage == 0 else self.states
        results = [(self._slopes[stage][name], slope) for name, slope in self.system.derivatives.items()]
        return replace(self.system, rows={**self.system.rows, **rows}).map(results, states)

    def trial(self, stage: int) -> Iterator[Map]:
        """Yield the states for the next stage, if there is one."""
        if stage == STAGES - 1:
            return
        time = Binary("*", Number(_FRACTIONS[stage]), Name(DT))
        slopes = {_slope(name): row for name, row in self._slopes[stage].items()}
        results = [
            (self.trials[name], _moved(name, time, Name(_slope(name)))) for name in self.system.derivatives
        ]
        yield replace(self.system, rows=slopes, picks={}).map(results)

    def result(self) -> Map:
        """Return the new states: x + dt / 6 (k1 + 2 k2 + 2 k3 + k4)."""
        rows = {
            f"{_slope(name)}{stage}": row
            for stage, slopes in enumerate(self._slopes)
            for name, row in slopes.items()
        }
        sixth = Binary("/", Name(DT), Number(6.0))
        results = []
        for name in self.system.derivatives:
            first, second, third, fourth = (Name(f"{_slope(name)}{stage}") for stage in range(STAGES))
            middle = Binary("*", Number(2.0), Binary("+", second, third))
            total = Binary("+", Binary("+", first, middle), fourth)
            results.append((self.system.states[name], _moved(name, sixth, total)))
        return replace(self.system, rows=rows, picks={}).map(results)


def _slope(name: str) -> str:
    return f"slope_{name}__"


def _moved(name: str, time: Expression, slope: Expression) -> Expression:
    return Binary("+", Name(name), Binary("*", time, slope))
