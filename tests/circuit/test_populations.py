"""Populations and projections: values of members, connections from rules and files, and every complaint."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pandas
import pyarrow
import pytest
from pyarrow import parquet
from scipy import sparse, stats

from circuitkit.base.errors import InputError, MissingDependencyError, UnknownNameError
from circuitkit.circuit import check, load_circuit, memory, parse_circuit
from circuitkit.circuit.resolving import projections

BASE = """\
circuit: many
control_step: 10 ms
timing: ordered
parameters: {edge: 80 mm, cells: 64}
inputs: {u: {unit: mm, range: [-1 m, 1 m]}}
neurons:
  p: {model: sigmoid, role: excitatory, slope: 10, shift: 0.5}
populations:
  ring: {size: 64, model: sigmoid, role: excitatory, slope: 100 /m, shift: 5 mm}
  off: {size: 8, model: leaky_linear, role: inhibitory, tau: 10 ms}
synapses:
  - {from: "ring[3]", to: p, weight: 1}
projections:
  - {from: u, to: ring, connect: all_to_all, weight: 1}
  - {from: ring, to: off, connect: all_to_all, weight: 1}
  - {from: off, to: ring, connect: all_to_all, weight: -1 mm}
outputs:
  y: {unit: "1", readout: {ring: 1, p: 1}}
