"""The page about the language shows circuits that are valid, messages that really come, and every key."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from circuitkit.circuit import check, circuit_schema, load_circuit
from circuitkit.circuit.expressions.expression import SCALAR_FUNCTIONS
from circuitkit.circuit.models import NEURON_MODEL_NAMES, SYNAPSE_MODEL_NAMES, neuron_model, synapse_model
from circuitkit.engine import compile_circuit, run

PAGE = (Path(__file__).parents[2] / "docs" / "language.md").read_text(encoding="utf-8")
MODELS = (Path(__file__).parents[2] / "docs" / "models" / "README.md").read_text(encoding="utf-8")
EXAMPLES = {
    text.splitlines()[0].removeprefix("# "): text
    for text in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
}
MESSAGES, *_ = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture(autouse=True)
def _examples_as_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in EXAMPLES.items():
        Path(name).write_text(text, encoding="utf-8")


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_are_valid_and_run(name):
    assert check(name) == ((), ())
    program = compile_circuit(load_circuit(name))
    trace = run(program, np.full((50, 1, len(program.input_names)), 0.1))
    assert np.isfinite(trace.readout).all()


def test_the_instances_of_the_example_mirror_each_other():
    """1 cm beyond the left edge, and 1 cm beyond the right one: the same output, each on its side."""
    program = compile_circuit(load_circuit("two_edges.yaml"))
    trace = run(program, np.array([[[0.09, 0.0]], [[-0.08, 0.0]]]))
    left, right = (trace.neuron_names.index(f"{side}.edge_passed") for side in ("left", "right"))
    assert trace.output[0, 0, left] == pytest.approx(trace.output[1, 0, right], rel=1e-12)
    assert trace.output[0, 0, left] == pytest.approx(1 / (1 + math.exp(-1)), rel=1e-9)


def test_the_messages_are_the_real_ones():
    good = EXAMPLES["edge_reflex.yaml"]
    wrong = good.replace("slope: 500", "slope: 500 /m").replace("from: zmp_y", "from: zmp")
    Path("edge_reflex.yaml").write_text(wrong, encoding="utf-8")
    shown = re.sub(r"\n +", " ", MESSAGES)  # long ones are wrapped on the page
    assert "".join(f"{error}\n" for error in check("edge_reflex.yaml")[0]) == shown


def test_every_key_is_explained():
    schema = circuit_schema()
    keys = set(schema["properties"])
    for name, entry in schema["$defs"].items():
        keys |= set(entry.get("properties", {})) if name.endswith("Spec") else set()
    written = re.compile(r"`\{?(\w+)(?:`|: )")
    assert keys - {"leak"} <= set(written.findall(PAGE))


@pytest.mark.parametrize(
    ("names", "model"), [(NEURON_MODEL_NAMES, neuron_model), (SYNAPSE_MODEL_NAMES, synapse_model)]
)
def test_every_model_is_listed_with_its_parameters(names, model):
    entries = [re.findall(r"`(\w+)`", entry) for entry in re.split(r"^- ", MODELS, flags=re.MULTILINE)]
    for name in names:
        assert [name, *model(name).parameter_names] in entries


def test_every_function_of_expressions_is_listed():
    listed = re.search(r"functions\s`(.*?)`", PAGE)[1].split()
    assert sorted(listed) == sorted(SCALAR_FUNCTIONS)
