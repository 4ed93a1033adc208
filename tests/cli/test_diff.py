"""`circuitkit diff`."""

from __future__ import annotations

import json


def test_what_changed_is_listed_by_kind(circuitkit):
    outcome = circuitkit("diff", "binn_lateral", "binn_lateral", "--set", "w=2deg")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out == (
        "parameters\n"
        "  ~ w: 1.63 deg → 2 deg\n"
        "readouts\n"
        "  ~ p1 -> ankle_roll weight: 1.63 deg → 2 deg\n"
        "  ~ p2 -> ankle_roll weight: -1.63 deg → -2 deg\n"
        "3 changed\n"
    )


def test_equal_circuits(circuitkit):
    outcome = circuitkit("diff", "binn_lateral", "binn_lateral", "--exit-code")
    assert (outcome.code, outcome.out) == (0, "binn_lateral and binn_lateral mean the same\n")


def test_the_exit_code_tells_if_asked(circuitkit):
    assert circuitkit("diff", "binn_lateral", "binn_lateral_tuned").code == 0
    assert circuitkit("diff", "binn_lateral", "binn_lateral_tuned", "--exit-code").code == 1


def test_json(circuitkit):
    words = ("diff", "binn_lateral", "binn_lateral", "--set", "leak=4%", "--json")
    found = json.loads(circuitkit(*words).out)
    assert found["equal"] is False
    assert found["changes"][0] == {
        "kind": "parameter",
        "name": "leak",
        "what": "changed",
        "field": "value",
        "old": "5 %",
        "new": "4 %",
    }


def test_both_circuits_must_be_there(circuitkit):
    outcome = circuitkit("diff", "binn_lateral", "binn_latral")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err.startswith(
        "binn_latral:1:1: unknown name 'binn_latral'; allowed: a path, or one of the"
    )


def test_a_value_that_cannot_be_set(circuitkit):
    outcome = circuitkit("diff", "binn_lateral", "binn_lateral", "--set", "w")
    assert outcome.code == 2
    assert "Error: Invalid value for --set: found 'w'; allowed: NAME=VALUE, such as w=2deg" in outcome.err
