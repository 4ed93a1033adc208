"""References: what the commands of a controller are added to, and the moments and channels that it brings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.registry import Registry
from circuitkit.base.source import Document, FileModel, describe
from circuitkit.control import Array, PlannedChannel
from circuitkit.robots import RobotModel, StartState, control_names, control_ranges


@dataclass(frozen=True)
class Moment:
    """A moment of a reference.

    Attributes:
        time_s: When it is.
        directions: Unit vectors of the directions that the reference knows then, world frame, such as
            `inward`; each of shape (3,).
    """

    time_s: float
    directions: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Motion:
    """What a reference wants of a robot, tick by tick.

    Attributes:
        targets: Controls; shape (T, nu), or (1, nu) for all ticks alike.
        start_qpos: Positions at the start; shape (nq,).
        planned: Channels that are known beforehand, T values each.
        columns: What is recorded beside them, T values each, such as the number of a step.
        knowledge: What controllers that are made for this reference may read.
        pace_s: Time after which the reference repeats itself; 0 if it does not.
        start: What it starts with beside the positions; as the robot file says if None.
    """

    targets: Array
    start_qpos: Array
    planned: Mapping[str, PlannedChannel] = field(default_factory=dict)
    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    knowledge: Any = None
    pace_s: float = 0.0
    start: StartState | None = None


@dataclass(frozen=True)
class NumbersFile:
    """A kind of file that a reference is made from.

    Attributes:
        folder: Where shipped ones lie, such as `sims/studies`.
        model: What such a file says.
    """

    folder: str
    model: type[FileModel]


class Reference:
    """Base of all references; this one holds the robot's start, as its file or keyframe says.

    Attributes:
        kind: The key in a scenario, as in `reference: {key: home}`.
        settings: Type of what stands behind the key.
        file: Where a file stands behind the key: what it says; the reference is then made by `cls(model)`, so
            that studies can change fields of the file. None where the settings stand in the scenario itself.
        name: For titles and messages.
        step_s: The control step that it was made for; None if any will do.
    """

    kind: ClassVar[str]
    settings: ClassVar[Any]
    file: ClassVar[NumbersFile | None] = None
    name: str = "hold"
    step_s: float | None = None

    @classmethod
    def read(cls, value: Any, beside: Document) -> Reference:  # noqa: ANN401, ARG003 - for others to use
        """Make it from what stands in a scenario.

        Args:
            value: What stands behind the key.
            beside: The scenario's file, whose folder relative paths start from.

        Raises:
            InputError: A file that it names is wrong or missing.
        """
        return cls()

    def require(self, robot: RobotModel) -> None:
        """See whether the robot is one that it can be for, before anything else is compared.

        Args:
            robot: The robot as it is known.

        Raises:
            InputError: It is not.
        """

    def moment(self, where: Mapping[str, Any], duration_s: float) -> Moment:  # noqa: ARG002 - for others
        """A moment by the reference's own words.

        Args:
            where: Such as `{step: 8, phase: lift, at: 0.4}`.
            duration_s: When the run ends.

        Raises:
            InputError: There is no such moment.
        """
        message = (
            f"found {dict(where)}; allowed: a time such as 5 s, for the reference '{self.name}' has no "
            "moments"
        )
        raise InputError(Problem("", 0, 0, "start", message))

    def at(self, time_s: float) -> Moment:
        """The moment at a time, with the directions that are known then."""
        return Moment(time_s)

    def motion(self, robot: RobotModel, ticks: int, step_s: float) -> Motion:  # noqa: ARG002 - others need them
        """What it wants of a robot.

        Args:
            robot: The robot as it is known.
            ticks: T.
            step_s: The control step.

        Raises:
            InputError: The robot lacks what it needs.
            SimulationError: The robot cannot do it.
        """
        return Motion(robot.held[np.newaxis], robot.start_qpos)


def require_motion(motion: Motion, reference: Reference, robot: RobotModel, ticks: int) -> None:
    """Refuse a motion that is none for this robot and run.

    Args:
        motion: What the reference wants.
        reference: Is named in complaints.
        robot: The robot.
        ticks: T.

    Raises:
        InputError: An array of it has another shape than it shall have, or numbers that are not finite; lists
            all that is wrong.
    """
    model, who = robot.model, f"the reference '{reference.name}' ({type(reference).__name__})"
    if not isinstance(motion, Motion):
        message = f"{who} gave {describe(motion)}; allowed: a Motion"
        raise InputError(Problem("", 0, 0, "reference", message))
    at_least = f"of shape ({ticks},)"
    wanted: list[tuple[str, Any, Sequence[tuple[int, ...]], str]] = [
        ("targets", motion.targets, [(1, model.nu), (ticks, model.nu)],
         f"of shape (1, {model.nu}) or ({ticks}, {model.nu}), a column for each control"),
        ("start_qpos", motion.start_qpos, [(model.nq,)], f"of shape ({model.nq},)"),
        *((f"planned.{name}", each.values, [(ticks,)], at_least) for name, each in motion.planned.items()),
        *((f"columns.{name}", values, [(ticks,)], at_least) for name, values in motion.columns.items()),
    ]  # fmt: skip
    problems = []
    for name, given, shapes, allowed in wanted:
        array = given if isinstance(given, np.ndarray) and given.dtype.kind in "fiu" else None
        if array is not None and array.shape in shapes and np.isfinite(array).all():
            continue
        if array is None:
            found = describe(given)
        elif array.shape not in shapes:
            found = f"an array of shape {array.shape}"
        else:
            row = int(np.argwhere(~np.isfinite(array))[0][0])
            found = f"{array[~np.isfinite(array)][0]} in row {row}"
        message = f"{who} gave {found} as {name}; allowed: an array of finite numbers {allowed}"
        problems.append(Problem("", 0, 0, "reference", message))
    if problems:
        raise InputError(*problems)


def percent(share: float) -> str:
    """A share in two digits, such as `12 %`, `0.44 %` or `100 %`."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"  # noqa: PLR2004 - two digits


def beyond_ranges(motion: Motion, robot: RobotModel) -> str:
    """Which controls a motion alone asks for that are beyond their ranges, and so cut; empty if none is."""
    low, high = control_ranges(robot)
    targets, found = motion.targets, []
    for i, name in enumerate(control_names(robot.model)):
        share = float(((targets[:, i] < low[i]) | (targets[:, i] > high[i])).mean())
        if share > 0:
            found.append(
                f"'{name}' for {targets[:, i].min():.6g} to {targets[:, i].max():.6g}, and its range is "
                f"{low[i]:.6g} to {high[i]:.6g} (in {percent(share)} of the run)"
            )
    return "; ".join(found)


REFERENCES: Registry[Reference] = Registry("references", Reference, "circuitkit.simulation.references")
