"""`circuitkit list`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from circuitkit.base.catalogue import catalogue

KINDS = ("circuits", "robots", "scenarios", "controllers", "gaits", "studies", "models")


def test_everything_is_listed_with_a_line_about_it(circuitkit):
    done = circuitkit("list")
    assert (done.code, done.err) == (0, "")
    for kind in KINDS:
        assert f"\n{kind} " in f"\n{done.out}"
    for name in ("binn_lateral", "vehicle", "nao_push", "mpc", "gait_march", "fig11", "izhikevich"):
        assert f"  {name} " in done.out


@pytest.mark.parametrize("kind", KINDS)
def test_one_kind_as_json(circuitkit, kind):
    rows = json.loads(circuitkit("list", kind, "--json").out)
    assert rows
    assert all(list(row) == ["kind", "name", "description", "file"] for row in rows)
    assert {row["kind"] for row in rows} == {kind}
    assert all(Path(row["file"]).is_file() for row in rows)
    assert [row["name"] for row in rows] == [each.name for each in catalogue(kind)]


def test_all_kinds_as_json(circuitkit):
    rows = json.loads(circuitkit("list", "--json").out)
    assert len(rows) == len(catalogue())
    assert set(KINDS) <= {row["kind"] for row in rows}


def test_models_say_what_they_are_models_of(circuitkit):
    """Some names are in both: a conductance may be of a membrane or of a synapse."""
    rows = json.loads(circuitkit("list", "models", "--json").out)
    both = [row["description"].partition(":")[0] for row in rows if row["name"] == "conductance"]
    assert both == ["neuron", "synapse"]


def test_an_unknown_kind(circuitkit):
    done = circuitkit("list", "modls")
    assert (done.code, done.out) == (1, "")
    assert done.err.startswith("unknown kind 'modls'; allowed: circuits, robots, scenarios, ")
    assert done.err.endswith("did you mean 'models'?\n")
