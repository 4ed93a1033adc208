"""The walk: the paper's three movements (eqs. 3-10), the ZMP and the linear inverted pendulum."""

from circuitkit.gait.legs import LegGeometry
from circuitkit.gait.pattern import LEG_JOINTS, SIDES, Walk, plan_walk
from circuitkit.gait.schedule import LEFT, PHASES, RIGHT, Schedule
from circuitkit.gait.spec import GaitSpec, load_gait

__all__ = [
    "LEFT",
    "LEG_JOINTS",
    "PHASES",
    "RIGHT",
    "SIDES",
    "GaitSpec",
    "LegGeometry",
    "Schedule",
    "Walk",
    "load_gait",
    "plan_walk",
]
