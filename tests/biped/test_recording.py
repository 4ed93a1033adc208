"""What a recording holds and what follows from it; its files, opened by others."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from biped.made_up import WEIGHT_N, recording
from walking import a_push, fault, nao_body, plan_of, view_of, walk_all

from circuitkit.base.files import OutputError
from circuitkit.base.units import parse_unit
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation import RunSpec
from circuitkit.simulation.disturbances.slope import Slope


@cache
def walked():
    """Two robots under the circuit; the second is pushed, and a cell fails for a while."""
    broken = fault("RFsrRL", "missing", 1.5, 0.07)
    specs = [RunSpec(3, (broken,)), RunSpec(4, (broken, a_push(force=9.0)))]
    return walk_all(plan_of(duration=2.0), "circuit", specs)


# --- what follows from the readings -------------------------------------------------------------------------


def test_rows_are_the_ends_of_ticks():
    np.testing.assert_allclose(recording().time_s, np.arange(1, 301) * 0.01)


def test_the_zmp_is_that_of_the_cells():
    found = recording(zmp_mm={0: 12.0, 100: -40.0})
    np.testing.assert_allclose(found.channel("zmp_y")[[50, 150], 0], [0.012, -0.04])
    np.testing.assert_allclose(found.channel("load"), WEIGHT_N)


def test_support_is_by_the_load():
    """More than 95 % on one foot is that foot alone: 0 left, 1 right, 2 both; in the air it is both."""
    found = recording(left_load={0: 0.5, 50: 0.949, 100: 0.951, 150: 0.049, 200: 0.051})
    view = view_of(found)
    assert [int(view.support[t, 0]) for t in (0, 75, 125, 175, 225)] == [2, 2, 0, 1, 2]
    np.testing.assert_allclose(view.loads_n[125, 0], [0.951 * WEIGHT_N, 0.049 * WEIGHT_N])
    air = view_of(replace(found, readings=np.zeros_like(found.readings)))
    assert (air.support == 2).all()
    assert np.isnan(air.centre_of_pressure_m).all()


def test_the_centre_of_pressure_is_shared_by_load_and_counted_from_between_the_feet():
    """Loads under the ankles, 5 cm to either side: three quarters on the left are 2.5 cm to the left."""
    found = recording(left_load=0.75)
    np.testing.assert_allclose(view_of(found).centre_of_pressure_m[:, 0], [[0.0, 0.025]] * 300, atol=1e-12)
    moved = found.readings.copy()
    layout = nao_body().layout
    for place in (layout.foot(0), layout.foot(1), layout.com, layout.torso):
        moved[:, :, place] += [1.0, 2.0, 0.0]
    for side in (0, 1):
        moved[:, :, layout.wrench(side)] += [0, 0, 0, 0, 0, 0, 1.0, 2.0, 0]
    moved, found = view_of(replace(found, readings=moved)), view_of(found)
    np.testing.assert_allclose(moved.centre_of_pressure_m, found.centre_of_pressure_m, atol=1e-12)
    np.testing.assert_allclose(moved.com_m, found.com_m, atol=1e-12)


def test_eq_2_on_a_falling_pendulum_gives_its_foot():
    """y = p + a cosh(omega t) over p = 3 cm, within the error of a central difference."""
    found = recording()
    layout, omega, time = nao_body().layout, np.sqrt(9.81 / 0.27), found.time_s[:100]
    readings = found.readings[:100].copy()
    readings[:, 0, layout.com.start + 1] = 0.03 + 0.001 * np.cosh(omega * time)
    readings[:, 0, layout.com_velocity.start + 1] = 0.001 * omega * np.sinh(omega * time)
    zmp = view_of(replace(found, readings=readings)).zmp_by_com_m[1:-1, 0]
    np.testing.assert_allclose(zmp[:, 0], 0.0, atol=1e-12)
    sway = readings[1:-1, 0, layout.com.start + 1] - 0.03
    np.testing.assert_allclose(zmp[:, 1], 0.03, atol=1e-3 * sway.max())


def test_eq_2_on_a_slope_is_plumb_below_a_centre_of_mass_at_rest():
    """The floor rises to the left, so that is to the right: by z tan(slope)."""
    model = build_model(load_robot("nao"), [Slope(left=np.radians(3)).change])
    zmp = view_of(replace(recording(), robot=model)).zmp_by_com_m[5, 0]
    np.testing.assert_allclose(zmp, [0.0, -0.27 * np.tan(np.radians(3))], atol=1e-12)


def test_a_push_is_recorded_where_it_acts():
    push = walked().push_n
    assert not push[:, 0].any()
    assert push[:, 1].sum() * 0.01 == pytest.approx(9.0 * 0.2)
    assert push[:, 1].max() == pytest.approx(9.0)


# --- files --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The second robot's files."""
    folder = tmp_path_factory.mktemp("out") / "made" / "here"
    assert walked().save(folder, robot=1) == folder / "recording.nc"
    return folder


