"""What is shipped: the wheel, the lock, and the two names of the project."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_string
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder

import circuitkit

ROOT = Path(__file__).parent.parent
DATA = (".yaml", ".xml", ".typed", ".json", ".csv")
GENERATED = (
    ".git",
    ".venv",
    ".venv-peers",
    "out",
    "build",
    "dist",
    "__pycache__",
    ".ruff_cache",
    ".mypy_cache",
    ".pytest_cache",
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    (path,) = WheelBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])
    return Path(path)


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_wheel_carries_the_package_with_all_its_data(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    here = [path for path in (ROOT / "circuitkit").rglob("*") if path.suffix in {".py", *DATA}]
    assert {path.relative_to(ROOT).as_posix() for path in here} <= names


def test_wheel_carries_circuits_robots_and_scenarios_as_package_data(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder in ("circuits", "robots", "sims"):
        files = [path for path in (ROOT / folder).rglob("*") if path.suffix in DATA]
        shipped = {path.relative_to(ROOT).as_posix() for path in files}
        assert shipped
        assert {f"circuitkit/_data/{name}" for name in shipped} <= names


def test_wheel_carries_nothing_else(wheel):
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert tops == {"circuitkit", f"neurocircuitkit-{circuitkit.__version__}.dist-info"}


def test_wheel_says_who_it_is(wheel):
    archive = zipfile.ZipFile(wheel)
    folder = f"neurocircuitkit-{circuitkit.__version__}.dist-info"
    metadata = message_from_string(archive.read(f"{folder}/METADATA").decode())
    assert metadata["Name"] == "neurocircuitkit"
    assert metadata["Version"] == circuitkit.__version__
    assert metadata["License-Expression"] == "Apache-2.0"
    assert metadata["Requires-Python"] == ">=3.11"
    assert f"{folder}/licenses/LICENSE" in archive.namelist()
    scripts = archive.read(f"{folder}/entry_points.txt").decode()
    assert "[console_scripts]\ncircuitkit = circuitkit.cli.main:entry_point\n" in scripts
    assert "[circuitkit.references]\nbiped = circuitkit.biped.references\n" in scripts


@pytest.fixture(scope="module")
def run_installed(wheel, tmp_path_factory):
    """Runs the command line of the unpacked wheel, away from the checkout."""
    installed, elsewhere = tmp_path_factory.mktemp("installed"), tmp_path_factory.mktemp("elsewhere")
    zipfile.ZipFile(wheel).extractall(installed)
    environment = {**os.environ, "PYTHONPATH": str(installed)}

    def run(*words):
        whole = [sys.executable, "-m", "circuitkit", *words]
        return subprocess.run(
            whole, cwd=elsewhere, env=environment, capture_output=True, text=True, check=False
        )

    return run


def test_wheel_alone_runs_shipped_circuits_by_name(run_installed):
    done = run_installed("show", "binn_lateral", "--resolved")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("circuit: binn_lateral\n")


def test_wheel_alone_runs_shipped_scenarios_by_name(run_installed):
    done = run_installed("simulate", "nao_push", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert [row["scenario"] for row in json.loads(done.stdout)] == ["nao_push"]


def test_wheel_alone_says_that_benchmarks_are_in_the_repository(run_installed):
    done = run_installed("bench")
    assert (done.returncode, done.stdout) == (3, "")
    assert re.fullmatch(
        r"found no benchmarks in '.*/benchmarks': they are part of the repository, "
        r"not of the installed package; run `make bench` in a clone of the repository\n",
        done.stderr,
    )


# The other simulators are kept out of the lock that everybody installs.
LOCKS = {
    "requirements.lock": {"cluster", "data", "dev", "mpc", "study", "test", "tune", "video"},
    "requirements-peers.lock": {"peers", "test"},
}


@pytest.mark.parametrize(("lock", "extras"), LOCKS.items())
def test_every_dependency_is_locked_with_hashes(project, lock, extras):
    entries = re.split(r"\n(?=[a-z0-9])", (ROOT / lock).read_text(encoding="utf-8"))[1:]
    assert all("--hash=sha256:" in entry for entry in entries)
    locked = {re.match(r"[a-z0-9-]+", entry).group() for entry in entries}
    optional = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(name for extra in extras for name in optional[extra])]
    assert {re.match(r"[\w-]+", name).group() for name in wanted} <= locked


def test_every_extra_is_locked(project):
    assert set(project["optional-dependencies"]) == set().union(*LOCKS.values())


@pytest.mark.parametrize("lock", LOCKS)
def test_lock_names_no_machine(lock):
    text = (ROOT / lock).read_text(encoding="utf-8")
    assert not re.search(r"://|file:|--(extra-)?index-url|--find-links|/\w+/", text)


def _texts():
    for path in sorted(ROOT.rglob("*")):
        inside = path.relative_to(ROOT).parts
        if (
            path.is_file()
            and not set(inside) & set(GENERATED)
            and path.suffix in {".md", ".py", ".toml", ".yaml", ".lock", ""}
        ):
            yield path, path.read_text(encoding="utf-8", errors="ignore")


def test_no_text_sends_anybody_to_the_package_of_the_same_name():
    wrong = re.compile(r"pip3? install (-\w+ )*['\"]?circuit" + r"kit\b")
    assert [str(path) for path, text in _texts() if wrong.search(text)] == []
