"""Searches the numbers of the shipped gaits; `python -m circuitkit.paper.gait_search` repeats it.

Only undisturbed walks count: pushes and circuits never enter, so the gait favours no controller. One set of
numbers must serve on the spot, at 2 and at 4 cm a step. What the gait files say of durations, knee and lift
stays. Searched are where the ZMP shall be, and when the swing foot rises and moves.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from circuitkit.base.errors import SimulationError
from circuitkit.biped.gait import GaitSpec, load_gait
from circuitkit.biped.references import GaitReference
from circuitkit.paper.gait_figures import GaitFigures, measure_gait
from circuitkit.simulation import load_scenario, make_plan

Array = NDArray[np.float64]

GAITS = ("gait_march", "gait_walk_2cm", "gait_walk_4cm")
WALK_S = 15.0
_IMPOSSIBLE = 100.0
# Name, smallest and largest value; metres, or parts of single support.
RANGES: Mapping[str, tuple[float, float]] = {
    "zmp_forward": (0.012, 0.032),
    "zmp_sideways": (0.048, 0.062),
    "lift_start": (0.0, 0.2),
    "lift_end": (0.8, 1.0),
    "swing_start": (0.1, 0.35),
    "swing_end": (0.65, 0.9),
}


def with_numbers(gait: GaitSpec, values: Mapping[str, float]) -> GaitSpec:
    """Copy a gait with other values for what is searched."""
    change: dict[str, Any] = {
        "zmp": gait.zmp.model_copy(
            update={"forward": values["zmp_forward"], "sideways": values["zmp_sideways"]}
        ),
        "lift": gait.lift.model_copy(update={"start": values["lift_start"], "end": values["lift_end"]}),
        "swing": gait.swing.model_copy(update={"start": values["swing_start"], "end": values["swing_end"]}),
    }
    return gait.model_copy(update=change)


def cost(figures: GaitFigures) -> float:
    """Rate how unclean a walk is: 0 is a ZMP that never leaves the middle and a swing foot that never drags.

    Distances count in centimetres, so that 1 cm less to the edge weighs as much as 10 % more drag, and as
    10 cm of drift on 2 m.
    """
    if figures.fell:
        return _IMPOSSIBLE
    return (
        (0.044 - figures.margin_5pct_m) * 100.0
        + (1.0 - figures.swing_free) * 10.0
        + figures.drift_per_2m_m * 10.0
    )


def evaluate(point: Array) -> float:
    """Walk with the three gaits at a point of the unit cube; their mean cost."""
    values = {
        name: low + (high - low) * float(x)
        for (name, (low, high)), x in zip(RANGES.items(), point, strict=True)
    }
    scenario = load_scenario("nao_push").model_copy(update={"duration": WALK_S})
    total = 0.0
    for name in GAITS:
        gait = with_numbers(load_gait(name), values)
        try:
            plan = make_plan(scenario.model_copy(update={"reference": GaitReference(gait)}))
        except SimulationError:  # a leg would have to be longer than it is
            total += _IMPOSSIBLE
            continue
        total += cost(measure_gait(plan))
    return total / len(GAITS)


def search(rounds: int, size: int, seed: int, workers: int) -> tuple[dict[str, float], float]:
    """Try Sobol points over the whole range, then over a box around the best that is halved each round.

    Args:
        rounds: How often.
        size: Points a round; a power of two.
        seed: Of the points.
        workers: Processes.

    Returns:
        The best values and their cost.
    """
    centre, width = np.full(len(RANGES), 0.5), 1.0
    best, best_cost = centre, np.inf
    with ProcessPoolExecutor(workers) as pool:
        for number in range(rounds):
            cube = qmc.Sobol(len(RANGES), rng=np.random.default_rng(seed + number)).random(size)
            points = np.clip(centre + (cube - 0.5) * width, 0.0, 1.0)
            costs = np.array(list(pool.map(evaluate, points)))
            if costs.min() < best_cost:
                best, best_cost = points[costs.argmin()], float(costs.min())
            centre, width = best, width / 2
            print(f"round {number}: cost {best_cost:.3f} {_values(best)}", flush=True)  # noqa: T201 - a script
    return _values(best), best_cost


def _values(point: Array) -> dict[str, float]:
    return {
        name: round(low + (high - low) * float(x), 4)
        for (name, (low, high)), x in zip(RANGES.items(), point, strict=True)
    }


def main() -> None:
    """Run the search and print what belongs into the gait files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--size", type=int, default=32, help="points a round, a power of two")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    values, lowest = search(arguments.rounds, arguments.size, arguments.seed, arguments.workers)
    print(f"lowest cost {lowest:.3f}")  # noqa: T201 - a script
    for name, value in values.items():
        print(f"{name}: {value}")  # noqa: T201 - a script


if __name__ == "__main__":
    main()
