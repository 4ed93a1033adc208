"""Plug-ins, installed as distributions of their own: the one that docs/plugins.md shows, and data files."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")
_FILE = re.compile(r"^```(?:yaml|python)\n# (\S+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_POINTS = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)


def install(folder, entry_points):
    """What a package manager leaves of a distribution with entry points."""
    info = folder / "lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(entry_points, encoding="utf-8")


@pytest.fixture
def folder(tmp_path):
    """A folder with all files of the page, and an MJCF."""
    for name, text in _FILE.findall(PAGE):
        (tmp_path / name).write_text(text, encoding="utf-8")
    shutil.copy(ROOT / "robots" / "cartpole" / "cartpole.xml", tmp_path / "model.xml")
    return tmp_path


def run(folder, *words):
    path = os.pathsep.join([str(folder), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-m", "circuitkit", *words],
        cwd=folder, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_kinds_of_a_plug_in_work_like_our_own(folder):
    (points,) = _POINTS.findall(PAGE)
    install(folder, re.sub(r'\[project\.entry-points\."(.*)"\]', r"[\1]", points).replace('"', ""))
    done = run(folder, "simulate", "lab_kick.yaml", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    (row,) = json.loads(done.stdout)
    assert row["controller"] == "lab_balance"
    assert row["energy"] > 0
    assert 1 < row["settling_time_s"] < 2.5


def test_without_the_plug_in_its_kinds_are_unknown(folder):
    done = run(folder, "simulate", "lab_kick.yaml")
    assert done.returncode == 1
    assert "lab_kick.yaml:4:13: reference.sine: unknown key 'sine'; allowed: " in done.stderr
    assert "lab_kick.yaml:8:5: disturbances[0].kick: unknown key 'kick'; allowed: " in done.stderr


def test_a_plug_in_cannot_replace_a_kind_of_ours_without_a_word(folder):
    (folder / "lab_pushes.py").write_text(
        "from circuitkit.simulation.disturbances.push import Push\n"
        "class Stronger(Push):\n"
        "    kind = 'push'\n",
        encoding="utf-8",
    )
    install(folder, "[circuitkit.disturbances]\nstronger = lab_pushes\n")
    done = run(folder, "simulate", "arm_reflex")
    assert done.returncode == 0
    assert done.stderr == (
        "the kind 'push' of lab_pushes.Stronger is left out of the disturbances: "
        "there is circuitkit.simulation.disturbances.push.Push already; allowed: another `kind`\n"
    )
    assert "deflection" in done.stdout


def test_a_plug_in_that_fails_is_left_out_with_a_warning(folder):
    install(folder, "[circuitkit.measures]\nlab = not_there\n")
    done = run(folder, "simulate", "cartpole_balances", "--json")
    assert done.returncode == 0
    why = "ModuleNotFoundError: No module named 'not_there'"
    assert done.stderr == f"the plug-in 'lab' of circuitkit.measures is left out: {why}\n"


# -- files by name: a package `lab_data` with the folders of our own data


SENSE = """\
model: {name}
description: {words}
source: none
activation: "1"
parameters:
  gain: {{unit: "1", default: 2, description: of the sum of the inputs}}
output: gain * A
"""
CIRCUIT = """\
circuit: {name}
description: {words}
control_step: 10 ms
timing: ordered
inputs:
  lean: {{unit: rad, range: [-1 rad, 1 rad]}}
neurons:
  n: {{model: doubled, role: excitatory}}
synapses:
  - {{from: lean, to: n, weight: 17.5 /rad}}
outputs:
  force: {{unit: N, readout: {{n: 1 N}}}}
"""
ROBOT = """\
robot: lab_cart
description: A cart of the laboratory
mjcf: model.xml
channels:
  lean: {unit: rad, is: joint(hinge)}
commands:
  force: {unit: N, to: {motor: 1}, limits: [-10 N, 10 N]}