"""
RING = "{size: 64, model: sigmoid, role: excitatory, slope: 100 /m, shift: 5 mm}"
TO_OFF = "{from: ring, to: off, connect: all_to_all, weight: 1}"
TO_RING = "{from: off, to: ring, connect: all_to_all, weight: -1 mm}"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def errors(old: str, new: str) -> list[str]:
    assert old in BASE
    Path("f.yaml").write_text(BASE.replace(old, new), encoding="utf-8")
    return [str(problem) for problem in check("f.yaml")[0]]


def ring(new: str):
    """The population, with another declaration."""
    return parse_circuit(BASE.replace(RING, new)).populations[0]


def shifts(value: str) -> np.ndarray:
    return ring(RING.replace("5 mm", value)).parameters["shift"]


def projection(new: str, old: str = TO_OFF):
    """The projection in place of one, with another declaration."""
    graph = parse_circuit(BASE.replace(old, new))
    return graph.projections[1 if old == TO_OFF else 2]


def test_the_base_is_valid():
    Path("f.yaml").write_text(BASE, encoding="utf-8")
    errors_found, warnings = check("f.yaml")
    assert errors_found == ()
    assert [warning.where for warning in warnings] == ["parameters.edge", "parameters.cells"]


def test_one_value_a_list_a_range_and_expressions():
    assert shifts("edge / 2") == 0.04
    assert shifts(f"[{', '.join(f'{i} mm' for i in range(64))}]") == pytest.approx(np.arange(64) / 1000)
    assert shifts("{range: [-edge, 80 mm]}") == pytest.approx(np.linspace(-0.08, 0.08, 64))
    angle = 2 * np.pi * np.arange(64) / 64
    assert shifts("cos(2*pi*i/n) * mm") == pytest.approx(np.cos(angle) / 1000)
    assert shifts("'where(i < n / 2, 1 mm, edge)'") == pytest.approx(
        np.where(np.arange(64) < 32, 0.001, 0.08)
    )


def test_distributions_have_their_law_and_their_seed():
    many = RING.replace("64", "5000")
    uniform = ring(many.replace("5 mm", "{uniform: [1 mm, 3 mm]}")).parameters["shift"]
    assert stats.kstest(uniform, stats.uniform(0.001, 0.002).cdf).pvalue > 1e-3
    normal = ring(many.replace("5 mm", "{normal: [1 mm, 20 %* 1 mm]}")).parameters["shift"]
    assert stats.kstest(normal, stats.norm(0.001, 0.0002).cdf).pvalue > 1e-3
    text = BASE.replace("5 mm", "{uniform: [1 mm, 3 mm]}")
    first, again = (parse_circuit(text) for _ in range(2))
    assert first == again
    assert parse_circuit(text, settings={"seed": 1}) != first
    added = text.replace("neurons:\n", "neurons:\n  extra: {model: step, role: excitatory, shift: 1}\n")
    same = parse_circuit(added).populations[0].parameters["shift"]
    assert np.array_equal(same, first.populations[0].parameters["shift"])


def test_the_size_may_be_a_parameter_and_given_from_outside():
    text = BASE.replace("size: 64", "size: cells")
    assert parse_circuit(text).populations[0].size == 64
    assert parse_circuit(text, settings={"cells": 6}).populations[0].size == 6
    assert parse_circuit(text, settings={"ring.size": 7}).populations[0].size == 7
    assert parse_circuit(text, settings={"off.tau": "5 ms"}).populations[1].parameters["tau"] == 0.005
    assert parse_circuit(text, settings={"off.noise": 0.1}).populations[1].noise == 0.1
    assert parse_circuit(text, settings={"off.initial.v": {"range": [0, 7]}}).populations[1].initial[
        "v"
    ].tolist() == list(range(8))
    with pytest.raises(UnknownNameError, match=r"did you mean 'off\.tau'"):
        parse_circuit(text, settings={"off.tua": "5 ms"})


def test_members_are_neurons_by_name():
    graph = parse_circuit(
        BASE.replace("readout: {ring: 1, p: 1}", 'readout: {ring: sin(2*pi*i/n), "off[7]": 1}')
    )
    assert graph.names()[:4] == ("u", "p", "ring[0]", "ring[1]")
    assert graph.neuron_names.index("off[7]") == 1 + 64 + 7
    assert graph.synapses[0].source == "ring[3]"
    assert graph.outputs[0].readout[0][1] == pytest.approx(np.sin(2 * np.pi * np.arange(64) / 64))
    assert graph.outputs[0].readout[1] == ("off[7]", 1.0)


def test_weights_may_depend_on_both_members():
    found = projection(TO_OFF.replace("weight: 1", "weight: i + 100 * j + n_source / n_target"))
    i, j = np.meshgrid(np.arange(64), np.arange(8))
    assert found.weights == pytest.approx((i + 100 * j + 8).ravel())
    assert found.indptr.tolist() == list(range(0, 513, 64))


def test_the_explicit_sources_of_every_target():
    rows = [[0, 5], [], [63], [1], [2], [3], [4], [5, 6, 7]]
    found = projection(
        TO_OFF.replace("all_to_all", f"{{sources: {rows}}}").replace(
            "weight: 1", "weight: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]"
        )
    )
    assert found.indptr.tolist() == [0, 2, 2, 3, 4, 5, 6, 7, 10]
    assert found.weights.tolist() == list(range(1, 11))
    assert found.sources.tolist() == [0, 5, 63, 1, 2, 3, 4, 5, 6, 7]


def test_models_of_projections_have_values_for_synapses_or_targets():
    per_target = TO_OFF.replace("weight: 1", "weight: 1, model: first_order, tau: (1 + j) * ms")
    assert projection(per_target).parameters["tau"] == pytest.approx(np.arange(1, 9) / 1000)
    assert projection(per_target.replace("(1 + j) * ms", "{range: [1 ms, 8 ms]}")) == projection(per_target)
    keys = "weight: 0.5, model: hebbian, rate: 0.01 * i, low: 0, high: j + 1"
    learning = projection(TO_OFF.replace("weight: 1", keys))
    i, j = np.meshgrid(np.arange(64), np.arange(8))
    assert learning.parameters["rate"] == pytest.approx(0.01 * i.ravel())
    assert learning.parameters["high"] == pytest.approx(j.ravel() + 1)
    assert learning.initial["w"] == 0.5


def test_a_random_projection_is_the_same_wherever_it_stands():
    rule = TO_OFF.replace("all_to_all", "{in_degree: 5}")
    there = projection(rule).sources
    other = BASE.replace(TO_OFF, f"{{from: p, to: off, connect: all_to_all, weight: 1}}\n  - {rule}")
    assert np.array_equal(parse_circuit(other).projections[2].sources, there)
    assert not np.array_equal(
        parse_circuit(BASE.replace(TO_OFF, rule), settings={"seed": 9}).projections[1].sources, there
    )


W = np.array([[0, 1.5, 0, 0, 0, 0, 0, -2.25], [3, 0, 0, 0, 0, 0, 0, 0]])


def matrix_circuit(name: str, weight: str = "-1") -> str:
    text = BASE.replace("size: 64", "size: 2").replace("ring[3]", "ring[1]")
    return text.replace(
        TO_RING, f"{{from: off, to: ring, connect: {{matrix: {name}}}, weight: {weight} mm, kind: sensorial}}"
    )


@pytest.mark.parametrize(
    "kind", ["csv", "csv edges", "parquet", "npz dense", "npz csr", "npz csc", "npz coo"]
)
def test_matrix_files_of_all_kinds_say_the_same(kind):
    if kind == "parquet":
        edges = pandas.DataFrame({"target": [1, 0, 0], "source": [0, 7, 1], "weight": [3.0, -2.25, 1.5]})
        edges.to_parquet("w.parquet")
    elif kind == "csv":
        np.savetxt("w.csv", W, delimiter=",")
    elif kind == "csv edges":
        Path("w.csv").write_text("target,source,weight\n1,0,3\n0,7,-2.25\n0,1,1.5\n", encoding="utf-8")
    elif kind == "npz dense":
        np.savez("w.npz", W)
    else:
        sparse.save_npz("w.npz", getattr(sparse, f"{kind[-3:]}_matrix")(W))
    suffix = kind.split()[0]
    found = parse_circuit(matrix_circuit(f"w.{suffix}")).projections[2]
    assert found.indptr.tolist() == [0, 2, 3]
    assert found.sources.tolist() == [1, 7, 0]
    assert found.weights == pytest.approx(np.array([1.5, -2.25, 3]) * -0.001)


def test_a_parquet_file_needs_a_package(monkeypatch):
    Path("w.parquet").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(
        MissingDependencyError, match=r"reading 'w.parquet' needs the package 'pyarrow'.*\[data\]"
    ):
        parse_circuit(matrix_circuit("w.parquet"))


def test_parquet_files_that_cannot_be_used():
    parquet.write_table(pyarrow.table({"source": [0], "remark": ["?"]}), "w.parquet")
    with pytest.raises(InputError, match="found the columns source, remark; allowed: source, target"):
        parse_circuit(matrix_circuit("w.parquet"))
    Path("w.parquet").write_text("nonsense", encoding="utf-8")
    with pytest.raises(InputError, match=r"cannot read 'w\.parquet': "):
        parse_circuit(matrix_circuit("w.parquet"))


def _write_nan() -> None:
    table = W.copy()
    table[1, 4] = np.nan
    np.savez("w.npz", table)


@pytest.mark.parametrize(
    ("name", "prepare", "message"),
    [
        ("none.npz", lambda: None, "there is no file 'none.npz'; allowed: a matrix file by path from here"),
        ("w.txt", lambda: None, "found a matrix file 'w.txt'; allowed: .csv, .npz, .parquet"),
        ("w.npz", lambda: np.savez("w.npz", W.T), "found a matrix of 8 x 2; allowed: 2 x 8, a row for every target"),
        ("w.npz", lambda: sparse.save_npz("w.npz", sparse.csr_matrix(W[:1])), "found a matrix of 1 x 8; allowed: 2 x 8, a row for every target"),
        ("w.npz", _write_nan, "found nan for the synapse from 4 to 1; allowed: finite numbers"),
        ("w.npz", lambda: Path("w.npz").write_text("nonsense"), "cannot read 'w.npz': "),
        ("w.npz", lambda: np.savez("w.npz", a=W, b=W), "found the arrays a, b; allowed: one, or a sparse matrix as scipy saves it"),
        ("w.npz", lambda: np.savez("w.npz", np.full((2, 8), None)), "cannot read 'w.npz': found data of the type object in 'arr_0'; allowed: real numbers"),
        ("w.npz", lambda: np.savez("w.npz", W * 1j), "cannot read 'w.npz': found complex numbers in 'arr_0'; allowed: real numbers"),
        ("w.csv", lambda: Path("w.csv").write_text(""), "found no numbers in 'w.csv'; allowed: a row for every target, or for every synapse"),
        ("w.csv", lambda: Path("w.csv").write_text("1,2\n3,x\n"), "found 'x' in 'w.csv', line 2, column 2; allowed: a finite number"),
        ("w.csv", lambda: Path("w.csv").write_text("source,targt\n1,0\n"), "found the columns source, targt; allowed: source, target and, if it has one, weight"),
        ("w.csv", lambda: Path("w.csv").write_text("source,target\n1,0\n8,1\n"), "found the source 8 in row 2; allowed: whole numbers from 0 to 7"),
        ("w.csv", lambda: Path("w.csv").write_text("source,target\n1,0\n1,0.5\n"), "found the target 0.5 in row 2; allowed: whole numbers from 0 to 1"),
        ("w.csv", lambda: Path("w.csv").write_text("source,target\n1,0\n1,0\n"), "found the synapse from 1 to 0 twice; allowed: each one once"),
    ],
)  # fmt: skip
def test_matrix_files_that_cannot_be_used(name, prepare, message):
    prepare()
    Path("f.yaml").write_text(matrix_circuit(name), encoding="utf-8")
    (error,) = check("f.yaml")[0]
    assert error.message.startswith(message)
    assert error.where == "projections[2].connect.matrix"
    assert error.line == 16


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("size: 64", "size: 0", "f.yaml:9:16: populations.ring.size: found 0; allowed: a whole number from 1 on"),
        ("size: 64", "size: -3", "f.yaml:9:16: populations.ring.size: found -3; allowed: a whole number from 1 on"),
        ("size: 64", "size: 2.5", "f.yaml:9:16: populations.ring.size: found 2.5; allowed: a whole number from 1 on"),
        ("size: 64", "size: edge", "f.yaml:9:16: populations.ring.size: found 80 mm (length); allowed: a number without unit, since it is a number of neurons"),
        ("ring[3]", "ring[64]", "f.yaml:12:12: synapses[0].from: found 'ring[64]', but the population has 64 members; allowed: ring[0] to ring[63]"),
        ("ring[3]", "ring", "f.yaml:12:12: synapses[0].from: found 'ring', which is a population; allowed: an input or a neuron: u, p"),
        ("to: p, weight: 1}", "to: ring, weight: 1 mm}", "f.yaml:12:27: synapses[0].to: found 'ring', which is a population; allowed: a neuron: p"),
        ("readout: {ring: 1", "readout: {\"rign[1]\": 1", "f.yaml:18:28: outputs.y.readout.rign[1]: unknown neuron 'rign[1]'; allowed: a neuron: p, ring, off; did you mean 'ring[1]'?"),
        ("shift: 5 mm", "shift: [1 mm, 2 mm]", "f.yaml:9:76: populations.ring.shift: found a list of 2; allowed: one value, or a list of 64"),
        ("shift: 5 mm", "shift: {unifrom: [1 mm, 2 mm]}", "f.yaml:9:77: populations.ring.shift.unifrom: found 'unifrom'; allowed: one of range, uniform, normal, with a list of two values; did you mean 'uniform'?"),
        ("shift: 5 mm", "shift: {uniform: [2 mm, 1 mm]}", "f.yaml:9:86: populations.ring.shift.uniform: found 2 mm and 1 mm; allowed: the smaller value, then the larger one"),
        ("shift: 5 mm", "shift: {normal: [2 mm, 1]}", "f.yaml:9:92: populations.ring.shift.normal[1]: found 1 (dimensionless); allowed: length, such as '1 mm', since the first one is 2 mm; did you mean '1 mm'?"),
        ("shift: 5 mm", "shift: {uniform: [2 mm]}", "f.yaml:9:86: populations.ring.shift.uniform: found a list of 1; allowed: a list of two values"),
        ("shift: 5 mm", "shift: {uniform: 2 mm}", "f.yaml:9:86: populations.ring.shift.uniform: found '2 mm'; allowed: a list of two values"),
        ("shift: 5 mm", "shift: i", "f.yaml:9:61: populations.ring.slope: found 100 /m (1/length); allowed: a number without unit, since the activation is dimensionless"),
        ("shift: 5 mm", "shift: 1 mm / i", "f.yaml:9:76: populations.ring.shift: found '1 mm / i', which is too large or no number; allowed: a finite number"),
        (TO_OFF, TO_OFF.replace("weight: 1", "weight: log(i)"), "f.yaml:15:56: projections[1].weight: found 'log(i)', which is too large or no number; allowed: a finite number"),
        ("shift: 5 mm", "shift: k * mm", "f.yaml:9:76: populations.ring.shift: unknown parameter 'k'; allowed: a number, a quantity such as '-80 mm', or a parameter: edge, cells"),
        (TO_OFF, TO_OFF.replace("all_to_all", "{in_degree: 65}"), "f.yaml:15:48: projections[1].connect.in_degree: found 65, but ring has only 64 members; allowed: up to 64"),
        (TO_OFF, TO_OFF.replace("all_to_all", "{in_degree: 1.5}"), "f.yaml:15:48: projections[1].connect.in_degree: found 1.5; allowed: a whole number from 1 on"),
        (TO_OFF, TO_OFF.replace("all_to_all", "{probability: 2}"), "f.yaml:15:50: projections[1].connect.probability: found 2; allowed: from 0 to 1, or 0 % to 100 %"),
        (TO_OFF, TO_OFF.replace("all_to_all", "{probability: 0.1, in_degree: 2}"), "f.yaml:15:36: projections[1].connect: found probability and in_degree; allowed: one of probability, in_degree, matrix, sources"),
        (TO_OFF, TO_OFF.replace("all_to_all", "one_to_one"), "f.yaml:15:36: projections[1].connect: found one_to_one between 64 in ring and 8 in off; allowed: equal numbers"),
        (TO_OFF, TO_OFF.replace("all_to_all", "all_to_al"), "f.yaml:15:36: projections[1].connect: found 'all_to_al'; allowed: all_to_all, one_to_one or a mapping; did you mean 'all_to_all'?"),
        (TO_OFF, TO_OFF.replace("all_to_all", "{sources: [[0]]}"), "f.yaml:15:46: projections[1].connect.sources: found 1 lists, but off has 8 members; allowed: one for each"),
        (TO_OFF, TO_OFF.replace("all_to_all", "{sources: [[1, 0], [], [], [], [], [], [], []]}"), "f.yaml:15:47: projections[1].connect.sources[0]: found [1, 0]; allowed: ascending numbers from 0 to 63"),
        (TO_OFF, TO_OFF.replace("weight: 1", "weight: 1 mm"), "f.yaml:15:56: projections[1].weight: found 1 mm (length); allowed: a number without unit, since the activation of off is dimensionless and ring is dimensionless"),
        (TO_OFF, TO_OFF.replace("weight: 1", "weight: i - 1"), "f.yaml:15:56: projections[1].weight: found weights from -1 to 62, but ring is excitatory; allowed: a positive weight, or the role inhibitory for ring"),
        (TO_OFF, TO_OFF.replace(", weight: 1", ""), "f.yaml:15:5: projections[1]: missing key 'weight'; required: from, to, connect, weight"),
        (TO_OFF, TO_OFF.replace("weight: 1", "wieght: 1"), "f.yaml:15:48: projections[1].wieght: unknown key 'wieght' for the model static; allowed: connect, delay, description, from, gate, kind, model, self, to, weight; did you mean 'weight'?"),
        (TO_OFF, TO_OFF.replace("to: off", "to: of"), "f.yaml:15:22: projections[1].to: unknown target 'of'; allowed: a neuron or a population: p, ring, off; did you mean 'off'?"),
        (TO_OFF, TO_OFF.replace("weight: 1", "weight: 1, gate: p"), "f.yaml:15:59: projections[1].gate: found a gate, but the model static has none; allowed: no key 'gate', or another model"),
        ("readout: {ring: 1", "readout: {\"ring[x]\": 1", "f.yaml:18:28: outputs.y.readout.ring[x]: unknown neuron 'ring[x]'; allowed: a neuron: p, ring, off; a member is called by its number, such as ring[0]"),
        (TO_OFF, TO_OFF.replace("weight: 1", "weight: 1, delay: -1 ms"), "f.yaml:15:66: projections[1].delay: found -1 ms; allowed: 0 s or more"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_place(old, new, message):
    assert message in errors(old, new)


def test_a_delay_of_a_projection_between_steps_is_doubted():
    Path("f.yaml").write_text(BASE.replace("weight: -1 mm", "weight: -1 mm, delay: 14 ms"), encoding="utf-8")
    warning = "f.yaml:16:70: projections[2].delay: found 14 ms; it becomes 10 ms, a multiple of 10 ms"
    assert warning in [str(each) for each in check("f.yaml")[1]]


def test_the_readout_of_a_population_that_is_wrong_is_not_complained_about():
    weights = "readout: {ring: cos(2 * pi * i / n)"
    document = BASE.replace("size: 64", "size: 0").replace("readout: {ring: 1", weights)
    with pytest.raises(InputError) as caught:
        parse_circuit(document, "f.yaml")
    assert [problem.where for problem in caught.value.problems] == ["populations.ring.size"]


def test_too_many_neurons_are_refused_before_anything_is_allocated(monkeypatch):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 24_000_000_000)
    assert errors("size: 64", "size: 1000000000")[0] == (
        "f.yaml:9:16: populations.ring.size: found 1000000000 neurons, which need about 64 GB of memory, but this machine "
        "has 24 GB; allowed: fewer"
    )


@pytest.mark.parametrize(
    ("weight", "need"),
    [
        ("weight: -1", "20 GB"),
        ("weight: -1 - i", "60 GB"),
        ("weight: -1, model: hebbian, rate: 0.01, low: -2, high: 0", "60 GB"),  # its state
    ],
)
def test_too_many_synapses_are_refused_before_anything_is_allocated(monkeypatch, weight, need):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 1_000_000_000)
    text = (
        TO_OFF.replace("ring", "off").replace("all_to_all", "{probability: 0.5}").replace("weight: 1", weight)
    )
    Path("f.yaml").write_text(BASE.replace(TO_OFF, text).replace("size: 8", "size: 100000"), encoding="utf-8")
    assert (
        f"found 5000000000 synapses, which need about {need} of memory (with the rest of the circuit {need})"
        in str(check("f.yaml")[0][0])
    )


def test_the_machine_has_memory():
    assert 2**28 < memory.machine_bytes() < 2**50


MANY = BASE.replace("size: 64", "size: 1000000").replace(
    TO_RING, "{from: off, to: p, connect: all_to_all, weight: -1}"
)


@pytest.mark.parametrize("rule", ["{in_degree: 10}", "{probability: 1e-5}", "{matrix: w.npz}"])
def test_a_million_neurons_and_ten_million_synapses_take_little_memory(rule):
    """The issue's figure: at most 20 bytes a synapse at the peak, of which the result has 12."""
    many = f"{{from: ring, to: ring, connect: {rule}, weight: WEIGHT}}"
    if "matrix" in rule:
        indptr = np.arange(0, 10_000_001, 10)
        sources = np.tile(np.arange(0, 1_000_000, 100_000, dtype=np.int32), 1_000_000)
        np.savez(
            "w.npz", format=b"csr", shape=(10**6, 10**6), indptr=indptr, indices=sources, data=np.ones(10**7)
        )
        many = many.replace("WEIGHT", "2 mm")
    text = MANY.replace(TO_OFF, many.replace("WEIGHT", "{uniform: [0 mm, 1 mm]}"))
    tracemalloc.start()
    start = time.process_time()
    graph = parse_circuit(text)
    needed = time.process_time() - start
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(graph.projections[1].sources) == pytest.approx(1e7, rel=0.01)
    assert peak < 20e7
    assert needed < 10


