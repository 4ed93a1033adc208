"""The hexapod walks by Walknet's rules, and goes on after it has lost a leg."""

from __future__ import annotations

import numpy as np
import pytest
from seeds import measured, run_seeds

from circuitkit import load_circuit

SEEDS = range(4)


@pytest.fixture(scope="module")
def walks():
    return run_seeds("hexapod_walks", SEEDS)


def test_it_walks_straight(walks):
    assert measured(walks, "survived").all()
    assert (measured(walks, "speed") > 0.15).all()
    assert (measured(walks, "drift") < 0.2).all()
    assert (measured(walks, "steps") > 10).all()


def test_legs_that_are_neighbours_take_turns(walks):
    assert (measured(walks, "neighbours_swing") < 0.05).all()


def test_rule_1_is_what_keeps_neighbours_apart(walks):
    rules = ("rule_1", "rule_1_beside", "rule_2", "rule_2_beside", "rule_3", "rule_3_beside")
    without = run_seeds("hexapod_walks", SEEDS, settings=dict.fromkeys(rules, "0 deg"))
    together = np.max(measured(without, "neighbours_swing"))
    assert together > 0.1
    assert together > 3 * np.max(measured(walks, "neighbours_swing"))


def test_it_walks_on_without_a_leg():
    recording = run_seeds("hexapod_loses_a_leg", SEEDS)
    assert measured(recording, "survived").all()
    assert (measured(recording, "speed") > 0.12).all()


def test_rules_run_forwards_and_across_as_in_the_stick_insect():
    """Duerr 2005, Fig. 2: rules 1 and 2 act on the leg before, 3 on the leg behind, all on that beside."""
    pairs = {"withhold": set(), "landed": set(), "late": set()}
    for synapse in load_circuit("hexapod_walknet").synapses:
        (leg, _, neuron), (other, _, target) = synapse.source.partition("."), synapse.target.partition(".")
        if neuron in pairs and target == "swing" and leg != other:
            pairs[neuron].add((leg, other))
    across = {(a + n, b + n) for n in "123" for a, b in ("LR", "RL")}
    forward = {(side + str(n + 1), side + str(n)) for side in "LR" for n in (1, 2)}
    assert pairs["withhold"] == pairs["landed"] == forward | across
    assert pairs["late"] == {(b, a) for a, b in forward} | across
