"""Another MJCF of a NAO: every body, joint, site, geom and mesh has a name of its own."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import yaml

from circuitkit.robots import load_robot

_NAMED = ("body", "joint", "freejoint", "site", "geom")
_REFERENCES = {"joint": ("joint1", "joint2", "joint"), "body": ("body1", "body2")}


def shipped_file() -> dict:
    """The NAO's robot.yaml as data."""
    path = load_robot("nao").mjcf_path.with_name("robot.yaml")
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def shipped_mjcf() -> ET.ElementTree:
    """The NAO's MJCF."""
    return ET.parse(load_robot("nao").mjcf_path)


def write_robot(folder: Path, robot: dict, mjcf: ET.ElementTree) -> Path:
    """Write both files; returns the path of the robot file."""
    mjcf.write(folder / "other.xml")
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump({**robot, "mjcf": "other.xml"}), encoding="utf-8")
    return path


def rename_everything(mjcf: ET.ElementTree) -> dict[str, str]:
    """Give each named part of the MJCF another name; returns the new name of each old one."""
    new: dict[str, str] = {}
    for element in mjcf.getroot().find("worldbody").iter():
        if element.tag in _NAMED and "name" in element.attrib:
            new[element.attrib["name"]] = f"teil_{len(new)}"
            element.attrib["name"] = new[element.attrib["name"]]
    for element in mjcf.getroot().find("equality"):
        for kinds in _REFERENCES.values():
            for reference in kinds:
                if reference in element.attrib:
                    element.attrib[reference] = new[element.attrib[reference]]
    return new


def renamed_robot(folder: Path) -> Path:
    """The NAO under other names: an MJCF without any of the old ones, and the robot file for it."""
    mjcf, robot = shipped_mjcf(), shipped_file()
    joints = [joint.attrib["name"] for joint in mjcf.getroot().find("worldbody").iter("joint")]
    new = rename_everything(mjcf)
    biped = robot["biped"]
    biped["torso"], biped["imu"] = new[biped["torso"]], new[biped["imu"]]
    for foot in biped["feet"].values():
        foot["body"] = new[foot["body"]]
    biped["joints"] = {role: new[name] for role, name in biped["joints"].items()}
    robot["hold"] = {new[name]: angle for name, angle in robot["hold"].items()}
    for profile in robot["servos"].values():
        for servo in profile:
            servo["joints"] = [
                new[name] for name in joints for pattern in servo["joints"] if Path(name).match(pattern)
            ]
    return write_robot(folder, robot, mjcf)