def test_populations_bring_numpy_only_when_there_are_some():
    code = "import sys, circuitkit; circuitkit.check(sys.argv[1]); print('numpy' in sys.modules)"
    Path("f.yaml").write_text(BASE, encoding="utf-8")
    found = [
        subprocess.run(
            [sys.executable, "-c", code, name], capture_output=True, text=True, check=True
        ).stdout.strip()
        for name in ("binn_planar", "f.yaml")
    ]
    assert found == ["False", "True"]


def test_graphs_with_populations_are_equal_if_they_mean_the_same():
    first, again = (parse_circuit(BASE) for _ in range(2))
    assert first == again
    for old, new in (
        (RING, RING.replace("5 mm", "6 mm")),
        (TO_OFF, TO_OFF.replace("weight: 1", "weight: 1 + 0 * i")),
        ("ring: 1,", "ring: i,"),
    ):
        assert parse_circuit(BASE.replace(old, new)) != first


def test_the_networkx_view_has_every_member_and_synapse():
    graph = parse_circuit(BASE.replace(TO_OFF, TO_OFF.replace("weight: 1", "weight: i + 1")))
    view = graph.to_networkx()
    assert tuple(view) == graph.names()
    assert view.edges["ring[5]", "off[2]"] == {"weight": 6.0, "kind": "excitatory"}
    assert view.edges["ring[5]", "y"]["kind"] == "readout"
    assert view.number_of_edges() == 1 + 64 + 2 * 512 + 64 + 1


