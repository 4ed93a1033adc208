"""What MuJoCo warns of while it steps, and which of that makes the physics of a run invalid.

MuJoCo counts its warnings by kind in `mjData`, and goes on. Bad numbers (BADQPOS, BADQVEL, BADQACC, BADCTRL:
not a number, infinite, or beyond 1e10) and full buffers (CONTACTFULL, CNSTRFULL: contacts or constraints were
left out) leave a state that no physics leads to: from then on the run is invalid. Of the other kinds, such as
INERTIA, MuJoCo makes the best; they are counted and said.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

_PREFIX = "mjWARN_"
# Names of the kinds, in the order of MuJoCo's numbers; the last member of the enumeration is their count.
KINDS: tuple[str, ...] = tuple(
    name.removeprefix(_PREFIX) for name in mujoco.mjtWarning.__members__ if name.startswith(_PREFIX)
)
_NUMBERS = {"BADQPOS": "position", "BADQVEL": "velocity", "BADQACC": "acceleration"}


def invalidates(kind: str) -> bool:
    """Whether a warning of a kind makes a run invalid: bad numbers and full buffers do."""
    return kind.startswith("BAD") or kind.endswith("FULL")


INVALIDATES: NDArray[np.bool_] = np.array([invalidates(kind) for kind in KINDS])


def quiet_mujoco() -> None:
    """Have MuJoCo write no MUJOCO_LOG.TXT into the working directory, and print nothing by itself.

    It holds for the whole process. What MuJoCo warns of in a run is counted and told with the run.
    """
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()


def first_fault(model: mujoco.MjModel, warned: NDArray[np.int32], known: NDArray[np.int32]) -> str:
    """Why the physics of a robot has become invalid, in words, by what MuJoCo newly warned of.

    The kind that was counted most often came first: a bad acceleration makes the velocity bad, and that the
    position, each one check later.

    Args:
        model: The robot's model.
        warned: MuJoCo's counters now, by kind: its `info` and the number of warnings; shape (K, 2).
        known: The numbers of warnings before, by kind; shape (K,).
    """
    kind = int(np.argmax((warned[:, 1] - known) * INVALIDATES))
    return describe_warning(model, kind, int(warned[kind, 0]))


def describe_warning(model: mujoco.MjModel, kind: int, info: int) -> str:
    """A warning in words, with the joint or actuator that it is about; else in MuJoCo's own words."""
    name = KINDS[kind]
    if name in _NUMBERS:
        what = f"the {_NUMBERS[name]} of {_joint(model, info, position=name == 'BADQPOS')}"
    elif name == "BADCTRL":
        what = f"the control of actuator '{model.actuator(info).name}'"
    else:
        return f"{mujoco.mju_warningText(kind, info).rstrip('.')} ({name})"
    return f"{what} is not finite, or beyond {mujoco.mjMAXVAL:g} ({name})"


def _joint(model: mujoco.MjModel, number: int, *, position: bool) -> str:
    """The joint of a column of `qpos` or `qvel`."""
    joint = int(np.flatnonzero(model.jnt_qposadr <= number)[-1] if position else model.dof_jntid[number])
    return f"joint '{model.joint(joint).name}'"


def bad_position(model: mujoco.MjModel, column: int) -> str:
    """What is wrong with a column of `qpos` that is no finite number."""
    return f"the position of {_joint(model, column, position=True)} is not finite"


def bad_reading(model: mujoco.MjModel, sensor: int) -> str:
    """What is wrong with a sensor's reading that is no finite number."""
    return f"the reading of sensor '{model.sensor(sensor).name}' is not finite"


def counts_by_kind(counts: NDArray[np.int64]) -> dict[str, int]:
    """How often MuJoCo has warned, by the name of each kind of which it has; from shape (K,)."""
    return {name: int(count) for name, count in zip(KINDS, counts, strict=True) if count}
