"""Channels of the plan: what a walk intends, for circuits to set beside what the sensors say."""

from __future__ import annotations

from circuitkit.base.units import parse_unit
from circuitkit.biped.control.reference import WalkReference
from circuitkit.control import PlannedChannel


def planned_channels(reference: WalkReference) -> dict[str, PlannedChannel]:
    """`planned_com_*` and `planned_com_velocity_*`, the CoM of the plan's point mass (eq. 2).

    In the frame of the sensed channels `com_*`, the middle between the ankles, so that the difference of the
    two is how far the robot is from its plan. With the velocities over omega = sqrt(g / z_CoM) added it is
    the error of the DCM (capture point).
    """
    ticks = reference.walk.ticks
    com = reference.com_m - reference.sensed_com_offset_m
    found = {}
    for axis, letter in enumerate("xy"):
        found[f"planned_com_{letter}"] = PlannedChannel(parse_unit("m"), com[:ticks, axis])
        found[f"planned_com_velocity_{letter}"] = PlannedChannel(
            parse_unit("m/s"), reference.com_velocity[:ticks, axis]
        )
    return found
