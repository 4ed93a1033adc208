"""What pictures and films tell of one run: who carried, where the ZMP was, what pushed it, how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from circuitkit.biped.thresholds import threshold_lines
from circuitkit.robots import RobotSpec
from circuitkit.simulation.disturbance import BodyPush

if TYPE_CHECKING:
    from circuitkit.simulation.run import Result

Array = NDArray[np.float64]

MM = 1e3  # lengths are shown in millimetres

_BEFORE_PUSH_S, _AFTER_PUSH_S = 2.0, 4.0
_AFTER_FALL_S = 0.15
_SHORTEST_ARROW_S = 0.2
_LEAST_LOAD_N = 1.0  # with less on both feet there is no ZMP


@dataclass(frozen=True)
class PushSpan:
    """A push as it was applied.

    Attributes:
        body: Number of the body in the robot's model.
        start_s: Its beginning.
        end_s: Its end.
        force: Largest force in it, world frame; shape (3,), [N].
    """

    body: int
    start_s: float
    end_s: float
    force: Array

    @property
    def size_n(self) -> float:
        """Its size."""
        return float(np.linalg.norm(self.force))

    def shown_at(self, time_s: float) -> bool:
        """Whether its arrow is shown at a time; a push too short to be seen is shown for longer."""
        return self.start_s <= time_s < max(self.end_s, self.start_s + _SHORTEST_ARROW_S)

    @property
    def text(self) -> str:
        """In words, such as `20 N to the left`."""
        axis = int(np.argmax(np.abs(self.force[:2])))
        words = (("forward", "backward"), ("to the left", "to the right"))[axis]
        return f"{self.size_n:.3g} N {words[int(self.force[axis] < 0)]}"


@dataclass(frozen=True)
class Story:
    """One robot's run; T ticks, row t is the end of tick t. Positions are from the middle between the feet.

    Attributes:
        controller: Name of the controller.
        step_s: The control step.
        time_s: Shape (T,).
        zmp_mm: ZMP_y by the force cells, not a number where no foot carries; shape (T,).
        pressure_mm: True centre of pressure, y; shape (T,).
        band_mm: Right and left edge of the support polygon by the measured load; shape (T, 2).
        lines_mm: Right and left threshold of the circuit; shape (T, 2).
        com_mm: y of the centre of mass; shape (T,).
        com_velocity_mm_s: Its velocity; shape (T,).
        com_height_m: Its mean height.
        tilt_deg: How far the torso leans from the vertical; shape (T,).
        missing: Whether the controller lacked a reading; shape (T,).
        pushes: In the order of their beginning.
        fall_s: When it fell; None if it did not.
        verdict: In words.
    """

    controller: str
    step_s: float
    time_s: Array
    zmp_mm: Array
    pressure_mm: Array
    band_mm: Array
    lines_mm: Array
    com_mm: Array
    com_velocity_mm_s: Array
    com_height_m: float
    tilt_deg: Array
    missing: NDArray[np.bool_]
    pushes: tuple[PushSpan, ...]
    fall_s: float | None
    verdict: str

    @property
    def title(self) -> str:
        """Controller and verdict."""
        return f"{self.controller}: {self.verdict}"

    @property
    def end_s(self) -> float:
        """When it ended, or a moment after the fall."""
        last = float(self.time_s[-1])
        return last if self.fall_s is None else min(last, self.fall_s + _AFTER_FALL_S)

    @property
    def window_s(self) -> tuple[float, float]:
        """The time around the first push that is worth a closer look; without a push, all of it."""
        if not self.pushes:
            return 0.0, self.end_s
        start = self.pushes[0].start_s
        return max(start - _BEFORE_PUSH_S, 0.0), min(start + _AFTER_PUSH_S, self.end_s)

    def upright(self) -> NDArray[np.bool_]:
        """Ticks before the fall; shape (T,)."""
        return self.time_s <= (np.inf if self.fall_s is None else self.fall_s)

    def pushed(self) -> NDArray[np.bool_]:
        """Ticks from the first push on; shape (T,)."""
        if not self.pushes:
            return np.zeros(len(self.time_s), dtype=bool)
        return self.time_s >= self.pushes[0].start_s


def tell(result: Result, robot: int = 0) -> Story:
    """The story of one robot of a result; its recording has at least one tick."""
    recording = result.recording
    layout = recording.robot.layout
    support = recording.support[:, robot]
    lines = threshold_lines(recording.yardstick or recording.circuit, result.scenario.thresholds)
    carried = recording.loads_n[:, robot].sum(axis=-1) > _LEAST_LOAD_N
    upward = recording.readings[:, robot, layout.torso_up.start + 2]
    zmp = recording.channel(result.scenario.thresholds.channel)[:, robot]
    missing: NDArray[np.bool_] = np.any(~np.isfinite(recording.observations[:, robot]), axis=1)
    return Story(
        controller=recording.controller,
        step_s=recording.walk.gait.control_step,
        time_s=recording.time_s,
        zmp_mm=np.where(carried, zmp * MM, np.nan),
        pressure_mm=recording.centre_of_pressure_m[:, robot, 1] * MM,
        band_mm=support_edges_m(recording.robot.spec)[support] * MM,
        lines_mm=lines[support] * MM,
        com_mm=recording.com_m[:, robot, 1] * MM,
        com_velocity_mm_s=recording.com_velocity[:, robot, 1] * MM,
        com_height_m=float(recording.com_m[: max(len(support) // 4, 1), robot, 2].mean()),
        tilt_deg=np.degrees(np.arccos(np.clip(upward, -1.0, 1.0))),
        missing=missing,
        pushes=find_pushes(recording.fates.pushes, robot, recording.ticks, recording.walk.gait.control_step),
        fall_s=result.verdict.time_of_fall_s,
        verdict=_verdict(result),
    )


def support_edges_m(robot: RobotSpec) -> Array:
    """Edges of the support polygon for feet side by side at the hips' distance, sideways.

    Returns:
        Shape (3, 2): on the left foot, on the right foot, on both; right edge, left edge; [m].
    """
    offset = robot.legs.hip_offset_y
    left, right = robot.feet.left.sole, robot.feet.right.sole
    left_foot = (offset + left.right, offset + left.left)
    right_foot = (-offset + right.right, -offset + right.left)
    return np.array([left_foot, right_foot, (right_foot[0], left_foot[1])])


def find_pushes(pushes: tuple[BodyPush, ...], robot: int, ticks: int, step_s: float) -> tuple[PushSpan, ...]:
    """The pushes on one robot that began before the end of the recording."""
    found = []
    for push in pushes:
        forces = push.forces[:, robot]
        active = np.concatenate([[False], np.linalg.norm(forces, axis=1) > 0, [False]])
        edges = np.flatnonzero(active[1:] != active[:-1])
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if push.first_tick + begin >= ticks:
                continue
            size = np.linalg.norm(forces[begin:end], axis=1)
            share = size / size.max()  # of its first and last tick a push may cover a part
            start_s = (push.first_tick + begin + 1 - share[0]) * step_s
            end_s = start_s + share.sum() * step_s
            found.append(PushSpan(push.body, float(start_s), float(end_s), forces[begin + np.argmax(size)]))
    return tuple(sorted(found, key=lambda span: span.start_s))


def _verdict(result: Result) -> str:
    if result.verdict.time_of_fall_s is not None:
        return f"fell at {result.verdict.time_of_fall_s:.2f} s"
    return "stood until interrupted" if result.recording.interrupted else "stood"