"""
SCENARIO = """\
scenario: lab_leans
description: The cart follows its pole
robot: lab_cart
circuit: lab_reflex
duration: 0.2 s
measures: {furthest: max(abs(lean))}
"""
STUDY = "study: lab_seeds\nscenario: lab_leans\nseeds: {count: 1}\n"
INCLUDES = """\
circuit: lab_whole
control_step: 10 ms
timing: ordered
include: [lab_reflex]
"""


def bring_data(folder, package, files):
    """A distribution whose package brings files."""
    for name, text in files.items():
        path = folder / package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text(f"[circuitkit.data]\n{package} = {package}\n", encoding="utf-8")


@pytest.fixture
def with_data(tmp_path):
    bring_data(
        tmp_path,
        "lab_data",
        {
            "__init__.py": "raise RuntimeError('data need no import')",
            "models/neurons/doubled.yaml": SENSE.format(name="doubled", words="Twice the sum of its inputs."),
            "circuits/lab_reflex.yaml": CIRCUIT.format(name="lab_reflex", words="A push towards the lean"),
            "robots/lab_cart/robot.yaml": ROBOT,
            "robots/lab_cart/model.xml": (ROOT / "robots" / "cartpole" / "cartpole.xml").read_text("utf-8"),
            "sims/lab_leans.yaml": SCENARIO,
            "sims/studies/lab_seeds.yaml": STUDY,
        },
    )
    return tmp_path


def test_files_of_a_plug_in_have_names_like_those_that_ship(with_data):
    done = run(with_data, "simulate", "lab_leans", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)[0]["scenario"] == "lab_leans"
    assert run(with_data, "sweep", "lab_seeds", "--dry-run").returncode == 0
    (with_data / "whole.yaml").write_text(INCLUDES, encoding="utf-8")
    for circuit in ("lab_reflex", "whole.yaml"):
        done = run(with_data, "run", circuit, "--input", "lean=0.1rad", "--steps", "1", "--json")
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["last"]["force"] == pytest.approx(2 * 17.5 * 0.1)


def test_files_of_a_plug_in_are_listed(with_data):
    rows = json.loads(run(with_data, "list", "--json").stdout)
    brought = [(row["kind"], row["name"]) for row in rows if str(with_data) in row["file"]]
    assert brought == [
        ("circuits", "lab_reflex"),
        ("robots", "lab_cart"),
        ("scenarios", "lab_leans"),
        ("studies", "lab_seeds"),
        ("models", "doubled"),
    ]
    assert "binn_lateral" in {row["name"] for row in rows}
    done = run(with_data, "run", "lab_reflx", "--steps", "1")
    assert "did you mean 'lab_reflex'?" in done.stderr


def test_a_name_that_ships_stays_ours_and_a_warning_says_so(with_data):
    theirs = with_data / "lab_data" / "circuits" / "binn_lateral.yaml"
    theirs.write_text(CIRCUIT.format(name="binn_lateral", words="Of the laboratory"), encoding="utf-8")
    ours = ROOT / "circuits" / "binn_lateral.yaml"
    done = run(with_data, "show", "binn_lateral", "--json")
    assert done.stderr == (
        f"'binn_lateral.yaml' stands for '{ours}'; '{theirs}' has the same name: use its path\n"
    )
    assert "q1" in done.stdout
    assert run(with_data, "validate", str(theirs)).stdout.endswith("valid\n")
    rows = json.loads(run(with_data, "list", "circuits", "--json").stdout)
    (row,) = (each for each in rows if each["file"] == str(theirs))
    assert row["name"] == str(theirs)
    assert row["description"] == f"Of the laboratory (the name 'binn_lateral' is that of {ours})"


def test_of_two_plug_ins_the_first_in_the_alphabet_has_the_name(with_data):
    name = "circuits/lab_reflex.yaml"
    bring_data(with_data, "a_lab", {name: CIRCUIT.format(name="lab_reflex", words="Of a_lab")})
    done = run(with_data, "show", "lab_reflex", "--json")
    assert json.loads(done.stdout)["description"] == "Of a_lab"
    first, second = (with_data / package / name for package in ("a_lab", "lab_data"))
    assert done.stderr.startswith(f"'lab_reflex.yaml' stands for '{first}'; '{second}' has the same name")


def test_a_plug_in_without_data_is_left_out_with_a_warning(tmp_path):
    bring_data(tmp_path, "empty", {"readme.txt": ""})
    done = run(tmp_path, "list", "robots")
    assert done.returncode == 0
    why = "LookupError: 'empty' is no package with one of the folders circuits, models, robots, sims"
    assert done.stderr == f"the plug-in 'empty' of circuitkit.data is left out: {why}\n"
