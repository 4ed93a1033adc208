"""Circuits inside circuits: names, parameters, inputs as weighted sums, outputs, and every complaint."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from circuitkit.base.errors import UnknownNameError
from circuitkit.circuit import check, load_circuit, parse_circuit
from circuitkit.circuit.authoring.flat import flat_yaml
from circuitkit.engine import compile_circuit, run

INNER = """\
parameters:
  w: 2 deg
  edge: 80 mm
inputs:
  zmp: {unit: mm, range: [-150 mm, 150 mm]}
  load: {unit: "1", range: [-1, 1]}
neurons:
  lf: {model: sigmoid, role: inhibitory, slope: 500, shift: 0.1}
  q: {model: sigmoid, role: excitatory, slope: 100 /m, shift: edge}
synapses:
  - {from: load, to: lf, weight: 1}
  - {from: zmp, to: q, weight: -1}
  - {from: lf, to: q, weight: -1 m}
outputs:
  roll: {unit: deg, readout: {q: w}}
"""
OUTER = """\
circuit: outer
control_step: 10 ms
timing: ordered
include:
  - {file: inner.yaml, as: a}
parameters: {}
inputs: {x: {unit: m, range: [-1 m, 1 m]}, y: {unit: m, range: [-1 m, 1 m]}, n: {unit: "1", range: [-1, 1]}}
neurons:
  p: {model: sigmoid, role: excitatory, slope: 10, shift: 0.5}
synapses:
  - {from: x, to: p, weight: 1 /m}
  - {from: y, to: p, weight: 1 /m}
  - {from: n, to: p, weight: 1}
outputs:
  out: {unit: "1", readout: {p: 1}}
