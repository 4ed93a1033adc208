"""The page about the language shows circuits that are valid, messages that really come, and every key."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from circuitkit.circuit import check, circuit_schema
from circuitkit.circuit.models import NEURON_MODEL_NAMES, neuron_model
from circuitkit.units import UNIT_SYMBOLS

PAGE = (Path(__file__).parents[2] / "docs" / "language.md").read_text(encoding="utf-8")
(EXAMPLE,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
(MESSAGES,) = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)


def test_the_example_is_valid(tmp_path):
    (tmp_path / "my.yaml").write_text(EXAMPLE, encoding="utf-8")
    assert check(tmp_path / "my.yaml") == ((), ())


def test_the_messages_are_the_real_ones(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = EXAMPLE.replace("slope: 500", "slope: 500 /m").replace("from: zmp_y", "from: zmp")
    Path("my.yaml").write_text(wrong, encoding="utf-8")
    assert "".join(f"{error}\n" for error in check("my.yaml")[0]) == MESSAGES


def test_every_key_is_explained():
    schema = circuit_schema()
    keys = set(schema["properties"])
    for name in ("InputSpec", "NeuronSpec", "SynapseSpec", "OutputSpec", "IntegrateSpec"):
        keys |= set(schema["$defs"][name]["properties"])
    assert [
        key for key in sorted(keys) if f"`{key}`" not in PAGE and f"`{key}: " not in PAGE and key != "leak"
    ] == []


MEMORYLESS = [name for name in NEURON_MODEL_NAMES if not neuron_model(name).states]


@pytest.mark.parametrize("name", MEMORYLESS)
def test_every_model_is_explained_with_its_parameters(name):
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{name}` |")]
    assert re.findall(r"`(\w+)`", row)[1:] == list(neuron_model(name).parameter_names)


def test_every_unit_is_listed():
    listed = set(re.search(r"built from `(.*?)`", PAGE)[1].split())
    electrical = re.search(r"`(A V ohm S F)`", PAGE)[1].split()
    prefixes = ["", *re.search(r"`(p n u m k M)`", PAGE)[1].split()]
    assert listed | {prefix + symbol for symbol in electrical for prefix in prefixes} == set(UNIT_SYMBOLS)
