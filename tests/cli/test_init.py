"""`circuitkit init`."""

from __future__ import annotations

from pathlib import Path

from circuitkit.circuit.authoring.starter import TEMPLATES
from circuitkit.robots import load_robot


def test_a_starter_is_written_and_runs(circuitkit):
    outcome = circuitkit("init")
    assert (outcome.code, outcome.out) == (0, "")
    assert outcome.err == (
        "wrote circuit.yaml\nwrote circuit.schema.json\n"
        "next: circuitkit validate circuit.yaml; what else to try stands at the top of the file\n"
    )
    assert circuitkit("validate", "circuit.yaml").out == "circuit.yaml: valid\n"
    assert circuitkit("run", "circuit.yaml", "--steps", "3").code == 0


def test_a_file_that_is_there_is_left(circuitkit):
    Path("mine.yaml").write_text("precious", encoding="utf-8")
    outcome = circuitkit("init", "mine.yaml")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == "'mine.yaml' exists already; name another file, or overwrite it with --force\n"
    assert Path("mine.yaml").read_text(encoding="utf-8") == "precious"
    assert circuitkit("init", "mine.yaml", "--force").code == 0


def test_the_help_names_every_template(circuitkit):
    out = circuitkit("init", "--help").out
    assert all(template in out for template in TEMPLATES)


def test_an_unknown_template(circuitkit):
    outcome = circuitkit("init", "mine.yaml", "--from", "reflx")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err.startswith("unknown template 'reflx'; allowed: ")
    assert not Path("mine.yaml").exists()


def test_where_nothing_can_be_written(circuitkit):
    Path("file").write_text("", encoding="utf-8")
    outcome = circuitkit("init", "file/mine.yaml")
    assert outcome.code == 3
    assert outcome.err.startswith("cannot write 'file/mine.yaml': ")
    Path("folder.yaml").mkdir()
    outcome = circuitkit("init", "folder.yaml")
    assert (outcome.code, outcome.err) == (
        3,
        "cannot write 'folder.yaml': it is a folder; name a file in it\n",
    )


MJCF = """
<mujoco>
  <worldbody>
    <body name="rod"><joint name="pivot" axis="0 1 0"/><geom size="0.1"/><site name="tip"/></body>
  </worldbody>
  <actuator><motor name="drive" joint="pivot"/></actuator>
  <sensor><gyro name="turning" site="tip"/></sensor>
</mujoco>
"""


def test_a_robot_file_has_every_sensor_joint_and_actuator(circuitkit):
    Path("rod.xml").write_text(MJCF, encoding="utf-8")
    done = circuitkit("init", "--robot", "rod.xml")
    assert (done.code, done.out) == (0, "")
    assert done.err.startswith("wrote robot.yaml\n")
    robot = load_robot("robot.yaml")
    text = Path("robot.yaml").read_text(encoding="utf-8")
    assert all(name in text for name in ("pivot", "drive", "turning"))
    assert robot.commands
    assert robot.channels
    again = circuitkit("init", "--robot", "rod.xml")
    assert (again.code, again.out) == (1, "")
    assert "'robot.yaml' is there already; allowed: another name, or --force" in again.err
    assert circuitkit("init", "other.yaml", "--robot", "rod.xml").code == 0
    assert circuitkit("init", "--robot", "rod.xml", "--force").code == 0


def test_an_mjcf_that_is_not_there_or_wrong(circuitkit):
    done = circuitkit("init", "--robot", "no.xml")
    assert (done.code, done.err) == (
        1,
        "no.xml:1:1: there is no such file; allowed: the path of an MJCF file\n",
    )
    Path("bad.xml").write_text("<mujoco><worldbody>", encoding="utf-8")
    done = circuitkit("init", "--robot", "bad.xml")
    assert done.code == 1
    assert done.err.startswith("bad.xml:")
