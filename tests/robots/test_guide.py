"""The guide for robots of others: its example works, and it leaves nothing out."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from circuitkit.base.source import data_folder
from circuitkit.robots import build_model, load_robot, shipped_robots
from circuitkit.robots.parts import REFERENCES
from circuitkit.robots.spec import ChannelSpec, CommandSpec, Robot, Servo
from circuitkit.robots.starter import write_robot_starter
from circuitkit.simulation import compare

PAGE = Path(__file__).parents[2] / "docs" / "robots" / "README.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture
def example(tmp_path):
    """The folder with the example's files."""
    files = re.findall(
        r"^```(?:yaml|xml)\n(?:# |<!-- )(\S+\.(?:yaml|xml))(?: -->)?\n(.*?)^```", TEXT, re.M | re.S
    )
    assert [name for name, _ in files] == ["pole.xml", "pole.yaml", "balance.yaml"]
    for name, content in files:
        (tmp_path / name).write_text(content, encoding="utf-8")
    return tmp_path


def test_the_circuit_balances_the_pole_and_nobody_else_does(example):
    """The pole falls within two seconds: it leans e times more every sqrt(2 l / 3 g) = 0.23 s."""
    alone, held = compare(example / "balance.yaml", ["open_loop", "circuit"])
    assert not alone.survived
    assert alone.recording.ended_s() < 3
    assert held.survived
    assert held.measures["furthest"] < 1.5
    assert held.measures["tip_height"] > 0.7


def test_the_started_file_names_the_motor_and_its_limits(example):
    text = write_robot_starter(example / "pole.xml", example / "started.yaml").read_text(encoding="utf-8")
    assert '  track_command: {unit: "1", to: {track: 1}, limits: [-1, 1]}' in text
    robot = build_model(load_robot(example / "started.yaml"))
    assert set(robot.channels) >= {"track", "track_rate", "hinge", "hinge_rate", "cart_x"}


def test_the_guide_names_every_key_and_every_reference():
    for reference in REFERENCES.values():
        assert f"`{reference.usage.partition('(')[0]}(" in TEXT, reference.usage
    for model in (Robot, ChannelSpec, CommandSpec, Servo):
        for name, field in model.model_fields.items():
            assert re.search(rf"\b{field.alias or name}\b", TEXT), name


def test_the_guide_lists_every_robot_that_has_a_page():
    pages = {path.stem for path in PAGE.parent.glob("*.md")} - {"README"}
    assert set(re.findall(r"\]\((\w+)\.md\)", TEXT)) == pages
    assert {path.parent.name for path in data_folder("robots").glob("*/robot.yaml")} == set(shipped_robots())
