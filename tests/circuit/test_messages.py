"""Every complaint about a circuit file, word for word, with its line and column."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import math

import pytest

from circuitkit.base.errors import InputError, UnknownNameError, listing
from circuitkit.base.units import LISTED_SYMBOLS
from circuitkit.circuit import check, load_circuit, parse_circuit
from circuitkit.circuit.models import NEURON_MODEL_NAMES

BASE = """\
circuit: small
control_step: 10 ms
timing: ordered
parameters:
  edge: 80 mm
  w: {value: 2 deg, description: readout}
inputs:
  zmp: {unit: mm, range: [-150 mm, 150 mm]}
  load: {unit: "1", range: [-1, 1]}
neurons:
  lf: {model: sigmoid, role: inhibitory, slope: 500, shift: 0.1}
  q: {model: sigmoid, role: excitatory, slope: 100 /m, shift: edge}
synapses:
  - {from: load, to: lf, weight: 1}
  - {from: zmp, to: q, weight: -1}
  - {from: lf, to: [q], weight: -1 m}
outputs:
  roll: {unit: deg, readout: {q: w}, integrate: {leak: 5 %}, limits: [-22 deg, 22 deg]}
"""


def findings(text: str, tmp_path, monkeypatch) -> tuple[list[str], list[str]]:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.yaml").write_text(text, encoding="utf-8")
    errors, warnings = check("f.yaml")
    return [str(error) for error in errors], [str(warning) for warning in warnings]


def test_the_base_is_valid(tmp_path, monkeypatch):
    assert findings(BASE, tmp_path, monkeypatch) == ([], [])


MODELS = ", ".join(NEURON_MODEL_NAMES)
VALUE = "a number, a quantity such as '-80 mm', or a parameter"
UNITS = listing(LISTED_SYMBOLS)
NAME = "a name of letters, digits and _, not starting with a digit"

# These are followed by a second complaint that is true as well.
FOLLOWED = {
    "  lf: {",
    "  q: {model",
    "  roll: {",
    "range: [-1, 1]",
    "  load: {unit",
    "  edge: 80",
    "unit: mm",
    "edge: 80 mm",
}

# What is replaced in the base, and by what; where the complaint must point, with ¦ before the very character;
# and the complaint.
ERRORS = [
    # names
    ("model: sigmoid, role: inhibitory", "model: sigmoyd, role: inhibitory", "model: ¦sigmoyd",
     f"neurons.lf.model: unknown model 'sigmoyd'; allowed: {MODELS}; did you mean 'sigmoid'?"),
    ("shift: edge", "shift: edje", "shift: ¦edje",
     f"neurons.q.shift: unknown parameter 'edje'; allowed: {VALUE}: edge, w; did you mean 'edge'?"),
    ("from: lf", "from: lg", "from: ¦lg",
     "synapses[2].from: unknown source 'lg'; allowed: an input or a neuron: zmp, load, lf, q; did you "
     "mean 'lf'?"),
    ("to: [q]", "to: [p]", "to: [¦p",
     "synapses[2].to[0]: unknown target 'p'; allowed: a neuron: lf, q"),
    ("to: lf", "to: load", "to: ¦load",
     "synapses[0].to: found 'load', which is an input; allowed: a neuron: lf, q"),
    ("from: lf", "from: roll", "from: ¦roll",
     "synapses[2].from: found 'roll', which is an output; allowed: an input or a neuron: zmp, load, lf, q"),
    ("from: lf", "from: edge", "from: ¦edge",
     "synapses[2].from: found 'edge', which is a parameter; allowed: an input or a neuron: zmp, load, lf, q"),
    ("readout: {q: w}", "readout: {qq: w}", "readout: {¦qq",
     "outputs.roll.readout.qq: unknown neuron 'qq'; allowed: a neuron: lf, q; did you mean 'q'?"),
    ("readout: {q: w}", "readout: {q: w, zmp: w}", "  roll: {unit: deg, readout: {q: w, ¦zmp",
     "outputs.roll.readout.zmp: found 'zmp', which is an input; allowed: a neuron: lf, q"),
    ("  lf: {", "  load: {", "  ¦load: {model",
     "neurons.load: the name 'load' is taken by an input on line 9; allowed: a name of its own"),
    ("  roll: {", "  q: {", "  ¦q: {unit",
     "outputs.q: the name 'q' is taken by a neuron on line 12; allowed: a name of its own"),
    ("  load: {unit", "  time_s: {unit", "  ¦time_s",
     "inputs.time_s: found the name 'time_s', which tables use for the time; allowed: another name"),
    ("  edge: 80", "  2nd: 80", "  ¦2nd",
     f"parameters.2nd: found '2nd'; allowed: {NAME}"),
    # keys
    ("timing: ordered", "timings: ordered", "¦circuit",
     "missing key 'timing'; required: circuit, control_step, timing"),
    ("timing: ordered", "timings: ordered", "¦timings",
     "timings: unknown key 'timings'; allowed: circuit, control_step, description, include, inputs, "
     "neuron_models, neurons, outputs, parameters, populations, projections, seed, substeps, synapse_models, "
     "synapses, timing; did you mean 'timing'?"),
    ("slope: 500", "slop: 500", "  ¦lf",
     "neurons.lf: missing key 'slope'; required by sigmoid: model, role, slope, shift"),
    ("slope: 500", "slop: 500", "  lf: {model: sigmoid, role: inhibitory, ¦slop",
     "neurons.lf.slop: unknown key 'slop' for the model sigmoid; allowed: description, initial, model, "
     "noise, role, shift, slope; did you mean 'slope'?"),
    ("role: inhibitory, ", "", "  ¦lf",
     "neurons.lf: missing key 'role'; required: model, role"),
    ("weight: 1}", "wieght: 1}", "  - {from: load, to: lf, ¦wieght",
     "synapses[0].wieght: unknown key 'wieght'; allowed: delay, description, from, gate, kind, model, to, "
     "weight; did you mean 'weight'?"),
    ("weight: 1}", "wieght: 1}", "  - ¦{from: load",
     "synapses[0]: missing key 'weight'; required: from, to, weight"),
    ("range: [-1, 1]", "rnage: [-1, 1]", "  ¦load",
     "inputs.load: missing key 'range'; required: unit, range"),
    ("shift: 0.1", "shift: 0.1, description: left foot, alone", "  lf: {model: sigmoid, role: inhibitory, slope: 500, shift: 0.1, description: left foot, ¦alone",
     "neurons.lf.alone: unknown key 'alone' for the model sigmoid; allowed: description, initial, model, "
     "noise, role, shift, slope; inside braces, put a text that contains a comma in quotes"),
    # the text
    ("  q: {model", "  lf: {model", "  ¦lf: {model: sigmoid, role: excitatory",
     "neurons.lf: duplicate key 'lf', first on line 11; allowed: each key once"),
    ("slope: 500", "slope: 0500", "slope: ¦0500",
     "neurons.lf.slope: found 0500; allowed: a number without leading zeros (some take these for "
     "octal), or quotes for a text"),
    ("slope: 500", "slope: .inf", "slope: ¦.inf",
     "neurons.lf.slope: found .inf; allowed: a finite number"),
    ("slope: 500", "slope: nan", "slope: ¦nan",
     "neurons.lf.slope: found 'nan'; allowed: a finite number"),
    ("slope: 500", "slope: 1e999", "slope: ¦1e999",
     "neurons.lf.slope: found 1e999; allowed: a finite number"),
    ("slope: 500", "slope: on", "slope: ¦on",
     f"neurons.lf.slope: unknown parameter 'on'; allowed: {VALUE}: edge, w"),
    # types
    ("timing: ordered", "timing: orderd", "timing: ¦orderd",
     "timing: found 'orderd'; allowed: as_printed, synchronous, ordered; did you mean 'ordered'?"),
    ("role: inhibitory", "role: inhibiting", "role: ¦inhibiting",
     "neurons.lf.role: found 'inhibiting'; allowed: excitatory, inhibitory; did you mean 'inhibitory'?"),
    ("slope: 500", "slope: true", "slope: ¦true",
     f"neurons.lf.slope: found true; allowed: {VALUE}"),
    ("slope: 500", "slope: [500]", "slope: ¦[500",
     f"neurons.lf.slope: found a list of 1; allowed: {VALUE}"),
    ("weight: 1}", "weight: {value: 1}}", "weight: ¦{value",
     f"synapses[0].weight: found a mapping of 1; allowed: {VALUE}"),
    ("weight: 1}", "weight: }", "weight: ¦}",
     f"synapses[0].weight: found nothing; allowed: {VALUE}"),
    ("to: [q]", "to: []", "to: ¦[",
     "synapses[2].to: found a list of 0; allowed: at least 1"),
    ("to: [q]", "to: [5]", "to: [¦5",
     "synapses[2].to[0]: found 5; allowed: a text"),
    ("range: [-1, 1]", "range: [-1, 0, 1]", '  load: {unit: "1", range: ¦[-1',
     "inputs.load.range: found a list of 3; allowed: at most 2"),
    ("range: [-1, 1]", "range: 1", "range: ¦1",
     "inputs.load.range: found 1; allowed: a list"),
    ("readout: {q: w}", "readout: {}", "readout: ¦{",
     "outputs.roll.readout: found a mapping of 0; allowed: at least 1"),
    ("integrate: {leak: 5 %}", "integrate: 5 %", "integrate: ¦5 %",
     "outputs.roll.integrate: found '5 %'; allowed: a mapping"),
    ("circuit: small", "circuit: small one", "circuit: ¦small one",
     f"circuit: found 'small one'; allowed: {NAME}"),
    # units
    ("unit: deg", "unit: degs", "unit: ¦degs",
     f"outputs.roll.unit: unknown unit 'degs'; allowed: {UNITS}; did you mean 'deg'?"),
    ("unit: mm", "unit: 5", "unit: ¦5",
     "inputs.zmp.unit: found 5; allowed: a unit such as 'mm' or '1'"),
    ("control_step: 10 ms", "control_step: 0.01", "control_step: ¦0.01",
     "control_step: found 0.01 (dimensionless); allowed: time, such as '1 s'; did you mean '0.01 s'?"),
    ("[-150 mm, 150 mm]", "[-150 mm, 150]", "range: [-150 mm, ¦150",
     "inputs.zmp.range[1]: found 150 (dimensionless); allowed: length, such as '1 mm', since the unit "
     "is mm; did you mean '150 mm'?"),
    ("slope: 100 /m", "slope: 100", "slope: ¦100",
     "neurons.q.slope: found 100 (dimensionless); allowed: 1/length, such as '1 /m', since the "
     "activation is in mm; did you mean '100 /m'?"),
    ("weight: -1 m}", "weight: -1}", "  - {from: lf, to: [q], weight: ¦-1",
     "synapses[2].weight: found -1 (dimensionless); allowed: length, such as '1 mm', since the "
     "activation of q is in mm and lf is dimensionless; did you mean '-1 mm'?"),
    ("to: q, weight: -1}", "to: q, weight: -1 m}", "  - {from: zmp, to: q, weight: ¦-1 m",
     "synapses[1].weight: found -1 m (length); allowed: a number without unit, since the activation "
     "of q is in mm and zmp is in mm"),
    ("to: lf, weight: 1}", "to: lf, weight: 1 deg}", "weight: ¦1 deg",
     "synapses[0].weight: found 1 deg (angle); allowed: a number without unit, since the activation "
     "of lf is dimensionless and load is dimensionless"),
    ("w: {value: 2 deg", "w: {value: 2 mm", "q: ¦w",
     "outputs.roll.readout.q: found 2 mm (length); allowed: angle, such as '1 deg', since the output "
     "is in deg"),
    ("22 deg]", "22]", "limits: [-22 deg, ¦22",
     "outputs.roll.limits[1]: found 22 (dimensionless); allowed: angle, such as '1 deg', since the "
     "unit is deg; did you mean '22 deg'?"),
    ("leak: 5 %", "leak: 5 mm", "leak: ¦5 mm",
     "outputs.roll.integrate.leak: found 5 mm (length); allowed: a number without unit, since it is a "
     "part of the output"),
    ("edge: 80 mm", "edge: 80 mmm", "edge: 80 ¦mmm",
     f"parameters.edge: unknown unit 'mmm'; allowed: {UNITS}; did you mean 'mm'?"),
    ("shift: edge", "shift: edge - w", "shift: ¦edge - w",
     "neurons.q.shift: found 'edge - w', which joins length and angle; allowed: the same on all sides"),
    # values
    ("control_step: 10 ms", "control_step: 0 ms", "control_step: ¦0 ms",
     "control_step: found 0 ms; allowed: more than 0 s"),
    ("leak: 5 %", "leak: 5", "leak: ¦5",
     "outputs.roll.integrate.leak: found 5; allowed: from 0 to 1, or 0 % to 100 %"),
    ("range: [-1, 1]", "range: [1, -1]", "range: ¦[1",
     "inputs.load.range: found 1 before -1; allowed: the smaller value, then the larger one"),
    ("[-22 deg, 22 deg]", "[22 deg, 22 deg]", "limits: ¦[22 deg",
     "outputs.roll.limits: found 22 deg before 22 deg; allowed: the smaller value, then the larger one"),
    ("model: sigmoid, role: inhibitory, slope: 500, shift: 0.1", "model: window, role: inhibitory, slope: 5, low: 1, high: -1", "low: ¦1",
     "neurons.lf.low: found low 1 and high -1; allowed: low below high"),
    ("edge: 80 mm", "edge: -edge", "edge: ¦-edge",
     "parameters.edge: found a circle of parameters: edge -> edge; allowed: parameters that end in a value"),
    ("edge: 80 mm", "edge: far\n  far: edge - edge", "edge: ¦far",
     "parameters.edge: found a circle of parameters: edge -> far -> edge; allowed: parameters that "
     "end in a value"),
    # signs and doubles
    ("weight: -1 m}", "weight: 1 m}", "weight: ¦1 m",
     "synapses[2].weight: found 1 m, but lf is inhibitory; allowed: a negative weight, or the role "
     "excitatory for lf"),
    ("role: inhibitory", "role: excitatory", "weight: ¦-1 m",
     "synapses[2].weight: found -1 m, but lf is excitatory; allowed: a positive weight, or the role "
     "inhibitory for lf"),
    ("to: [q]", "to: [q, q]", "to: [q, ¦q",
     "synapses[2].to[1]: duplicate synapse lf -> q, first on line 16; allowed: each one once"),
    ("from: lf, to: [q], weight: -1 m", "from: zmp, to: q, weight: 1", "  - {from: zmp, to: ¦q, weight: 1",
     "synapses[2].to: duplicate synapse zmp -> q, first on line 15; allowed: each one once"),
]  # fmt: skip


def place(text: str, at: str) -> str:
    """`f.yaml:line:column` of the character behind the ¦."""
    context = at.replace("¦", "")
    assert text.count(context) == 1, context
    before = text[: text.index(context) + at.index("¦")]
    return f"f.yaml:{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"


@pytest.mark.parametrize(("old", "new", "at", "message"), ERRORS, ids=lambda text: text[:30])
def test_what_is_wrong_is_named_with_its_place(old, new, at, message, tmp_path, monkeypatch):
    assert old in BASE
    text = BASE.replace(old, new, 1)
    errors, _ = findings(text, tmp_path, monkeypatch)
    assert f"{place(text, at)}: {message}" in errors
    causes = [other for other in ERRORS if other[:2] == (old, new)]
    if old not in FOLLOWED:
        assert len(errors) == len(causes)


WARNINGS = [
    ("  edge: 80 mm", "  edge: 80 mm\n  spare: 3", "  ¦spare",
     "parameters.spare: unused parameter; nothing uses its name"),
    ("neurons:\n", "neurons:\n  lone: {model: step, role: excitatory, shift: 1}\n", "  ¦lone",
     "neurons.lone: unused neuron; no path leads from it to an output"),
    ("  - {from: load, to: lf, weight: 1}\n", "", "  ¦load",
     "inputs.load: unused input; no path leads from it to an output"),
    ("weight: -1}", "weight: 0}", "weight: ¦0",
     "synapses[1].weight: found a weight of 0; the synapse has no effect"),
    ("weight: -1 m}", "weight: 0 m}", "weight: ¦0 m",
     "synapses[2].weight: found a weight of 0; the synapse has no effect"),
    ("readout: {q: w}", "readout: {q: w, lf: 0 deg}", "lf: ¦0 deg",
     "outputs.roll.readout.lf: found a weight of 0; lf has no effect on the output"),
    ("edge", "zmp", "  ¦zmp: 80 mm",
     "parameters.zmp: the parameter has the same name as the input on line 8; give one another name"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "at", "message"), WARNINGS, ids=lambda text: text[:30])
def test_what_is_doubtful_is_a_warning(old, new, at, message, tmp_path, monkeypatch):
    text = BASE.replace(old, new)
    assert findings(text, tmp_path, monkeypatch) == ([], [f"{place(text, at)}: {message}"])


def test_errors_of_every_kind_are_listed_at_once(tmp_path, monkeypatch):
    """The text, its form, its names, units and signs: one wrong thing on each of many lines."""
    text = (
        BASE.replace("10 ms", "10 mm")
        .replace("timing: ordered", "timing: x")
        .replace("80 mm", "080 mm\n  edge: 7 mm")
        .replace('unit: "1", ', "")
        .replace("slope: 500", "slop: 500")
        .replace("shift: edge", "shift: egde")
        .replace("from: load", "from: laod")
        .replace("{q: w}", "{p: w}")
    )
    errors, _ = findings(text, tmp_path, monkeypatch)
    assert [error.split(": ")[0] for error in errors] == [
        "f.yaml:2:15", "f.yaml:3:9", "f.yaml:6:3", "f.yaml:10:3", "f.yaml:12:3", "f.yaml:12:42", "f.yaml:13:63",
        "f.yaml:15:12", "f.yaml:19:31",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new"), [("neurons:\n", "nuerons:\n"), ("inputs:", "input:"), ("readout:", "raedout:")]
)
def test_one_mistake_is_one_complaint(old, new, tmp_path, monkeypatch):
    """What follows from a lost section, such as names that are missing then, is not complained about as well."""
    errors, warnings = findings(BASE.replace(old, new), tmp_path, monkeypatch)
    (unknown,) = (error for error in errors if "unknown key" in error)
    assert unknown.endswith(f"did you mean '{old.strip().removesuffix(':')}'?")
    assert all("missing key" in error or "unknown key" in error for error in errors)
    assert warnings == []


@pytest.mark.parametrize(
    ("old", "new"),
    [("slope: 100 /m", "slpoe: 100 /m"), ("shift: edge", "shift: egde"), ("edge: 80 mm", "edge: 80 mmm")],
)
def test_synapses_of_an_unsound_neuron_are_not_complained_about(old, new, tmp_path, monkeypatch):
    errors, _ = findings(BASE.replace(old, new), tmp_path, monkeypatch)
    assert errors
    assert not any("synapses" in error for error in errors)


def test_a_circuit_needs_a_neuron_and_an_output(tmp_path, monkeypatch):
    errors, _ = findings(
        "circuit: none\ncontrol_step: 1 ms\ntiming: ordered\nneurons: {}\n", tmp_path, monkeypatch
    )
    assert errors == [
        "f.yaml:1:1: outputs: the circuit has no outputs; allowed: at least one",
        "f.yaml:4:10: neurons: the circuit has no neurons; allowed: at least one",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "f.yaml:1:1: the file is empty; allowed: a mapping of keys and values"),
        ("- a\n", "f.yaml:1:1: found a list of 1; allowed: a mapping"),
        ("neurons\n", "f.yaml:1:1: found 'neurons'; allowed: a mapping"),
    ],
)
def test_a_file_that_is_no_circuit(text, message, tmp_path, monkeypatch):
    assert findings(text, tmp_path, monkeypatch) == ([message], [])


def test_a_missing_file_and_an_unknown_name_are_errors_like_others():
    assert [str(error) for error in check("nowhere/none.yaml")[0]] == [
        "nowhere/none.yaml:1:1: there is no such file; allowed: a YAML file"
    ]
    (error,) = check("binn_latral")[0]
    assert error.hint == "did you mean 'binn_lateral'?"


def test_loading_raises_every_error(tmp_path):
    path = tmp_path / "f.yaml"
    path.write_text(BASE.replace("edge: 80", "edge: 80 k").replace("from: load", "from: laod"))
    with pytest.raises(InputError) as caught:
        load_circuit(path)
    assert [problem.line for problem in caught.value.problems] == [5, 14]
    assert caught.value.problems == check(path)[0]


def test_parameters_can_be_given_another_value():
    assert parse_circuit(BASE, settings={"w": "-180 deg"}).outputs[0].readout == (("q", -math.pi),)
    assert parse_circuit(BASE, settings={"edge": "70 mm"}).neurons[1].parameters["shift"] == 0.07
    assert parse_circuit(BASE).neurons[1].parameters["shift"] == 0.08
    with pytest.raises(UnknownNameError) as unknown:
        parse_circuit(BASE, settings={"edg": "70 mm"})
    assert str(unknown.value).startswith("unknown name 'edg'; allowed: edge, w, zmp.range.0, zmp.range.1, ")
    assert str(unknown.value).endswith("; did you mean 'edge'?")
    with pytest.raises(InputError) as caught:
        parse_circuit(BASE, settings={"edge": "70"})
    assert str(caught.value) == (
        "<text>:5:9: parameters.edge: found 70 (dimensionless); allowed: length, such as '1 mm', "
        "since the file has 80 mm; did you mean '70 mm'?"
    )


@pytest.mark.parametrize(("length", "is_allowed"), [(50, True), (51, False)])
def test_a_chain_of_parameters_has_a_length(length, is_allowed, tmp_path, monkeypatch):
    """Each one is the value of the one before it; the last one has a value of its own."""
    chain = "".join(f"  p{n}: p{n + 1}\n" for n in range(1, length)) + f"  p{length}: 1 mm\n"
    errors, _ = findings(BASE.replace("  edge: 80 mm\n", f"  edge: 80 mm\n{chain}"), tmp_path, monkeypatch)
    message = "found more than 50 parameters in a chain; allowed: fewer"
    assert [each for each in errors if each.endswith(message)] == ([] if is_allowed else errors)
    assert bool(errors) != is_allowed