def test_loading_from_a_file_finds_the_matrix_beside_it():
    Path("sub").mkdir()
    np.savez("sub/w.npz", W)
    Path("sub/f.yaml").write_text(matrix_circuit("w.npz"), encoding="utf-8")
    assert len(load_circuit("sub/f.yaml").projections[2].sources) == 3


@pytest.mark.parametrize("weight", ["0", "0 * i"])
def test_a_projection_of_weights_of_0_is_doubted(tmp_path, weight):
    path = tmp_path / "f.yaml"
    path.write_text(BASE.replace(TO_OFF, TO_OFF.replace("weight: 1", f"weight: {weight}")), encoding="utf-8")
    errors_found, warnings = check(path)
    assert errors_found == ()
    assert [each.message for each in warnings if each.where == "projections[1].weight"] == [
        "found a weight of 0; the projection has no effect"
    ]


@pytest.mark.parametrize(("probability", "synapses"), [("0", 0), ("1", 64 * 8), ("100 %", 64 * 8)])
def test_probabilities_may_be_0_and_1(probability, synapses):
    text = BASE.replace(TO_OFF, TO_OFF.replace("all_to_all", f"{{probability: {probability}}}"))
    assert len(parse_circuit(text).projections[1].sources) == synapses


@pytest.mark.parametrize("chunk", [1, 3, 7, 1000])
def test_expressions_of_synapses_are_worked_out_in_parts(monkeypatch, chunk):
    """Whatever the size of a part: i + 100 j, and several rows or only a part of one in it."""
    monkeypatch.setattr(projections, "_CHUNK", chunk)
    new = "{from: ring, to: off, connect: all_to_all, weight: i + 100 * j + 1}"
    graph = parse_circuit(BASE.replace(TO_OFF, new))
    (found,) = (each for each in graph.projections if (each.source, each.target) == ("ring", "off"))
    np.testing.assert_array_equal(
        np.asarray(found.weights).reshape(8, 64), np.arange(64) + 100 * np.arange(8)[:, None] + 1
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("to: off, connect", "to: of, connect", "f.yaml:15:22: projections[1].to: unknown target 'of'; "),
        (
            "from: ring, to: off",
            "from: rin, to: off",
            "f.yaml:15:12: projections[1].from: unknown source 'rin'; ",
        ),
    ],
)
def test_ends_of_projections_that_are_not_there_have_their_place(old, new, said):
    (error,) = errors(old, new)
    assert error.startswith(said)


def test_a_file_of_another_kind_is_told_by_its_first_key():
    Path("f.yaml").write_text("foo: 1\nbar: 2\nbaz: 3\n", encoding="utf-8")
    (error,) = check("f.yaml")[0]
    assert str(error).startswith(
        "f.yaml:1:1: foo: unknown key 'foo' and 2 more, so this is no circuit; allowed: "
    )
