"""Killed at any write, or without room for it: what is there is whole; the rest is told or made up for."""

from __future__ import annotations

import contextlib
import io
import signal

import pytest
from apart import apart
from torture.faults import killed_at, with_files_up_to

from circuitkit.cli.main import main
from circuitkit.simulation import load_scenario, simulate
from circuitkit.study import make_study, sweep

STUDY = {
    "study": "short",
    "scenario": "vehicle_avoids",
    "set": {"duration": "50 ms"},
    "axes": {"circuit": ["braitenberg_avoider", "light_seeker"]},
    "seeds": {"count": 2},
}
SCENARIO = """\
scenario: short
robot: vehicle
circuit: braitenberg_avoider
duration: 50 ms
"""
_MOST = 200  # kills; there are fewer writes


def swept(folder, *, resume=False):
    sweep(make_study(STUDY), folder, workers=1, progress=False, batch=1, resume=resume)


def files_in(folder):
    """What lies in a folder by name, without what a killed process left under a hidden name."""
    found = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def spoilt(found, expected):
    """Names of files that are not whole; the list of what lies in a folder says what lies there so far."""
    return [name for name, data in found.items() if data != expected.get(name) and name != "files.json"]


def test_a_sweep_killed_at_any_write_goes_on_to_the_same_bytes(tmp_path):
    whole = tmp_path / "whole"
    assert apart(lambda: swept(whole)).value is None
    expected = (whole / "results.parquet").read_bytes()
    for number in range(_MOST):
        folder = tmp_path / str(number)
        ended = killed_at(number, folder, lambda folder=folder: swept(folder))
        if ended.signal == 0:
            break
        assert ended.signal == signal.SIGKILL
        again = apart(lambda folder=folder: swept(folder, resume=folder.exists()))
        assert (number, again.value) == (number, None)
        assert (folder / "results.parquet").read_bytes() == expected, number
    assert 5 < number < _MOST


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(SCENARIO, encoding="utf-8")
    return path


def test_a_simulation_killed_at_any_write_leaves_whole_files(tmp_path, scenario):
    def run(folder):
        simulate(load_scenario(scenario), output=folder)

    assert apart(lambda: run(tmp_path / "whole")).value is None
    expected = files_in(tmp_path / "whole")
    assert {"recording.nc", "recording.csv"} <= set(expected)
    for number in range(_MOST):
        folder = tmp_path / str(number)
        if killed_at(number, folder, lambda folder=folder: run(folder)).signal == 0:
            break
        found = files_in(folder)
        assert spoilt(found, expected) == [], number
        assert apart(lambda folder=folder: run(folder)).value is None
        assert files_in(folder) == expected
    assert 5 < number < _MOST


@pytest.mark.parametrize("size", [0, 1, 100, 1000, 5000, 20_000, 60_000])
def test_a_full_disk_at_any_write_is_told(tmp_path, scenario, size):
    def run():
        said = io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            return main(["simulate", str(scenario), "-o", str(tmp_path / "out")]), said.getvalue()

    assert apart(run).value[0] == 0
    expected = files_in(tmp_path / "out")
    for path in (tmp_path / "out").iterdir():
        path.unlink()
    code, said = with_files_up_to(size, run).value
    is_enough = max(map(len, expected.values())) <= size
    assert (code, said.startswith("cannot write '")) == ((0, False) if is_enough else (3, True)), said
    assert len(said.splitlines()) == (0 if is_enough else 1)
    assert spoilt(files_in(tmp_path / "out"), expected) == []
