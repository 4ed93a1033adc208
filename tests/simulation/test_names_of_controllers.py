"""Folders and names of the controllers that are compared: no two are the same, and each says which it is."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from circuitkit.simulation.run import _names


@pytest.mark.parametrize(
    ("given", "names"),
    [
        (["open_loop", "circuit"], ["open_loop", "circuit"]),
        (["a/mine.yaml", "b/mine.yaml"], ["a_mine", "b_mine"]),
        (["a/x/mine.yaml", "b/x/mine.yaml"], ["a_x_mine", "b_x_mine"]),
        (["a/Mine.yaml", "b/mine.yaml"], ["a_Mine", "b_mine"]),  # some file systems do not tell them apart
        (["x/open_loop.yaml", "open_loop"], ["x_open_loop", "open_loop"]),
        (["circuit", "circuit", "circuit"], ["circuit", "circuit_2", "circuit_3"]),
        (["circuit", "circuit", "circuit_2"], ["circuit", "circuit_2", "circuit_2_2"]),
        (["a/mine.yaml", "a/mine.yaml"], ["a_mine", "a_mine_2"]),
        ([".."], ["controller"]),
    ],
)
def test_folders_of_controllers(given, names):
    bound = [SimpleNamespace(name=Path(each).stem) for each in given]
    assert _names(given, bound) == names


def test_objects_are_called_as_they_call_themselves():
    objects = [SimpleNamespace(name=name) for name in ("mine", "mine", "../up/there", "")]
    assert _names(objects, objects) == ["mine", "mine_2", "_up_there", "controller"]
