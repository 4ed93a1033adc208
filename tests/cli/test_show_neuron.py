"""`circuitkit show FILE NEURON`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

from circuitkit.base.source import data_folder
from circuitkit.cli._explaining import text_plot

FILE = data_folder("circuits") / "binn_lateral.yaml"


def line_of(text):
    """The line of the shipped file on which a text stands first."""
    return FILE.read_text(encoding="utf-8").splitlines().index(text) + 1


def test_a_neuron_with_its_inputs_where_it_goes_and_where_all_that_is_written(circuitkit):
    outcome = circuitkit("show", "binn_lateral", "p1")
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0] == "p1: excitatory neuron, sigmoid"
    assert lines[1] == "  Out1; the ZMP is too far right"
    assert "equations, A being the sum of what the inputs deliver [1]" in lines
    assert "  output = sigmoid(slope * (A - shift))" in lines
    assert "  slope  = 10    steepness m; negative mirrors the curve" in lines
    rows = [" ".join(line.split()) for line in lines]
    at = line_of("  - {from: h2, to: p1, weight: -1}")
    assert f"h2 1 -1 inhibitory {FILE}:{at}:5" in rows
    at = line_of("  ankle_roll:")
    assert f"ankle_roll 1 1.63 deg readout {FILE}:{at}:3" in rows
    assert "output [1]" in rows


def test_a_line_number_is_no_picture(circuitkit):
    """Rich takes `:100:` for an emoji."""
    for name in ("p1", "p2", "h1", "q1", "lf"):
        out = circuitkit("show", "binn_lateral", name).out
        assert set(re.sub(r"[ -~\n]", "", out)) <= {"─"}


def test_a_member_of_a_population(circuitkit):
    lines = circuitkit("show", "ring_attractor", "ring[16]").out.splitlines()
    assert lines[0] == "ring[16]: excitatory member, leaky_linear"
    rows = [line.split() for line in lines]
    assert any(row[:6] == ["ring", "64", "64", "values,", "0", "to"] for row in rows)
    assert any(row[:3] == ["global", "1", "-6"] for row in rows)
    assert "  dv/dt     = (A - v) / tau" in lines
    assert "  steady output [1]" in lines


def test_the_curve_of_a_member_is_drawn(circuitkit):
    outcome = circuitkit("show", "ring_attractor", "ring[16]", "-o", "ring.svg")
    assert (outcome.code, outcome.err) == (0, "wrote ring.svg\n")
    assert "ring[16]" in Path("ring.svg").read_text(encoding="utf-8")


def test_a_condition_is_shown_as_it_is_asked(circuitkit):
    out = circuitkit("show", "spiking_reflex", "motor_left").out
    assert re.search(r"^  spikes when +(= )?v >= threshold$", out, re.MULTILINE)


def test_a_slope_of_an_angle_is_shown_per_degree(circuitkit):
    circuitkit("init", "reflex.yaml")
    out = circuitkit("show", "reflex.yaml", "left").out
    assert re.search(r"^  slope +(= )?2 /deg ", out, re.MULTILINE)


def test_a_population(circuitkit):
    lines = circuitkit("show", "ring_attractor", "ring").out.splitlines()
    assert lines[0] == "ring: excitatory population, leaky_linear"
    assert any(line.split()[:2] == ["ring", "4096"] for line in lines if line.strip())


def test_values_can_be_set_and_the_curve_drawn(circuitkit):
    outcome = circuitkit("show", "binn_lateral", "q4", "--set", "margin=4mm", "-o", "new/q4.svg")
    assert (outcome.code, outcome.err) == (0, "wrote new/q4.svg\n")
    assert "  shift  = 75.9 mm    activation s at which the output is one half" in outcome.out.splitlines()
    assert "q4" in Path("new/q4.svg").read_text(encoding="utf-8")


def test_json(circuitkit):
    found = json.loads(circuitkit("show", "binn_lateral", "q4", "--json").out)
    assert list(found) == [
        "name", "model", "role", "description", "origin", "unit",
        "equations", "values", "inputs", "outputs", "curve",
    ]  # fmt: skip
    assert found["values"] == {"slope": "100 /m", "shift": "79.9 mm"}
    assert [(each["other"], each["weight"]) for each in found["inputs"]] == [("zmp_y", "1"), ("rf", "-1 m")]
    assert [each["other"] for each in found["outputs"]] == ["p2", "h2"]
    a, o = (np.array(found["curve"][key]) for key in ("activation", "output"))
    np.testing.assert_allclose(o, 1 / (1 + np.exp(-0.1 * (a - 79.9))), rtol=1e-9)


def test_an_unknown_neuron(circuitkit):
    outcome = circuitkit("show", "binn_lateral", "q5")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err.startswith(
        "unknown neuron 'q5'; allowed: lf, bf, rf, q1, q2, q3, q4, h1, h2, p1, p2; "
    )
    assert circuitkit("show", "ring_attractor", "ring[64]").code == 1


def test_a_picture_needs_a_neuron(circuitkit):
    outcome = circuitkit("show", "binn_lateral", "-o", "out.svg")
    assert outcome.code == 2
    assert "-o draws the curve of one neuron; name it, or use circuitkit draw" in outcome.err


def test_tables_of_populations_and_projections(circuitkit):
    rows = [line.split() for line in circuitkit("show", "ring_attractor").out.splitlines()]
    assert [row[0] for row in rows if len(row) == 1 and row[0].isascii()] == [
        "inputs", "neurons", "populations", "synapses", "projections", "outputs",
    ]  # fmt: skip
    assert ["global", "ring", "64", "-6", "inhibitory"] in rows
    assert ["ring", "64", "leaky_linear", "excitatory", "tau", "0.02", "s,"] in [row[:7] for row in rows]


def test_the_models_and_delays_of_synapses_are_shown(circuitkit):
    rows = [line.split() for line in circuitkit("show", "spiking_reflex").out.splitlines()]
    assert ["from", "to", "weight", "kind", "model", "delay"] in rows
    assert any(row[-3:] == ["exponential", "8", "ms"] for row in rows)


def test_a_plot_in_characters():
    lines = list(text_plot([0.0, 1.0], [0.0, 2.0], "x", "y"))
    assert lines[0] == "  y"
    assert lines[1].startswith("        2 |")
    assert lines[1].endswith("*")
    assert lines[12].startswith("        0 |*")
    assert lines[14].split() == ["0", "1"]
    assert all(len(line) <= 71 for line in lines)
    rounded = list(text_plot([-4e-16, 6.0], [0.0, 2.0], "x", "y"))
    assert rounded[14].split() == ["0", "6"]
    flat = list(text_plot([0.0, 1.0], [3.0, 3.0], "x", "y"))
    assert flat[1] == "        3 |" + "*" * 60
