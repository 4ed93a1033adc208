"""Ranges: each channel is read within its own, whatever it is made of and whoever else reads its sensor."""

from __future__ import annotations

import numpy as np
import pytest
from small_robots import CART, CART_FILE, Told, run, small_robot

from circuitkit.robots import load_robot
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.disturbances.noise import Noise

CHANNELS = {
    "place": {"unit": "m", "is": "joint(slide)"},
    "twice": {"unit": "m", "is": "2 * joint(slide)"},
    "narrow": {"unit": "m", "is": "joint(slide)", "range": ["-1 mm", "2 mm"]},
    "wide": {"unit": "m", "is": "joint(slide)", "range": ["-1 m", "5 mm"]},
    "double": {"unit": "m", "is": "2 * joint(slide)", "range": ["-1 m", "3 mm"]},
    "far": {"unit": "m", "is": "joint(slide) + 1 m", "range": ["-1 m", "1.004 m"]},
}
BOUNDS = {"place": np.inf, "narrow": 0.002, "wide": 0.005, "double": 0.003, "far": 1.004, "twice": np.inf}
SETS = [
    ["narrow"], ["place"], ["double"], ["narrow", "wide"], ["place", "narrow"], ["double", "narrow", "twice"],
    list(BOUNDS),
]  # fmt: skip


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    return small_robot(
        tmp_path_factory.mktemp("cart"), CART, channels=CHANNELS, commands=CART_FILE["commands"]
    )


def read(cart, names, *disturbances, seeds=(0, 1)):
    """What the controller read, and what was true then; shapes (T, B, k)."""
    recording = run(cart, Told(names, force=3.0), disturbances, seeds=seeds)
    true = np.stack([recording.channel(name) for name in names], axis=-1)
    return recording.observations[1:], true[:-1]


@pytest.mark.parametrize("names", SETS)
def test_what_is_read_is_the_true_value_within_its_own_range(cart, names):
    seen, true = read(cart, names)
    assert (true.max(axis=(0, 1)) > 0.1).all()  # far beyond
    np.testing.assert_array_equal(seen, np.minimum(true, [BOUNDS[name] for name in names]))


@pytest.mark.parametrize("names", SETS)
@pytest.mark.parametrize("channel", ["*", "narrow", "double"])
def test_noise_does_not_lead_out_of_a_range(cart, names, channel):
    seen, _ = read(cart, names, Noise(channel=channel, std="10 cm"))
    for k, name in enumerate(names):
        assert seen[..., k].max() <= BOUNDS[name]


@pytest.mark.parametrize("names", SETS)
def test_a_missing_reading_stays_missing(cart, names):
    seen, _ = read(cart, names, Fault(channel="*", reading="missing", start=0.1, duration=0.1))
    assert np.isnan(seen[9:19]).all()
    assert not np.isnan(seen[19:]).any()


@pytest.mark.parametrize("name", ["narrow", "double"])
def test_a_spike_comes_after_the_range(cart, name):
    seen, _ = read(cart, [name], Fault(channel=name, reading="spike", value="1 m", start=0.1))
    assert seen[-1].max() == 1 + BOUNDS[name]


def test_the_range_of_a_force_cell_bounds_all_that_is_computed_from_it():
    """NAO weighs 6 N a cell: within 1 N all show the same, and the ZMP is the middle of their places."""
    robot = load_robot("nao")
    cells = robot.biped.force_cells.model_copy(update={"range": (0.0, 1.0)})
    block = robot.biped.model_copy(update={"force_cells": cells})
    robot = robot.model_copy(update={"biped": block})
    seen = run(robot, Told(["load", "zmp_x"]), duration_s=1.0).observations[-1, 0]
    middle = (4 * 70.25e-3 - 2 * (30.25e-3 + 29.65e-3)) / 8
    np.testing.assert_allclose(seen, [8.0, middle], rtol=1e-9)
