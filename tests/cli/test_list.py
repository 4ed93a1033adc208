"""`circuitkit list`."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

import circuitkit as package
from circuitkit.base.catalogue import catalogue, file_kinds
from circuitkit.base.registry import Registry
from circuitkit.base.source import data_folder
from circuitkit.paper.reproduce.figure import FIGURES

REGISTRIES = FIGURES.every
KINDS = (*file_kinds(), *(f"kinds-of-{word.replace('_', '-')}" for word in REGISTRIES))


def test_everything_is_listed_with_a_line_about_it(circuitkit):
    done = circuitkit("list")
    assert (done.code, done.err) == (0, "")
    for kind in KINDS:
        assert f"\n{kind} " in f"\n{done.out}"
    for name in ("binn_lateral", "vehicle", "nao_push", "mpc", "gait_march", "fig11", "izhikevich", "jitter"):
        assert f"  {name} " in done.out
    assert all(each.description for each in catalogue(None, REGISTRIES.values()))


@pytest.mark.parametrize("kind", KINDS)
def test_one_kind_as_json(circuitkit, kind):
    rows = json.loads(circuitkit("list", kind, "--json").out)
    assert rows
    assert all(list(row) == ["kind", "name", "description", "file"] for row in rows)
    assert {row["kind"] for row in rows} == {kind}
    assert all(Path(row["file"]).is_file() for row in rows)
    assert [row["name"] for row in rows] == [each.name for each in catalogue(kind, REGISTRIES.values())]


def test_all_kinds_as_json(circuitkit):
    rows = json.loads(circuitkit("list", "--json").out)
    assert tuple(dict.fromkeys(row["kind"] for row in rows)) == KINDS
    assert len(rows) == len(catalogue(None, REGISTRIES.values()))


def test_every_data_file_of_the_checkout_is_listed():
    """By the files themselves: every YAML file, but for those that are parts of a robot."""
    listed = {each.path for each in catalogue()}
    there = {path for top in ("circuits", "sims", "models") for path in data_folder(top).rglob("*.yaml")}
    assert listed == there | set(data_folder("robots").glob("*/robot.yaml"))


def test_every_registry_of_the_package_is_listed():
    """By the source: wherever a `Registry(...)` is made."""
    words = set()
    for path in Path(package.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == Registry.__name__:
                words.add(ast.literal_eval(node.args[0]))
    assert words == set(REGISTRIES)


def test_models_say_what_they_are_models_of(circuitkit):
    """Some names are in both: a conductance may be of a membrane or of a synapse."""
    rows = json.loads(circuitkit("list", "models", "--json").out)
    both = [row["description"].partition(":")[0] for row in rows if row["name"] == "conductance"]
    assert both == ["neuron", "synapse"]


def test_an_unknown_kind(circuitkit):
    done = circuitkit("list", "modls")
    assert (done.code, done.out) == (1, "")
    assert done.err == f"unknown kind 'modls'; allowed: {', '.join(KINDS)}; did you mean 'models'?\n"
