"""Robots: from an MJCF and a robot file to batches of robots that follow a walk and can be pushed."""

from circuitkit.robots.model import RobotModel, build_model
from circuitkit.robots.mujoco_robot import (
    MujocoRobot,
    body_number,
    command_units,
    plan_robot_walk,
    robot_channels,
)
from circuitkit.robots.plant import Payload, Plant, Slope
from circuitkit.robots.spec import RobotSpec, load_robot, shipped_robots

__all__ = [
    "MujocoRobot",
    "Payload",
    "Plant",
    "RobotModel",
    "RobotSpec",
    "Slope",
    "body_number",
    "build_model",
    "command_units",
    "load_robot",
    "plan_robot_walk",
    "robot_channels",
    "shipped_robots",
]
