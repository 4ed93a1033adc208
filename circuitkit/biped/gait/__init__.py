"""The walk: the paper's three movements (eqs. 3-10), the ZMP and the linear inverted pendulum."""

from circuitkit.biped.gait.pattern import LEG_JOINTS, SIDES, LegGeometry, Walk, plan_walk
from circuitkit.biped.gait.schedule import LEFT, PHASES, RIGHT, GaitSpec, Schedule, load_gait

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
