"""Recordings made up by hand: the ZMP, the loads and the lean of a robot, tick by tick."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from walking import nao

from circuitkit import parse_circuit
from circuitkit.biped.gait import Walk, load_gait, plan_walk
from circuitkit.simulation.disturbance import Fates, Trial
from circuitkit.simulation.recording import Recording

WEIGHT_N = 50.0
_OUTERMOST_M = 0.0799  # LFsrFL from the middle between the feet, and RFsrFR on the other side

# Edges at 20 and 80 mm on the left foot, -80 and -20 mm on the right one, -80 and 80 mm on both.
EDGES = """\
circuit: edges
control_step: 10 ms
timing: ordered
inputs:
  zmp_y: {unit: mm, range: [-150 mm, 150 mm]}
neurons:
  q1: {model: sigmoid, role: excitatory, slope: 100 /m, shift: 80 mm}
  q2: {model: sigmoid, role: excitatory, slope: 100 /m, shift: -20 mm}
  q3: {model: sigmoid, role: excitatory, slope: 100 /m, shift: -20 mm}
  q4: {model: sigmoid, role: excitatory, slope: 50 /m, shift: 160 mm}
  out: {model: sigmoid, role: excitatory, slope: 10, shift: 0.5}
synapses:
  - {from: zmp_y, to: [q1, q3], weight: -1}
  - {from: zmp_y, to: q2, weight: 1}
  - {from: zmp_y, to: q4, weight: 2}
  - {from: q1, to: out, weight: 1}
  - {from: q2, to: out, weight: 1}
  - {from: q3, to: out, weight: 1}
  - {from: q4, to: out, weight: 1}
outputs:
  ankle_roll: {unit: deg, readout: {out: 1 deg}}
"""


def edges():
    """The circuit of these edges."""
    return parse_circuit(EDGES, "edges.yaml")


@cache
def march() -> Walk:
    """Six seconds of marching."""
    return plan_walk(load_gait("gait_march"), nao().spec.legs.geometry(), 600)[0]


def recording(
    zmp_mm: Mapping[int, float] | float = 0.0,
    left_load: Mapping[int, float] | float = 0.5,
    lean_deg: Mapping[int, float] | float = 0.0,
    push_s: tuple[float, float] | None = None,
    ticks: int = 300,
) -> Recording:
    """One robot. Mappings hold what begins at a tick; the value 0, load 0.5 or lean 0 until the first one.

    Args:
        zmp_mm: ZMP of the force cells.
        left_load: Part of the weight on the left foot.
        lean_deg: Lean of the torso.
        push_s: When the push begins and ends.
        ticks: How long.
    """
    robot, walk = nao(), march()
    layout = robot.layout
    readings = np.zeros((ticks, 1, layout.width))
    zmp, left, lean = (_rows(v, start, ticks) for v, start in ((zmp_mm, 0), (left_load, 0.5), (lean_deg, 0)))
    lean = np.radians(lean)
    share = (1 + zmp * 1e-3 / _OUTERMOST_M) / 2
    cells = readings[:, 0, layout.forces]
    cells[:, layout.cells.index("LFsrFL")] = WEIGHT_N * share
    cells[:, layout.cells.index("RFsrFR")] = WEIGHT_N * (1 - share)
    for side, part in ((0, left), (1, 1 - left)):
        readings[:, 0, layout.wrench(side)][:, 2] = WEIGHT_N * part
        readings[:, 0, layout.wrench(side)][:, 7] = 0.05 - 0.1 * side
        readings[:, 0, layout.foot(side)] = [0, 0.05 - 0.1 * side, 0.045]
    readings[:, 0, layout.torso_up] = np.stack([np.sin(lean), 0 * lean, np.cos(lean)], axis=1)
    readings[:, 0, layout.com] = [0, 0, 0.27]
    window = (np.nan, np.nan) if push_s is None else push_s
    fates = Fates((), np.array([window]), np.zeros((1, 2)), None)
    nothing = np.zeros((ticks, 1, 0))
    qpos = np.zeros((ticks, 1, robot.model.nq))
    return Recording(
        walk, robot, (Trial(0, ()),), fates, "open_loop", edges(),
        readings, qpos, nothing, nothing, nothing, (), (), (),
    )  # fmt: skip


def _rows(values: Mapping[int, float] | float, start: float, ticks: int) -> np.ndarray:
    if not isinstance(values, Mapping):
        return np.full(ticks, float(values))
    rows = np.full(ticks, float(start))
    for tick, value in sorted(values.items()):
        rows[tick:] = value
    return rows
