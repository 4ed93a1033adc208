"""Recordings made up by hand: the ZMP, the loads and the lean of a robot, tick by tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
from walking import a_push, nao, nao_body, scenario

from circuitkit import parse_circuit
from circuitkit.biped.gait import Walk, load_gait, plan_walk
from circuitkit.biped.thresholds import ThresholdMeasure, Thresholds, threshold_lines
from circuitkit.control import Array
from circuitkit.robots import TickLog
from circuitkit.simulation import Motion, Recording, Reference, RunSpec
from circuitkit.simulation.disturbance import draw_effects
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.formula_parser import parse_measure
from circuitkit.simulation.measures import Judge, Tracker

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
    return plan_walk(load_gait("gait_march"), nao_body().block.legs.geometry(), 600)[0]


@cache
def standing() -> Motion:
    """What the posture of the robot file wants of the servos; its moments are plain times."""
    return replace(Reference().motion(nao(), 1, 0.01), pace_s=0.55)


def thresholds() -> Thresholds:
    """Those of the shipped walk."""
    (found,) = scenario().measure_kinds
    return found


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
    readings = np.zeros((ticks, 1, nao().model.nsensordata))
    layout = nao_body().layout
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
    spec = RunSpec(0, () if push_s is None else (_push(push_s),))
    return judged(readings, (spec,))


def judged(readings: Array, specs: tuple[RunSpec, ...]) -> Recording:
    """A recording of these readings, judged as a walk with the edges above is."""
    ticks, batch, _ = readings.shape
    effects = draw_effects(specs, nao(), Reference(), ticks, 0.01)
    judge = judge_of_edges()
    tracker = Tracker(nao(), standing(), effects, judge, (), step_s=0.01, ticks=ticks, cut=TickLog())
    nothing = np.zeros((ticks, batch, 0))
    qpos = np.zeros((ticks, batch, nao().model.nq))
    tracker.look(readings, nothing, qpos)
    return Recording(
        robot=nao(), motion=standing(), specs=specs, effects=effects, controller="open_loop", circuit=edges(),
        step_s=0.01, judge=judge, readings=readings, qpos=qpos,
        observations=nothing, commands=nothing, trace=nothing, observation_names=(), command_names=(),
        trace_names=(), measures=tracker.measures(), end_tick=tracker.end_tick,
    )  # fmt: skip


@cache
def judge_of_edges() -> Judge:
    """The measures of the shipped walk, with the edges above."""
    shipped = scenario()
    units = nao().channel_units
    formulas = {name: parse_measure(text, units) for name, text in shipped.formulas.items()}
    lines = ThresholdMeasure("zmp_y", threshold_lines(edges(), thresholds()))
    return Judge(formulas, (lines,), parse_measure(shipped.until, units))


def _push(span_s: tuple[float, float]) -> Push:
    return a_push(start=span_s[0], duration=span_s[1] - span_s[0], direction="left")


def _rows(values: Mapping[int, float] | float, start: float, ticks: int) -> np.ndarray:
    if not isinstance(values, Mapping):
        return np.full(ticks, float(values))
    rows = np.full(ticks, float(start))
    for tick, value in sorted(values.items()):
        rows[tick:] = value
    return rows
