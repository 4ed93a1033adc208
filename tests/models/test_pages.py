"""The pages of the models: they are what the declarations say, and their examples are sound and run."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from circuitkit.base.errors import InputError
from circuitkit.circuit import check, load_circuit, parse_circuit
from circuitkit.circuit.expressions.expression import FUNCTION_ARITY
from circuitkit.circuit.models import NEURON_MODEL_NAMES, SYNAPSE_MODEL_NAMES, neuron_model, synapse_model
from circuitkit.circuit.models.declaration import NeuronForm, SynapseForm
from circuitkit.engine import compile_circuit, run

DOCS = Path(__file__).parents[2] / "docs"
OWN = (DOCS / "models" / "own_models.md").read_text(encoding="utf-8")
MODELS = [*map(neuron_model, NEURON_MODEL_NAMES), *map(synapse_model, SYNAPSE_MODEL_NAMES)]


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    """docs/model_pages.py."""
    spec = importlib.util.spec_from_file_location("model_pages", DOCS / "model_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_the_page_of_a_model_is_the_present_one(pages, model):
    """`make docs` renews it."""
    page = DOCS / "models" / pages.folder_of(model) / f"{model.name}.md"
    assert page.read_text(encoding="utf-8") == pages.model_page(model)
    assert (DOCS / "models" / "img" / pages.folder_of(model) / f"{model.name}.png").is_file()


def test_the_index_is_the_present_one(pages):
    assert (DOCS / "models" / "README.md").read_text(encoding="utf-8") == pages.index_page(MODELS)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_the_example_of_a_model_is_sound_uses_it_and_runs(pages, model):
    path = pages.example_of(model)
    assert check(path) == ((), ())
    graph = load_circuit(path)
    assert model in [each.model for each in (*graph.neurons, *graph.synapses)]
    run(compile_circuit(graph), np.full((20, 1, 1), graph.inputs[0].high))


def test_the_own_model_of_the_page_rests_and_fires():
    """FitzHugh's rest at v = -1.1994, w = -0.6243 without a current, and his train of impulses with 0.5."""
    program = compile_circuit(parse_circuit(re.search(r"```yaml\n(.*?)```", OWN, re.DOTALL)[1]))
    rest = run(program, np.zeros((400, 1, 1)), states=True)
    np.testing.assert_allclose(rest.states[-1, 0], [-1.1994, -0.6243], atol=1e-4)
    firing = run(program, np.ones((400, 1, 1))).output[200:, 0, 0]
    assert np.count_nonzero((firing[:-1] < 0.5) & (firing[1:] >= 0.5)) >= 4
    assert firing.min() < 0.01
    assert firing.max() > 0.99


def test_the_message_of_the_page_is_the_one_that_comes():
    text = re.search(r"```yaml\n(.*?)```", OWN, re.DOTALL)[1].replace("- w + A) / tau", "- w + tau) / tau")
    shown = " ".join(re.search(r"```text\n(.*?)```", OWN, re.DOTALL)[1].split())
    with pytest.raises(InputError) as caught:
        parse_circuit(text, "circuit.yaml")
    assert str(caught.value) == shown


def test_every_key_and_function_is_on_the_page():
    keys = re.findall(r"^\| (`.*?) \| (both|neuron|synapse) \|", OWN, re.MULTILINE)
    listed = {name: kind for names, kind in keys for name in re.findall(r"`(\w+)`", names)}
    neuron, synapse = set(NeuronForm.model_fields) - {"model"}, set(SynapseForm.model_fields) - {"model"}
    assert {name for name, kind in listed.items() if kind != "synapse"} == neuron
    assert {name for name, kind in listed.items() if kind != "neuron"} == synapse
    paragraph = OWN.partition("and the functions")[2].partition("Names are")[0]
    assert set(re.findall(r"`(\w+)", paragraph)) == set(FUNCTION_ARITY)
