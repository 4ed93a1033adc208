"""The predictive controller's quadratic program: the time of a solve, and against the circuit's step.

Every solve is one whole optimum over the preview, from states along a walk that pushes have moved; nothing of
the solve before is used. Both sides are told what to do from Python.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
from itertools import cycle, islice

import numpy as np

from circuitkit.base.errors import MissingDependencyError
from circuitkit.biped.control.jerk_mpc import OWN, BoxSolver, JerkMpc, box_solver
from circuitkit.biped.control.wieber_mpc import WieberMpcSpec
from circuitkit.control import load_controller
from circuitkit.paper.reproduce.timing import mpc_solves, network_steps
from circuitkit.simulation import Plan, load_scenario, make_plan
from circuitkit.study.bench import Amount, AnyCase, Case, LeftOutError, Loop

_CIRCUIT = "binn_lateral_tuned"
_SOLVES = 200
_CONTROL_STEP_S = 10e-3
_HALF_SOLE_M, _SPREAD_M = 0.044, 0.03


def cases() -> tuple[AnyCase, ...]:
    """A solve in seconds, against a circuit's step, and through qpsolvers."""
    name = load_controller("mpc_full").controller
    return (
        Amount(f"{name}: one solve", "s", _one, limit=_CONTROL_STEP_S),
        Case(f"{name}: one solve, against a circuit", f"one step of {_CIRCUIT}", _against_the_circuit),
        Case(f"{name}: one solve, daqp called directly", "through qpsolvers", _through_qpsolvers, limit=1.0),
    )


@cache
def _plan() -> Plan:
    return make_plan(load_scenario("nao_push").with_disturbances(()))


def _solves(name: str = "mpc_full") -> Callable[[int], object]:
    try:
        return mpc_solves(name, _plan())
    except MissingDependencyError as error:
        raise LeftOutError(str(error)) from error


def _one() -> Callable[[], float]:
    solves = _solves()

    def measure() -> float:
        begin = time.perf_counter()
        solves(_SOLVES)
        return (time.perf_counter() - begin) / _SOLVES

    return measure


def _against_the_circuit() -> tuple[Loop, Loop]:
    return Loop(_solves()), Loop(network_steps(_CIRCUIT, "auto"))


def _through_qpsolvers() -> tuple[Loop, Loop]:
    """The same solver, hessian and bounds; bounds as they are around the ZMPs of a pushed walk."""
    spec, reference = load_controller("mpc_full"), _plan().body.motion.knowledge
    if not isinstance(spec, WieberMpcSpec):
        message = f"{spec.controller} is no wieber_mpc"
        raise LeftOutError(message)
    try:
        mpc = JerkMpc(reference.com_height_m, spec.preview_step, spec.preview_steps, spec.zmp_weight)
        solvers = [box_solver(OWN, mpc.hessian, direct=direct) for direct in (True, False)]
    except MissingDependencyError as error:
        raise LeftOutError(str(error)) from error
    rng = np.random.default_rng(0)
    middles = rng.normal(0.0, _SPREAD_M, (_SOLVES, spec.preview_steps))

    def loop(solve: BoxSolver) -> Loop:
        def solves(count: int) -> None:
            for middle in islice(cycle(middles), count):
                solve(middle - _HALF_SOLE_M, middle + _HALF_SOLE_M)

        return Loop(solves)

    own, wrapped = solvers
    return loop(own), loop(wrapped)
