"""Measures how clean a walk is: the figures by which a gait is judged, on an undisturbed run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.biped.gait import LEFT, RIGHT, GaitSpec
from circuitkit.biped.sensing import BipedView, centre_of_pressure
from circuitkit.paper.runs import record, without_pushes
from circuitkit.simulation import Plan, Recording

_UNLOADED = 0.05  # a swing foot with less than this part of the weight swings free
_SETTLED_STEPS = 2  # steps after which the walk counts


@dataclass(frozen=True)
class GaitFigures:
    """Figures of one walk.

    Attributes:
        fell: Whether the robot fell.
        inside_15mm: Of the time in which one foot carries more than 95 % of the weight, the part in which the
            centre of pressure is at least 15 mm inside that sole's edges, sideways.
        inside_10mm: The same for 10 mm.
        margin_5pct_m: What the distance to the edge exceeds in 95 % of that time.
        swing_free: Part of single support in which the swing foot carries less than 5 % of the weight.
        way_m: How far forward the robot went.
        drift_per_2m_m: How far sideways it went on each 2 m forward; 0 on the spot.
        ankle_rms_deg: What the controller added to the ankle roll, root of the mean square; 0 if nothing.
    """

    fell: bool
    inside_15mm: float
    inside_10mm: float
    margin_5pct_m: float
    swing_free: float
    way_m: float
    drift_per_2m_m: float
    ankle_rms_deg: float


def measure_gait(plan: Plan, controller: str = "open_loop", seed: int = 0) -> GaitFigures:
    """Walk for the scenario's duration without pushes and measure.

    Args:
        plan: The scenario's plan.
        controller: As in a scenario.
        seed: Of noise and jitter.
    """
    return gait_figures(record(plan, controller, [without_pushes(plan, seed)]))


def gait_figures(recording: Recording) -> GaitFigures:
    """Measure the first robot of an undisturbed recording."""
    view, walk, readings = BipedView(recording), recording.motion.knowledge.walk, recording.readings[:, 0]
    schedule = walk.schedule
    ticks = slice(0, recording.ticks)
    walking = schedule.step[ticks] >= _SETTLED_STEPS
    margins = []
    for side, name in ((LEFT, "left"), (RIGHT, "right")):
        point, _ = centre_of_pressure(readings, view.layout, side)
        sideways = point[:, 1] - readings[:, view.layout.foot(side)][:, 1]
        sole = getattr(view.block.feet, name).sole
        alone = walking & (view.support[:, 0] == side)
        margins.append(np.minimum(sideways - sole.right, sole.left - sideways)[alone])
    margin = np.concatenate(margins) if any(len(m) for m in margins) else np.full(1, -1.0)

    total = view.loads_n[:, 0].sum(axis=-1)
    swing = 1 - schedule.support[ticks]
    single = walking & (schedule.single_support[ticks] > 0)
    load = np.take_along_axis(view.loads_n[:, 0], np.clip(swing, 0, 1)[:, None], axis=1)[:, 0]
    free = (load < _UNLOADED * total)[single]

    torso = readings[:, view.layout.torso]
    commands = recording.commands[:, 0]
    return GaitFigures(
        fell=recording.ended_s() is not None,
        inside_15mm=float((margin >= 0.015).mean()),  # noqa: PLR2004 - as its name says
        inside_10mm=float((margin >= 0.010).mean()),  # noqa: PLR2004 - as its name says
        margin_5pct_m=float(np.percentile(margin, 5)),
        swing_free=float(free.mean()) if len(free) else 0.0,
        way_m=float(torso[-1, 0] - torso[0, 0]),
        drift_per_2m_m=_drift_per_2m(torso, walk.gait),
        ankle_rms_deg=float(np.degrees(np.sqrt((commands**2).mean()))) if commands.size else 0.0,
    )


def _drift_per_2m(torso: NDArray[np.float64], gait: GaitSpec) -> float:
    """Measure the drift on 2 m forward, between equal phases so that no sway counts; 0 on the spot."""
    start = gait.stand_ticks + _SETTLED_STEPS * gait.step_ticks
    cycle = 2 * gait.step_ticks
    cycles = (len(torso) - 1 - start) // cycle
    if gait.step_length == 0 or cycles < 1:
        return 0.0
    forward, sideways, _ = torso[start + cycles * cycle] - torso[start]
    return float(abs(sideways) / max(forward, 1e-9) * 2.0)
