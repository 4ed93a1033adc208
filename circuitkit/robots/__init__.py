"""Robots: from an MJCF and a robot file to channels, commands, and batches of robots in MuJoCo."""

from circuitkit.robots.channels import Channel, Observer
from circuitkit.robots.limits import TickLog, control_names, control_ranges
from circuitkit.robots.model import Command, RobotModel, build_model
from circuitkit.robots.spec import Robot, load_robot, shipped_robots
from circuitkit.robots.start import StartState
from circuitkit.robots.validity import quiet_mujoco
from circuitkit.robots.worlds import Worlds

__all__ = [
    "Channel",
    "Command",
    "Observer",
    "Robot",
    "RobotModel",
    "StartState",
    "TickLog",
    "Worlds",
    "build_model",
    "control_names",
    "control_ranges",
    "load_robot",
    "shipped_robots",
]

quiet_mujoco()
