"""`import circuitkit` is light, and every name it promises is there."""

from __future__ import annotations

import pkgutil
import subprocess
import sys

import pytest

import circuitkit

HEAVY = ("matplotlib", "mujoco", "networkx", "numpy", "pydantic", "scipy", "typer", "yaml")


def modules_after(statement: str) -> set[str]:
    code = f"{statement}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_package_imports_nothing_heavy():
    assert not modules_after("import circuitkit").intersection(HEAVY)


def test_checking_a_circuit_needs_no_drawing_no_robot_and_no_arrays():
    loaded = modules_after("import circuitkit; circuitkit.load_circuit('binn_lateral')")
    assert not loaded.intersection({"matplotlib", "mujoco", "networkx", "numpy", "scipy", "typer"})


@pytest.mark.parametrize("name", [name for name in circuitkit.__all__ if name != "__version__"])
def test_every_promised_name_is_there(name):
    assert name in dir(circuitkit)
    assert callable(getattr(circuitkit, name))
    assert getattr(circuitkit, name).__name__ == name


def test_no_package_has_the_name_of_a_promised_function():
    """Importing a package sets its name on `circuitkit`, and would hide the function."""
    packages = {module.name for module in pkgutil.iter_modules(circuitkit.__path__)}
    assert not packages.intersection(circuitkit.__all__)


@pytest.mark.parametrize(
    "before", ["", "import circuitkit.simulation.run", "from circuitkit import simulation"]
)
def test_simulate_is_a_function_whatever_was_imported_before(before):
    code = f"{before}\nfrom types import FunctionType\nfrom circuitkit import simulate\n"
    subprocess.run([sys.executable, "-c", f"{code}assert type(simulate) is FunctionType"], check=True)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"^module 'circuitkit' has no attribute 'load_circus'$"):
        _ = circuitkit.load_circus