def test_xarray_opens_it(saved):
    columns = walked().columns(1)
    with xr.open_dataset(saved / "recording.nc") as data:
        assert set(data.variables) == set(columns)
        assert data.sizes == {"time_s": 200}
        for name, values in columns.items():
            np.testing.assert_array_equal(data[name].values, values)
        assert data["zmp_y_m"].sel(time_s=1.0, method="nearest") == pytest.approx(columns["zmp_y_m"][99])
        assert data.attrs["title"] == "circuitkit recording, controller circuit"
        assert data.attrs["phases"] == "0 stand, 1 transfer, 2 lift, 3 extend"
        assert data.attrs["seed"] == "4"
        assert data.attrs["interrupted"] == 0


def test_pandas_opens_it_with_the_same_numbers(saved):
    """The table has nine digits."""
    table, columns = pd.read_csv(saved / "recording.csv"), walked().columns(1)
    assert list(table) == list(columns)
    for name, values in columns.items():
        np.testing.assert_allclose(table[name], values, rtol=1e-8, atol=1e-300)
    with xr.open_dataset(saved / "recording.nc") as data:
        frame = data.to_dataframe().reset_index()[list(table)]
    pd.testing.assert_frame_equal(frame, table, rtol=1e-8, check_dtype=False)


def test_every_column_has_its_unit(saved):
    with xr.open_dataset(saved / "recording.nc") as data:
        units = {str(name): str(variable.attrs["units"]) for name, variable in data.variables.items()}
    for unit in units.values():
        parse_unit(unit)
    expected = {
        "time_s": "s", "step": "1", "push_n": "N", "zmp_y_m": "m", "com_velocity_x_m_s": "m/s",
        "gyro_z_rad_s": "rad/s",
        "LFsrFL_n": "N", "LKneePitch_rad": "rad", "force_difference": "1", "neuron_q1": "1",
        "input_zmp_y": "m", "input_force_difference": "1", "output_ankle_roll": "rad", "input_missing": "1",
    }  # fmt: skip
    assert {name: units[name] for name in expected} == expected


def test_a_missing_reading_is_marked(saved):
    table = pd.read_csv(saved / "recording.csv")
    assert table.index[table["input_missing"] == 1].tolist() == list(range(150, 157))
    assert table.index[table["input_zmp_y"].isna()].tolist() == list(range(150, 157))
    assert not table["output_ankle_roll"].isna().any()
    assert table.loc[149:156, "output_ankle_roll"].nunique() == 1


def test_columns_hold_what_was_recorded():
    found, columns = walked(), walked().columns(1)
    layout = nao_body().layout
    np.testing.assert_array_equal(columns["LFsrRR_n"], found.readings[:, 1, layout.forces][:, 3])
    np.testing.assert_array_equal(columns["torso_x_m"], found.readings[:, 1, layout.torso.start])
    knee = found.robot.model.joint("RKneePitch").qposadr[0]
    np.testing.assert_array_equal(columns["RKneePitch_rad"], found.qpos[:, 1, knee])
    neuron = list(found.trace_names).index("q4")
    np.testing.assert_array_equal(columns["neuron_q4"], found.trace[:, 1, neuron])
    total = columns["load_left_n"] + columns["load_right_n"]
    assert np.median(total[50:]) == pytest.approx(5.19539 * 9.81, rel=0.02)
    assert columns["phase"].max() == 3
    assert (np.diff(columns["step"]) >= 0).all()


def test_an_interrupted_run_says_so(tmp_path):
    replace(recording(ticks=40), interrupted=True).save(tmp_path)
    with xr.open_dataset(tmp_path / "recording.nc") as data:
        assert data.attrs["interrupted"] == 1
        assert data.sizes["time_s"] == 40


def test_a_single_tick_can_be_saved(tmp_path):
    recording(ticks=1).save(tmp_path)
    assert len(pd.read_csv(tmp_path / "recording.csv")) == 1


def test_any_seed_can_be_saved(tmp_path):
    seed = 2**63 + 5
    replace(recording(ticks=5), specs=(RunSpec(seed),)).save(tmp_path)
    with xr.open_dataset(tmp_path / "recording.nc") as data:
        assert int(data.attrs["seed"]) == seed


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "out").write_text("a file", encoding="utf-8")
    with pytest.raises(OutputError, match=r"cannot write '.*recording\.nc'"):
        recording(ticks=5).save(tmp_path / "out")