"""
ENTRY = "  - {file: inner.yaml, as: a}\n"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write("inner.yaml", INNER)


def write(name: str, text: str) -> None:
    Path(name).write_text(text, encoding="utf-8")


def with_entry(*entries: str) -> str:
    return OUTER.replace(ENTRY, "".join(f"  - {{file: inner.yaml, {entry}}}\n" for entry in entries))


def graph_of(text: str, overrides=None):
    write("outer.yaml", text)
    return load_circuit("outer.yaml", overrides)


def errors(text: str) -> list[str]:
    write("outer.yaml", text)
    return [str(problem) for problem in check("outer.yaml")[0]]


def weights(graph) -> dict[tuple[str, str], float]:
    return {(each.source, each.target): each.weight for each in graph.synapses}


def test_everything_inside_has_the_name_of_the_instance_before_it():
    graph = graph_of(OUTER)
    assert graph.names() == ("a.zmp", "a.load", "x", "y", "n", "a.lf", "a.q", "p", "a.roll", "out")
    assert list(graph.parameters) == ["a.w", "a.edge"]
    assert weights(graph)["a.lf", "a.q"] == -1
    assert str(graph.neurons[1].origin) == "inner.yaml:9:3"


def test_parameters_are_set_for_each_instance_in_terms_of_the_outer_file():
    text = with_entry("as: a, parameters: {edge: 2 * far}", "as: b, parameters: {edge: a.edge - 1 cm}")
    graph = graph_of(text.replace("parameters: {}", "parameters: {far: 30 mm}"))
    shift = {neuron.name: neuron.parameters["shift"] for neuron in graph.neurons}
    assert shift["a.q"] == pytest.approx(0.06)
    assert shift["b.q"] == pytest.approx(0.05)


def test_an_input_may_be_another_input():
    graph = graph_of(with_entry("as: a, inputs: {zmp: x}"))
    assert [node.name for node in graph.inputs] == ["a.load", "x", "y", "n"]
    (synapse,) = (each for each in graph.synapses if each.target == "a.q" and each.source == "x")
    assert (synapse.weight, synapse.kind) == (-1, "sensorial")


def test_an_input_may_be_a_weighted_sum_of_inputs_neurons_and_outputs():
    """The circuit is linear in its inputs: weights are multiplied, and those onto the same target are added."""
    text = with_entry("as: a, inputs: {zmp: {x: 0.5, p: -2 mm, out: 3 mm, y: cos(120 deg)}, load: p}")
    graph = graph_of(text)
    found = weights(graph)
    assert found["x", "a.q"] == -0.5
    assert found["p", "a.q"] == pytest.approx(0.002 - 0.003)
    assert found["y", "a.q"] == pytest.approx(0.5)
    assert found["p", "a.lf"] == 1
    assert {each.kind for each in graph.synapses if each.source == "p"} == {"sensorial"}


def test_an_input_may_be_an_input_output_or_neuron_of_another_instance():
    text = with_entry(
        "as: a, inputs: {zmp: x}", "as: b, inputs: {zmp: a.zmp, load: a.q}", "as: c, inputs: {zmp: b.zmp}"
    )
    found = weights(graph_of(text))
    assert found["x", "b.q"] == found["x", "c.q"] == -1
    assert found["a.q", "b.lf"] == 1


def test_a_sum_for_an_input_is_the_sum_of_the_signals():
    """Whatever the outer signals are, the inner circuit does what it does alone on their weighted sum."""
    write("alone.yaml", "circuit: alone\ncontrol_step: 10 ms\ntiming: ordered\n" + INNER)
    joined = compile_circuit(graph_of(with_entry("as: a, inputs: {zmp: {x: 0.3, y: -0.7}, load: n}")))
    alone = compile_circuit(load_circuit("alone.yaml"))
    x, y, load = np.random.default_rng(1).uniform(-0.5, 0.5, (3, 20))
    assert joined.input_names == ("x", "y", "n")
    assert alone.input_names == ("zmp", "load")
    inside = run(joined, np.stack([x, y, load], axis=-1)[:, None])
    outside = run(alone, np.stack([0.3 * x - 0.7 * y, load], axis=-1)[:, None])
    assert joined.output_names[0] == "a.roll"
    assert inside.readout[:, 0, 0] == pytest.approx(outside.readout[:, 0, 0], rel=1e-12)


def test_outputs_are_kept_renamed_or_left_out():
    assert [node.name for node in graph_of(with_entry("as: a")).outputs] == ["a.roll", "out"]
    renamed = graph_of(with_entry("as: a, outputs: {roll: pitch}"))
    assert [node.name for node in renamed.outputs] == ["pitch", "out"]
    assert (
        renamed.outputs[0].readout
        == graph_of(with_entry("as: a")).outputs[0].readout
        == (("a.q", pytest.approx(0.0349065850)),)
    )
    assert [node.name for node in graph_of(with_entry("as: a, outputs: {}")).outputs] == ["out"]


def test_the_outer_file_uses_what_is_inside():
    text = OUTER.replace(
        "  - {from: n, to: p, weight: 1}",
        "  - {from: a.q, to: p, weight: 1}\n  - {from: n, to: a.lf, weight: 2}",
    )
    text = text.replace("readout: {p: 1}", "readout: {p: 1, a.q: a.w / (1 deg)}")
    graph = graph_of(text)
    assert weights(graph)["a.q", "p"] == 1
    assert weights(graph)["n", "a.lf"] == 2
    assert graph.outputs[-1].readout == (("p", 1.0), ("a.q", pytest.approx(2.0)))


def test_instances_inside_instances():
    write(
        "middle.yaml",
        "include:\n  - {file: inner.yaml, as: b, inputs: {zmp: z}, outputs: {roll: r}}\ninputs: {z: {unit: m, range: [-1 m, 1 m]}}\n",
    )
    text = OUTER.replace("inner.yaml, as: a", "middle.yaml, as: a, inputs: {z: {x: 2}}, outputs: {r: angle}")
    graph = graph_of(text, {"a.b.q.slope": "50 /m", "a.b.w": "1 deg"})
    assert weights(graph)["x", "a.b.q"] == -2
    assert graph.outputs[0].name == "angle"
    assert graph.neurons[1].parameters["slope"] == 50
    assert graph.outputs[0].readout[0][1] == pytest.approx(0.0174532925)


def test_no_warning_about_what_an_instance_does_not_use():
    write(
        "outer.yaml",
        with_entry("as: a, inputs: {zmp: x, load: n}, outputs: {}").replace(
            "readout: {p: 1}", "readout: {p: 1, a.q: 1}"
        ),
    )
    assert check("outer.yaml") == ((), ())
    write("outer.yaml", with_entry("as: a, inputs: {zmp: x, load: n}, outputs: {}"))
    assert [str(problem) for problem in check("outer.yaml")[1]] == [
        "outer.yaml:5:5: include[0]: unused instance; no path leads from it to an output"
    ]


def test_the_flat_file_of_instances_resolves_to_the_same_circuit():
    graph = graph_of(with_entry("as: a, inputs: {zmp: {x: 0.5, p: -2 mm}}", "as: b, outputs: {roll: pitch}"))
    text = flat_yaml(graph)
    assert "  a.q: {model: sigmoid, role: excitatory, slope: 100 /m, shift: 80 mm}" in text.splitlines()
    assert "- {from: p, to: a.q, weight: 0.002 m, kind: sensorial}" in text.splitlines()
    assert parse_circuit(text) == replace(graph, parameters={})


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("as: a, inputs: {zpm: x}",
         "outer.yaml:5:40: include[0].inputs.zpm: unknown input 'zpm'; allowed: an input of inner.yaml: zmp, load; did you mean 'zmp'?"),
        ("as: a, outputs: {rol: r}",
         "outer.yaml:5:41: include[0].outputs.rol: unknown output 'rol'; allowed: an output of inner.yaml: roll; did you mean 'roll'?"),
        ("as: a, parameters: {egde: 1 mm}",
         "outer.yaml:5:44: include[0].parameters.egde: unknown parameter 'egde'; allowed: a parameter of inner.yaml: w, edge; did you mean 'edge'?"),
        ("as: a, parameters: {edge: 1 deg}",
         "outer.yaml:5:50: include[0].parameters.edge: found 1 deg (angle); allowed: length, such as '1 mm', since at inner.yaml:3:3 it is 80 mm"),
        ("as: a, parameters: {edge: fra}",
         "outer.yaml:5:50: include[0].parameters.edge: unknown parameter 'fra'; allowed: a number, a quantity such as '-80 mm', or a parameter: a.w, a.edge"),
        ("as: a, inputs: {zmp: xx}",
         "outer.yaml:5:45: include[0].inputs.zmp: unknown source 'xx'; allowed: an input, a neuron or an output: x, y, n, p, out, a.zmp, a.load, a.lf, a.q, a.roll; did you mean 'x'?"),
        ("as: a, inputs: {zmp: n}",
         "outer.yaml:5:45: include[0].inputs.zmp: found n dimensionless; allowed: a factor in m, since the input a.zmp is in mm"),
        ("as: a, inputs: {zmp: {x: 1 mm}}",
         "outer.yaml:5:49: include[0].inputs.zmp.x: found x in m times a factor in mm; allowed: a factor without unit, since the input a.zmp is in mm"),
        ("as: a, inputs: {zmp: {}}",
         "outer.yaml:5:45: include[0].inputs.zmp: found an empty sum; allowed: at least one name"),
        ("as: a, inputs: {zmp: a.zmp}",
         "outer.yaml:5:45: include[0].inputs.zmp: found a circle of inputs: a.zmp -> a.zmp; allowed: inputs that end in a node of the circuit"),
        ("as: p",
         "outer.yaml:5:28: include[0].as: the name 'p' is taken by a neuron on line 9; allowed: a name of its own"),
        ("as: a, outputs: {roll: p}",
         "outer.yaml:5:47: include[0].outputs.roll: the name 'p' is taken; allowed: a name of its own"),
        ("as: a.b",
         "outer.yaml:5:28: include[0].as: found 'a.b'; allowed: a name without dots"),
        ("az: a",
         "outer.yaml:5:5: include[0]: missing key 'as'; required: file, as"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_entry(entry, message):
    assert message in errors(with_entry(entry))


def test_an_output_that_adds_up_cannot_feed_an_input():
    write("inner.yaml", INNER.replace("readout: {q: w}}", "readout: {q: w}, integrate: {leak: 5 %}}"))
    assert errors(with_entry("as: a", "as: b, inputs: {load: {a.roll: 1 /deg}}")) == [
        "outer.yaml:6:47: include[1].inputs.load.a.roll: found 'a.roll', an output that adds up; allowed: inputs, "
        "neurons and plain sums; name the neurons that it reads, with weights: q"
    ]


def test_an_output_that_reads_a_population_cannot_feed_an_input():
    write(
        "inner.yaml",
        INNER.replace(
            "synapses:", "populations: {z: {size: 2, model: identity, role: excitatory}}\nsynapses:"
        ).replace("readout: {q: w}", "readout: {z: w}"),
    )
    assert (
        "outer.yaml:6:47: include[1].inputs.load.a.roll: found 'a.roll', an output that reads the population z; "
        "allowed: outputs that read single neurons"
    ) in errors(with_entry("as: a", "as: b, inputs: {load: {a.roll: 1 /deg}}"))


def test_a_mistake_inside_says_which_instance():
    write("inner.yaml", INNER.replace("lf, to: q, weight: -1 m", "lf, to: q, weight: -1"))
    assert errors(with_entry("as: a", "as: b"))[0] == (
        "inner.yaml:13:31: synapses[2].weight: found -1 (dimensionless); allowed: length, such as '1 mm', since the "
        "activation of a.q is in mm and a.lf is dimensionless (in the instance 'a' of outer.yaml:5:5); did you mean '-1 mm'?"
    )


def test_a_synapse_that_is_there_inside_is_a_duplicate_outside():
    text = OUTER.replace(
        "  - {from: n, to: p", "  - {from: a.lf, to: a.q, weight: -1 m}\n  - {from: n, to: p"
    )
    assert errors(text) == [
        "outer.yaml:13:22: synapses[2].to: duplicate synapse a.lf -> a.q, first at inner.yaml:13:5; allowed: each one once"
    ]


def test_a_circle_of_instances_is_an_error():
    write("inner.yaml", "include:\n  - {file: outer.yaml, as: again}\n" + INNER)
    assert errors(OUTER) == [
        "inner.yaml:2:12: include[0].file: found a circle of includes: outer.yaml -> inner.yaml -> outer.yaml; allowed: includes that end"
    ]


def test_a_circle_of_parameters_through_an_instance_is_an_error():
    text = with_entry("as: a, parameters: {edge: far}").replace("parameters: {}", "parameters: {far: a.edge}")
    assert any("found a circle of parameters: " in error for error in errors(text))


def test_instances_of_instances_do_not_explode():
    """Sixteen files of which each has the next one twice: 65 536 instances from 16 lines."""
    for number in range(16):
        inner = f"part{number + 1}.yaml" if number < 15 else "inner.yaml"
        write(f"part{number}.yaml", f"include:\n  - {{file: {inner}, as: a}}\n  - {{file: {inner}, as: b}}\n")
    assert any(
        "found more than 2000 instances in all; allowed: fewer" in error
        for error in errors(OUTER.replace("inner.yaml", "part0.yaml"))
    )


def test_a_file_that_is_missing_hides_no_name():
    text = OUTER.replace("inner.yaml", "iner.yaml").replace("readout: {p: 1}", "readout: {p: 1, a.q: 1}")
    assert errors(text) == [
        "outer.yaml:5:12: include[0].file: found 'iner.yaml', but there is no file 'iner.yaml'; allowed: a path from here; did you mean 'inner.yaml'?"
    ]


def test_a_folder_is_no_file():
    Path("parts").mkdir()
    assert errors(OUTER.replace("inner.yaml", "parts"))[0] == (
        "outer.yaml:5:12: include[0].file: found 'parts', which is a folder; allowed: the path of a circuit file from here"
    )


def test_a_name_with_the_instance_s_name_before_it_belongs_to_the_instance():
    text = OUTER.replace("  p: {model", "  a.r: {model: step, role: excitatory, shift: 1}\n  p: {model")
    assert errors(text) == [
        "outer.yaml:9:3: neurons.a.r: the name 'a.r' belongs to the instance 'a'; allowed: a neuron without a dot"
    ]


def test_a_model_with_states_needs_one_source():
    write(
        "inner.yaml",
        INNER.replace("load, to: lf, weight: 1}", "load, to: lf, weight: 1, model: first_order, tau: 5 ms}"),
    )
    assert weights(graph_of(with_entry("as: a, inputs: {load: p}")))["p", "a.lf"] == 1
    (error,) = errors(with_entry("as: a, inputs: {load: {p: 2}}"))
    assert error == (
        "inner.yaml:11:12: synapses[0].from: found 'a.load', which is fed by a weighted sum; "
        "the model first_order needs one source; allowed: an input that is fed by one node, without a factor; "
        "or a static synapse to a neuron between (in the instance 'a' of outer.yaml:5:5)"
    )


def test_overriding_values_of_instances():
    write("outer.yaml", OUTER)
    graph = load_circuit("outer.yaml", {"a.q.slope": "50 /m", "a.edge": "7 cm", "p.slope": 3})
    assert [neuron.parameters for neuron in graph.neurons] == [
        {"slope": 500, "shift": 0.1}, {"slope": 50, "shift": 0.07}, {"slope": 3, "shift": 0.5}
    ]  # fmt: skip
    with pytest.raises(UnknownNameError) as caught:
        load_circuit("outer.yaml", {"a.q.slpe": 1})
    assert str(caught.value).endswith("did you mean 'a.q.slope'?")
