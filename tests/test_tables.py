"""CSV that every reader reads as the same numbers."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.base.tables import csv_lines

pd = pytest.importorskip("pandas")


@given(st.lists(st.floats(), min_size=1, max_size=5), st.text("abc,\"'\n [0]", min_size=1))
def test_each_number_is_read_again_as_it_was(values, name):
    text = "".join(csv_lines({"time_s": np.arange(len(values)), name: np.array(values)}))
    header, *rows = csv.reader(io.StringIO(text, newline=""))
    assert header == ["time_s", name]
    np.testing.assert_array_equal([float(row[1]) for row in rows], values)


def test_a_column_of_floats_looks_like_one_in_every_line():
    """Readers that look at some lines, such as polars, take `0` for a whole number and stop at `2.3e-20`."""
    values = [0.0, -1.0, 1e22, 2.3e-20, float("nan"), float("inf")]
    text = "".join(csv_lines({"a": values}))
    assert text == "a\n0.0\n-1.0\n1e+22\n2.3e-20\nNaN\ninf\n"
    for line in range(2, 8):
        assert pd.read_csv(io.StringIO("\n".join(text.splitlines()[:line])))["a"].dtype == np.float64


def test_columns_are_equally_long():
    with pytest.raises(ValueError, match="shorter"):
        list(csv_lines({"a": np.zeros(3), "b": np.zeros(2)}))


def test_a_long_table_has_every_line_once():
    text = "".join(csv_lines({"a": np.arange(10_000)}))
    assert text == "a\n" + "".join(f"{i}.0\n" for i in range(10_000))
