"""The circuit alone, from table to table."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scipy.io import netcdf_file

from circuitkit.base.errors import InputError
from circuitkit.base.files import OutputError
from circuitkit.circuit import load_circuit, memory, parse_circuit
from circuitkit.engine.table import run_table, write_run

RELAY = """\
circuit: relay
control_step: 20 ms
timing: ordered
inputs:
  zmp_y: {unit: mm, range: [-150 mm, 150 mm]}
  load: {unit: "1", range: [-1, 1]}
neurons:
  copy: {model: identity, role: excitatory}
synapses:
  - {from: load, to: copy, weight: 2}
  - {from: zmp_y, to: copy, weight: 1 /m}
outputs:
  angle: {unit: deg, readout: {copy: 1 deg}}
"""


@pytest.fixture(scope="module")
def relay(tmp_path_factory):
    """Output = (2 load + zmp_y / 1 m) · 1°, so that every column can be worked out by hand."""
    path = tmp_path_factory.mktemp("circuit") / "relay.yaml"
    path.write_text(RELAY, encoding="utf-8")
    return load_circuit(path)


def table(tmp_path, text):
    path = tmp_path / "in.csv"
    path.write_text(text, encoding="utf-8")
    return path


def by_name(result):
    return {column.name: column.values for column in result.columns}


def test_values_come_in_any_fitting_unit_and_go_out_in_the_declared_one(relay):
    result = run_table(relay, values={"zmp_y": "5 cm", "load": "50 %"}, steps=3)
    columns = by_name(result)
    assert list(columns) == ["zmp_y", "load", "copy", "angle"]
    np.testing.assert_allclose(columns["zmp_y"], [50, 50, 50])
    np.testing.assert_allclose(columns["copy"], 1.05)
    np.testing.assert_allclose(columns["angle"], 1.05)
    np.testing.assert_allclose(result.time_s(), [0, 0.02, 0.04])
    assert [column.unit.symbol for column in result.columns] == ["mm", "1", "1", "deg"]
    assert result.notes == ()


def test_a_table_is_read_in_declared_units_or_in_the_cells_own(relay, tmp_path):
    path = table(tmp_path, "load,zmp_y\n0.5,10\n-0.5, 2 cm\n\n0,-0.03 m\n")
    columns = by_name(run_table(relay, table=path))
    np.testing.assert_allclose(columns["zmp_y"], [10, 20, -30])
    np.testing.assert_allclose(columns["load"], [0.5, -0.5, 0])
    np.testing.assert_allclose(columns["angle"], [1.01, -0.98, -0.03])


def test_a_value_stands_beside_a_table_and_steps_cut_it(relay, tmp_path):
    path = table(tmp_path, "zmp_y\n1\n2\n3\n")
    columns = by_name(run_table(relay, values={"load": "1"}, table=path, steps=2))
    np.testing.assert_allclose(columns["zmp_y"], [1, 2])
    np.testing.assert_allclose(columns["load"], [1, 1])


def test_what_was_written_can_be_read_again(relay, tmp_path):
    first = run_table(relay, values={"zmp_y": "12.3456789 mm", "load": "-0.1"}, steps=4)
    write_run(first, tmp_path / "out.csv")
    again = run_table(relay, table=tmp_path / "out.csv")
    for mine, theirs in zip(first.columns, again.columns, strict=True):
        np.testing.assert_allclose(mine.values, theirs.values, rtol=1e-14)


def test_csv_has_the_columns_of_the_contract(relay, tmp_path):
    write_run(
        run_table(relay, values={"zmp_y": "10mm", "load": "0.25"}, steps=2), tmp_path / "new" / "out.csv"
    )
    rows = list(csv.reader((tmp_path / "new" / "out.csv").read_text(encoding="utf-8").splitlines()))
    assert rows == [
        ["time_s", "zmp_y", "load", "copy", "angle"],
        ["0.0", "10.0", "0.25", "0.51", "0.51"],
        ["0.02", "10.0", "0.25", "0.51", "0.51"],
    ]


def test_netcdf_has_the_same_with_units(relay, tmp_path):
    result = run_table(relay, values={"zmp_y": "10mm", "load": "0.25"}, steps=2)
    write_run(result, tmp_path / "out.nc")
    with netcdf_file(tmp_path / "out.nc", mmap=False) as file:
        assert file.circuit == b"relay"
        assert list(file.variables) == ["time_s", "zmp_y", "load", "copy", "angle"]
        angle = file.variables["angle"]
        assert (angle.units, angle.role, angle.dimensions) == (b"deg", b"output", ("time_s",))
        np.testing.assert_array_equal(angle[:], by_name(result)["angle"])


def test_inputs_that_are_not_given_are_held_at_0_with_a_note(relay):
    result = run_table(relay, steps=1)
    assert result.notes == ("held at 0, for no value was given: zmp_y, load",)
    assert result.last() == {"zmp_y": 0, "load": 0, "copy": 0, "angle": 0}


def test_an_input_that_leaves_its_range_is_noted(relay, tmp_path):
    path = table(tmp_path, "zmp_y,load\n151,0\n150,0\n-150,1\n-151,0\n")
    assert run_table(relay, table=path).notes == (
        "zmp_y leaves its range, -150 mm to 150 mm, in 2 of 4 steps",
    )


@pytest.mark.parametrize(("steps", "need"), [(10**9, "112 GB"), (10**23, "1.12e+16 GB")])
def test_more_steps_than_fit_into_memory_are_refused(relay, monkeypatch, steps, need):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 24_000_000_000)
    with pytest.raises(InputError) as caught:
        run_table(relay, steps=steps)
    assert str(caught.value) == (
        f"steps: found {steps} steps, which need about {need} of memory, but this machine has 24 GB; "
        "allowed: fewer"
    )


def test_many_steps_are_the_same_in_parts():
    """An output that adds up 2 deg in every step has come to 2 n deg after n of them."""
    graph = parse_circuit(RELAY.replace("{copy: 1 deg}", "{copy: 1 deg}, integrate: {leak: 0}"))
    reports = []
    result = run_table(graph, values={"load": "1"}, steps=10_000, progress=lambda *done: reports.append(done))
    assert reports == [(4096, 10_000), (8192, 10_000), (10_000, 10_000)]
    np.testing.assert_allclose(by_name(result)["angle"], 2.0 * np.arange(1, 10_001), rtol=1e-9)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"zmp": "1mm"}, "inputs: unknown input 'zmp'; allowed: zmp_y, load; did you mean 'zmp_y'?"),
        (
            {"zmp_y": "0.07"},
            "inputs.zmp_y: found '0.07' (dimensionless); allowed: a value in mm or alike (length)",
        ),
        ({"zmp_y": "3 deg"}, "inputs.zmp_y: found '3 deg' (angle); allowed: a value in mm or alike (length)"),
        ({"load": "nan"}, "inputs.load: found nan; allowed: finite numbers"),
        ({"load": "1e999"}, "inputs.load: found 1e999; allowed: finite numbers"),
        (
            {"a": "1", "zmp_y": "1"},
            "inputs: unknown input 'a'; allowed: zmp_y, load\n"
            "inputs.zmp_y: found '1' (dimensionless); allowed: a value in mm or alike (length)",
        ),
    ],
)
def test_wrong_values_are_listed(relay, values, message):
    with pytest.raises(InputError) as caught:
        run_table(relay, values=values, steps=1)
    assert str(caught.value) == message


QUANTITY = "a number, with a unit if it has one, such as '-80 mm' or '0.1'"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "1:1: found an empty table; allowed: a header and one row a step"),
        ("zmp_y\n", "1:1: found a header and no rows; allowed: a header and one row a step"),
        (
            "load,zmpy\n0,1\n",
            "1:6: header: unknown input 'zmpy'; allowed: zmp_y, load; did you mean 'zmp_y'?",
        ),
        ("load,load\n0,1\n", "1:6: header: the column 'load' occurs twice"),
        ("time_s\n0\n", "1:1: header: found no column of an input; allowed: zmp_y, load"),
        (
            "load;zmp_y\n0;1\n",
            "1:1: header: unknown input 'load;zmp_y'; allowed: zmp_y, load; separate the columns by commas",
        ),
        ("load,zmp_y\n0,1\n0\n", "3:1: found 1 values; allowed: 2, as in the header"),
        ("load,zmp_y\n0,\n", "2:3: zmp_y: found nothing; allowed: a number"),
        *(
            (f"load\n{cell}\n", f"2:1: load: found '{cell}'; allowed: {QUANTITY}")
            for cell in ("1_0", "\u0663", "1\u0663")
        ),
        ("load\nnan\n", "2:1: load: found nan; allowed: finite numbers"),
        (
            "load,zmp_y\n0,1 deg\n",
            "2:3: zmp_y: found '1 deg' (angle); allowed: a value in mm or alike (length)",
        ),
        (
            "time_s,load\n0,0\n0.03,0\n",
            "3:1: time_s: found 0.03 s after the row above; allowed: the circuit's 0.02 s",
        ),
        ("time_s,load\n0,0\nx,0\n", "3:1: time_s: found 'x'; allowed: seconds as a number"),
        ('load\n"1\n', "2:1: not a CSV table: unexpected end of data"),
    ],
)
def test_wrong_tables_are_told_by_line_and_column(relay, tmp_path, text, message):
    path = table(tmp_path, text)
    with pytest.raises(InputError) as caught:
        run_table(relay, table=path)
    assert str(caught.value) == f"{path}:{message}"


def test_many_problems_of_a_table_are_counted(relay, tmp_path):
    path = table(tmp_path, "load\n" + "x\n" * 30)
    with pytest.raises(InputError) as caught:
        run_table(relay, table=path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 21
    assert lines[-1] == f"{path}:22:1: 10 more problems"


def test_a_table_that_is_not_there_or_no_text(relay, tmp_path):
    with pytest.raises(InputError) as caught:
        run_table(relay, table=tmp_path / "no.csv")
    assert str(caught.value) == f"{tmp_path / 'no.csv'}:1:1: there is no such file; allowed: a CSV table"
    (tmp_path / "bad.csv").write_bytes(b"load\n\xff\n")
    with pytest.raises(InputError) as caught:
        run_table(relay, table=tmp_path / "bad.csv")
    found = "found the byte 0xff, which is no UTF-8; allowed: a text file in UTF-8"
    assert str(caught.value) == f"{tmp_path / 'bad.csv'}:2:1: {found}"


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (4, "steps: found 4; allowed: 1 to 3, the rows of '{path}'"),
        (0, "steps: found 0; allowed: 1 to 3, the rows of '{path}'"),
    ],
)
def test_a_table_must_be_long_enough(relay, tmp_path, steps, message):
    path = table(tmp_path, "load\n0\n0\n0\n")
    with pytest.raises(InputError) as caught:
        run_table(relay, table=path, steps=steps)
    assert str(caught.value) == message.format(path=path)


def test_a_number_of_steps_is_needed(relay):
    with pytest.raises(InputError) as caught:
        run_table(relay, values={"load": "1"})
    assert str(caught.value) == (
        "steps: found no number of steps; allowed: a whole number from 1, or a table with one row a step"
    )


def test_an_input_is_given_once(relay, tmp_path):
    with pytest.raises(InputError) as caught:
        run_table(relay, values={"load": "1"}, table=table(tmp_path, "load\n0\n"))
    assert str(caught.value) == (
        "inputs.load: given twice, as a value and as a column of the table; allowed: one of them"
    )


def test_the_suffix_chooses_the_format(relay, tmp_path):
    with pytest.raises(InputError) as caught:
        write_run(run_table(relay, steps=1), tmp_path / "out.cvs")
    assert str(caught.value) == (
        f"{tmp_path / 'out.cvs'}: found the suffix '.cvs'; allowed: .csv, .nc; did you mean '.csv'?"
    )


@pytest.mark.parametrize("name", ["out.csv", "out.nc"])
def test_a_folder_in_the_way_is_told(relay, tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="it is a folder; name a file in it"):
        write_run(run_table(relay, steps=1), tmp_path / name)
