"""The grid behind the numbers of `binn_lateral_tuned`; `python -m circuitkit.study.lateral_grid` repeats it.

Each set of parameters is pushed on seeds that no result uses: 20 and 23 N for 0.2 s inward at three moments
of `lift`, and five pushes of other directions and durations, on the spot and at 2 cm a step. What counts is
the part of the runs in which the robot stands.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from circuitkit.circuit import load_circuit, resolve
from circuitkit.simulate import Plan, load_scenario
from circuitkit.simulate.disturbance import Trial
from circuitkit.simulate.loop import run_to_see_who_stands
from circuitkit.study.push_limits import plan_for_pushes

CIRCUIT = "binn_lateral_tuned"
GAITS = ("gait_march", "gait_walk_2cm")
TRAINING_SEEDS = range(100, 105)
GRID: Mapping[str, Sequence[str]] = {
    "w": ("-0.3 deg", "-0.5 deg", "-0.8 deg"),
    "leak": ("2 %", "4 %", "8 %"),
    "margin": ("0 mm", "4 mm"),
    "one_foot": ("0.5", "0.9"),
}
_MOMENTS = (0.1, 0.2, 0.3)
_INWARD_N = (20.0, 23.0)
_OTHERS = (
    ("outward", 0.1, 17.0),
    ("outward", 0.2, 10.0),
    ("outward", 0.4, 6.0),
    ("inward", 0.1, 40.0),
    ("inward", 0.4, 13.0),
)


def combinations() -> Iterator[dict[str, str]]:
    """Every set of parameters of the grid."""
    for values in itertools.product(*GRID.values()):
        yield dict(zip(GRID, values, strict=True))


def score(
    plans: Sequence[Plan], parameters: Mapping[str, str], seeds: Sequence[int] = TRAINING_SEEDS
) -> float:
    """Part of the pushes after which the robot stands, over all plans."""
    circuit = resolve(load_circuit(CIRCUIT), parameters)
    stood = [
        run_to_see_who_stands(replace(plan, circuit=circuit).setup("circuit", _trials(plan, seeds)))
        for plan in plans
    ]
    return float(np.mean(stood))


def _trials(plan: Plan, seeds: Sequence[int]) -> list[Trial]:
    push = plan.scenario.pushes[0]
    pushes = [
        push.model_copy(
            update={
                "start": push.start.model_copy(update={"at": moment}),
                "force": force,
                "duration": 0.2,
                "direction": "inward",
            }
        )
        for moment in _MOMENTS
        for force in _INWARD_N
    ]
    pushes += [
        push.model_copy(update={"direction": direction, "duration": duration, "force": force})
        for direction, duration, force in _OTHERS
    ]
    return [Trial(seed, (each,)) for each in pushes for seed in seeds]


def main() -> None:
    """Score the whole grid and print it, best first."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    plans = [plan_for_pushes(load_scenario("nao_push"), gait) for gait in GAITS]
    rows = []
    for parameters in combinations():
        rows.append((score(plans, parameters), parameters))
        print(f"{rows[-1][0]:.3f} {parameters}", flush=True)  # noqa: T201 - a script
    best, parameters = max(rows, key=lambda row: row[0])
    print(f"best: {best:.3f} {parameters}")  # noqa: T201 - a script


if __name__ == "__main__":
    main()
