"""Stepping beside the ankles: a foot is put where the capture point asks for it; a circuit says who acts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from circuitkit.base.errors import InputError, Problem, listing
from circuitkit.base.source import find_data_file
from circuitkit.base.source.fields import Metres, Ratio, Seconds
from circuitkit.base.units import parse_unit
from circuitkit.biped.control.reference import WalkReference, gait_knowledge
from circuitkit.biped.control.sensed_com import CommandAxis, SensedCom
from circuitkit.biped.gait import LEFT, RIGHT
from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.circuit.parts import FOLDER
from circuitkit.control import Array, CircuitController, ControllerSpec, Interface

_LEGS = ("left_foot_y", "right_foot_y", "left_leg_lift", "right_leg_lift")
_SIDES = np.array([1.0, -1.0])  # which way is outward: left foot, right foot

# What the circuit that decides is told, and what it answers.
HAND_OVER_INPUTS = {name: parse_unit("m") for name in ("dcm_y", "left_limit", "right_limit")}
HAND_OVER_OUTPUTS = {name: parse_unit("1") for name in ("ankle_share", "step_share_left", "step_share_right")}


def holdable_dcm(
    low_m: Array, high_m: Array, omega: float, step_s: float, horizon: int | None = None
) -> tuple[Array, Array]:
    """Between which DCMs the ankles alone can hold the walk, tick by tick, with its feet as planned.

    The DCM runs away from the ZMP, xi' = omega (xi - z), so over one control step
    xi_(k+1) = z + (xi_k - z) e^(omega dt). It can be held from tick k on if a ZMP within the support takes it
    to where it can be held from tick k + 1 on; backwards from the end, where it must be above the support,

        left_k = high_k + (left_(k+1) - high_k) e^(-omega dt),   right_k the same with low_k.

    This is the viability kernel of the linear inverted pendulum (P.-B. Wieber, "On the stability of walking
    systems", 2002; the 0-step and N-step capture regions of T. Koolen et al., Int. J. Robotics Research 31,
    2012), with feet and times as planned.

    Args:
        low_m: Lower end of the support, sideways; shape (R,).
        high_m: Upper end; shape (R,).
        omega: sqrt(g / z_CoM), [rad/s].
        step_s: dt.
        horizon: R or less: only the first so many ticks are wanted.

    Returns:
        Largest and smallest DCM that can be held; each of shape (R,), [m].
    """
    decay = math.exp(-omega * step_s)
    left, right = high_m.copy(), low_m.copy()
    for k in range(len(left) - 2, -1, -1):
        left[k] = high_m[k] + (left[k + 1] - high_m[k]) * decay
        right[k] = low_m[k] + (right[k + 1] - low_m[k]) * decay
    return left[:horizon], right[:horizon]


def dcm_at_end(dcm_m: Array, zmp_m: float, time_left_s: float, omega: float) -> Array:
    """Xi_end = z + (xi - z) e^(omega t): where the DCM will be in t if the ZMP stays at z; any shape, [m]."""
    return zmp_m + (dcm_m - zmp_m) * math.exp(omega * time_left_s)


class CaptureStepSpec(ControllerSpec):
    """Puts a foot where the capture point asks for it, beside a circuit of the ankles."""

    kind: ClassVar[str] = "capture_step"

    ankle_circuit: str = Field(description="The circuit of the ankles: a shipped one or a path.")
    hand_over: str = Field(description="The circuit that decides who acts: a shipped one or a path.")
    reach_outward: Metres = Field(ge=0, le=0.12, description="Furthest that a foot is put outward.")
    reach_inward: Metres = Field(ge=0, le=0.02, description="Furthest that it is put towards the other one.")
    stretch: Ratio = Field(
        ge=0,
        le=1,
        description="Part of the knee's bend that a leg gives up when it reaches furthest outward.",
    )
    push_off: Ratio = Field(
        ge=0, le=1, description="Part of the step that the leg on the side of the fall does while it carries."
    )
    blend_back: Seconds = Field(gt=0, description="Time constant with which a foot comes back in its swing.")

    def circuits(self) -> dict[str, CircuitGraph]:
        """Both circuits, by the names of the fields.

        Raises:
            InputError: One is missing or wrong, or the one that decides lacks an output.
        """
        ankles = load_circuit(self.ankle_circuit)
        return {"ankle_circuit": ankles, "hand_over": _deciding(self.hand_over)}

    def bind(self, interface: Interface) -> CaptureStep:
        """The controller for a walk.

        Raises:
            InputError: A circuit is missing, wrong, or does not fit.
        """
        return CaptureStep(self, gait_knowledge(interface.reference, self.controller))


@dataclass(frozen=True)
class _Plan:
    """What the step law knows of each tick of the walk; T ticks.

    Attributes:
        dcm_m: DCM of the plan; shape (T,).
        left_m: Furthest left that the ankles can hold; shape (T,).
        right_m: Furthest right; shape (T,).
        zmp_m: ZMP of the plan; shape (T,).
        end_dcm_m: DCM of the plan when the next foot takes over; shape (T,).
        time_left_s: Until then; shape (T,).
        swinging: The foot in the air: `LEFT`, `RIGHT`, or -1 where there is none; shape (T,).
        carrying: The foot to stand on, the same way; shape (T,).
    """

    dcm_m: Array
    left_m: Array
    right_m: Array
    zmp_m: Array
    end_dcm_m: Array
    time_left_s: Array
    swinging: NDArray[np.int64]
    carrying: NDArray[np.int64]


def _plan(reference: WalkReference) -> _Plan:
    schedule, dt = reference.schedule, reference.step_s
    ticks = reference.walk.ticks
    left, right = holdable_dcm(reference.low_m[:, 1], reference.high_m[:, 1], reference.omega, dt, ticks)
    dcm = reference.dcm_m[:, 1]
    step = schedule.step[:ticks]
    end = np.minimum(np.searchsorted(schedule.step, step, side="right"), len(dcm) - 1)
    carrying = schedule.support[:ticks]
    alone = (schedule.single_support[:ticks] > 0) & (schedule.single_support[:ticks] < 1)
    return _Plan(
        dcm[:ticks],
        left,
        right,
        schedule.zmp_m[:ticks, 1],
        dcm[end],
        np.asarray((end - np.arange(ticks)) * dt, dtype=np.float64),
        np.where(alone, LEFT + RIGHT - carrying, -1),
        carrying,
    )


def _deciding(name: str) -> CircuitGraph:
    """The circuit that decides.

    Raises:
        InputError: It is missing, wrong, or lacks an output.
    """
    graph = load_circuit(name)
    given = {node.name for node in graph.outputs}
    if missing := [output for output in HAND_OVER_OUTPUTS if output not in given]:
        message = (
            f"missing {listing(missing)}; required of a circuit that decides: {listing(HAND_OVER_OUTPUTS)}"
        )
        raise InputError(Problem(str(find_data_file(name, FOLDER)), 1, 1, "outputs", message))
    return graph


class CaptureStep:
    """Ankles for what they can hold, a step for what they cannot; a circuit decides.

    The law of the step, from the linear inverted pendulum. With the ZMP at z the DCM (capture point)
    xi = y + y' / omega will be at xi_end = z + (xi - z) e^(omega t) when the next foot takes over in t. The
    walk goes on as planned, relative to its feet, if the next foot stands as far from its plan as the DCM:

        delta = xi_end - xi_end_planned = (xi - xi_planned) e^(omega t),

    the second with z as planned. This is the foot placement of J. Pratt et al., "Capture point: a step toward
    humanoid push recovery" (Humanoids 2006), in the form of J. Englsberger et al., "Bipedal walking control
    based on capture point dynamics" (IROS 2011), with the times of the steps left alone. When the ankles do
    without is B. Stephens, "Humanoid push recovery" (Humanoids 2007).

    Of the two legs the one on the side of the fall does it. It goes outward by delta, as far as it can reach,
    and its knee stretches on the way, because the ground is further from a leg that is spread and from the
    lower side of a body that tips. As the swing leg it lands there. If it carries, as the body falls over
    the foot on which it stands, it pushes off the ground by a part of that, and the swing leg comes inward. A
    foot that was put down stays where it is while it carries, with its offset; in its next swing the offset
    decays with the time constant `blend_back`.

    The DCM is that of the true CoM, from the foot that carries (`SensedCom`). What the ankles can hold is
    `holdable_dcm`. Where a reading is missing (not a number), so are the commands that need it.
    """

    def __init__(self, spec: CaptureStepSpec, reference: WalkReference) -> None:
        """Bind the numbers to a walk, and compile both circuits."""
        self.name = spec.controller
        step_s, body = reference.step_s, reference.body
        circuits = spec.circuits()
        leaning = {name: unit for name, unit in body.commands.items() if name not in _LEGS}
        known = Interface(body.observations, leaning, step_s, reference.planned_channels())
        self._ankles = CircuitController(circuits["ankle_circuit"]).bind(known)
        deciding = Interface(HAND_OVER_INPUTS, HAND_OVER_OUTPUTS, step_s)
        self._decision = CircuitController(circuits["hand_over"]).bind(deciding)
        inner = {"ankle_circuit": self._ankles, "hand_over": self._decision}
        self.backends = {key: backend for key, each in inner.items() for backend in each.backends.values()}
        self._for_shares = [self._decision.commands.index(name) for name in HAND_OVER_OUTPUTS]
        self._sensed = SensedCom(reference, [CommandAxis("lateral")])
        self.observations = tuple(dict.fromkeys((*self._sensed.observations, *self._ankles.observations)))
        self._for_ankles = [self.observations.index(name) for name in self._ankles.observations]
        self.commands = (*self._ankles.commands, *_LEGS)
        self.trace_names = (
            "dcm_error_y", "step_y", *self._decision.observations, *HAND_OVER_OUTPUTS,
            *self._decision.trace_names, *self._ankles.trace_names,
        )  # fmt: skip
        self._spec, self._omega, self._plan = spec, reference.omega, _plan(reference)
        walk = reference.walk
        self._leg_m = float(walk.pelvis_m[0, 2] - body.legs.ankle_height_m)
        self._lift_per_m = spec.stretch * walk.gait.knee / 2 / max(spec.reach_outward, 1e-9)
        self._keep = math.exp(-step_s / spec.blend_back)
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self._tick = 0
        self._ankles.reset(batch)
        self._decision.reset(batch)
        self._ankle_trace = np.zeros((batch, len(self._ankles.trace_names)))
        self._decision_trace = np.zeros((batch, len(self._decision.trace_names)))
        self._offset_m = np.zeros((batch, 2))  # of each foot, outward

    def seed_noise(self, seeds: Sequence[int]) -> None:
        """Let the noise of both circuits follow from the robots' seeds."""
        self._ankles.seed_noise(seeds)
        self._decision.seed_noise(seeds)

    def step(self, observation: Array) -> Array:
        """Commands of the ankles' circuit, then sideways angle and lift of both legs; shape (B, m), [rad]."""
        plan, tick = self._plan, self._tick
        self._tick += 1
        lean = self._ankles.step(observation[:, self._for_ankles])
        position, velocity = self._sensed.read(tick, observation)
        dcm = (position + velocity / self._omega)[:, 0]
        known = {"dcm_y": dcm, "left_limit": plan.left_m[tick], "right_limit": plan.right_m[tick]}
        told = np.column_stack(
            [np.broadcast_to(known[name], dcm.shape) for name in self._decision.observations]
        )
        shares = self._decision.step(told)[:, self._for_shares]
        delta = dcm_at_end(dcm, plan.zmp_m[tick], plan.time_left_s[tick], self._omega) - plan.end_dcm_m[tick]
        there = np.isfinite(dcm)
        self._offset_m[there] = self._placed(tick, delta, shares)[there]
        command = np.column_stack([lean * shares[:, :1], self._leg_angles()])
        error = dcm - plan.dcm_m[tick]
        self._shown = np.column_stack([error, delta, told, shares])
        return np.where(there[:, None], command, np.nan)

    def store_trace(self, row: Array) -> None:
        """Write the DCM's error, the step law, what decides and is decided, and the neurons; shape (B, n)."""
        self._decision.store_trace(self._decision_trace)
        self._ankles.store_trace(self._ankle_trace)
        row[...] = np.column_stack([self._shown, self._decision_trace, self._ankle_trace])

    def _placed(self, tick: int, delta_m: Array, shares: Array) -> Array:
        """Where the feet shall be, outward of their plan; shape (B, 2), [m].

        Args:
            tick: Of the walk.
            delta_m: What the step law asks for, to the left; shape (B,).
            shares: Output of the circuit that decides; shape (B, 3).
        """
        spec, plan = self._spec, self._plan
        placed = self._offset_m.copy()
        asked = np.clip(delta_m[:, None] * _SIDES, -spec.reach_inward, spec.reach_outward)
        swing, stance = plan.swinging[tick], plan.carrying[tick]
        if swing >= 0:
            share = shares[:, 1] + shares[:, 2]
            placed[:, swing] = share * asked[:, swing] + (1.0 - share) * placed[:, swing] * self._keep
        if stance >= 0:
            pushed = shares[:, 1 + stance] * spec.push_off * asked[:, stance]
            placed[:, stance] = np.maximum(placed[:, stance], pushed)
        return placed

    def _leg_angles(self) -> Array:
        """Sideways angle and lift of both legs; shape (B, 4), [rad].

        A leg of length l whose foot is d further out hangs at asin(d / l); its knee's bend is given up in
        proportion to d.
        """
        sideways = _SIDES * np.arcsin(np.clip(self._offset_m / self._leg_m, -1.0, 1.0))
        lift = -self._lift_per_m * np.maximum(self._offset_m, 0.0)
        return np.column_stack([sideways, lift])
