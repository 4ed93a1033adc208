"""A recording as an xarray dataset."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import xarray as xr

from circuitkit import Scenario, simulate
from circuitkit.base.errors import MissingDependencyError, UnknownNameError


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    scenario = Scenario(robot="cartpole", circuit="cartpole_balance", duration=0.2)
    return simulate(scenario, output=tmp_path_factory.mktemp("run"))


def test_it_is_what_the_file_has(result):
    dataset = result.recording.to_xarray()
    with xr.open_dataset(result.path) as written:
        assert set(dataset.data_vars) == set(written.data_vars)
        for name in written.data_vars:
            np.testing.assert_array_equal(dataset[name], written[name])
            assert dataset[name].attrs["units"] == written[name].attrs["units"]
    np.testing.assert_allclose(dataset.time_s, np.arange(1, 21) * 0.01)
    assert dataset.attrs == {"controller": "circuit", "seed": 0}


def test_without_xarray_it_says_what_is_missing(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingDependencyError, match=r"^to_xarray needs the package 'xarray'"):
        result.recording.to_xarray()


def test_a_command_that_the_controller_does_not_write_is_unknown(result):
    with pytest.raises(UnknownNameError, match="unknown command of the controller 'forse'; allowed: force"):
        result.recording.command("forse")
