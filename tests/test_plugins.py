"""The plug-in that docs/plugins.md shows, installed as a distribution of its own."""

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


def test_a_plug_in_that_fails_is_left_out_with_a_warning(folder):
    install(folder, "[circuitkit.measures]\nlab = not_there\n")
    done = run(folder, "simulate", "cartpole_balances", "--json")
    assert done.returncode == 0
    why = "ModuleNotFoundError: No module named 'not_there'"
    assert done.stderr == f"the plug-in 'lab' of circuitkit.measures is left out: {why}\n"
