"""Commands that do not come: held, then replaced as the scenario says; and readings that no output needs."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_robots import CART, CART_FILE, Told, run, small_robot

from circuitkit.base.errors import InputError
from circuitkit.circuit.load import parse_circuit
from circuitkit.control import CircuitController, Interface
from circuitkit.simulation import Scenario, simulate
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.fallback import Fallback, MissingCommands
from circuitkit.simulation.reference import Motion, Reference

FILE = {**CART_FILE, "commands": {**CART_FILE["commands"], "more": {"unit": "N", "to": {"motor": 0.5}}}}


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("cart"), CART, **FILE)


GAP = np.array([3.0, np.nan, np.nan, np.nan, np.nan, 5.0, np.inf, 6.0])  # 10 ms each


@pytest.mark.parametrize(
    ("fields", "force", "more"),
    [
        ({}, [3, 3, 3, 3, 3, 5, 5, 6], 2),
        ({"fallback": "zero", "fallback_after": 0.02}, [3, 3, 3, 0, 0, 5, 5, 6], 2),
        ({"fallback": "zero", "fallback_after": 0.0}, [3, 0, 0, 0, 0, 5, 0, 6], 2),
        ({"fallback": "open_loop", "fallback_after": 0.02}, [3, 3, 3, 0, 0, 5, 5, 6],
            [2, 2, 2, 0, 0, 2, 2, 2]),
        ({"fallback": "zero"}, [3, 3, 3, 3, 3, 5, 5, 6], 2),
    ],
)  # fmt: skip
def test_a_command_is_held_and_then_replaced(cart, fields, force, more):
    recording = run(cart, Told(force=GAP, more=2.0), duration_s=0.08, **fields)
    np.testing.assert_array_equal(recording.command("force")[:, 0], force)
    np.testing.assert_array_equal(recording.command("more")[:, 0], np.broadcast_to(more, 8))
    columns = recording.columns()
    held = columns.get("held_force", np.zeros(8)) + columns.get("fallback_force", np.zeros(8))
    np.testing.assert_array_equal(held, ~np.isfinite(GAP))


def test_when_it_began_and_how_long_is_told(cart):
    fields = {"fallback": "open_loop", "fallback_after": 0.02}
    told = run(cart, Told(force=GAP, more=2.0), duration_s=0.08, **fields).interventions()
    assert told["held"] == {"force": (0.01, pytest.approx(0.03))}
    assert told["fallback"] == {"force": (0.03, 0.02), "more": (0.03, 0.02)}


def test_the_verdict_says_it(cart):
    scenario = Scenario(robot=cart, control_step=0.01, duration=0.08, fallback="zero", fallback_after=0.02)
    result = simulate(scenario, controller=Told(force=GAP * 10))
    assert result.remarks == (
        "force was at its limit in 75 % of the run",
        "force was not commanded for 0.03 s, first at 0.01 s: the last command was held",
        "force was not commanded for 0.02 s, first at 0.03 s: fallback zero",
    )


def test_one_robot_of_a_batch_is_without_commands_and_the_others_do_not_notice(cart):
    class Blind(Told):
        """The robot `lost` of the batch gives nothing from the fifth tick on."""

        lost: int | None = None

        def step(self, observation):
            found = 3 * observation[:, :1] - 1
            self._tick += 1
            if self.lost is not None and self._tick > 5:
                found[self.lost] = np.nan
            return found

    def blind(lost):
        made = Blind(("place",), force=0.0)
        made.lost = lost
        return made

    fields = {"duration_s": 0.3, "fallback": "zero", "fallback_after": 0.05}
    both = run(cart, blind(1), seeds=(0, 1, 2), **fields)
    for i in (0, 2):
        alone = run(cart, blind(None), seeds=(i,), **fields)
        np.testing.assert_array_equal(both.qpos[:, i], alone.qpos[:, 0])
        assert both.interventions(i)["held"] == {}
    alone = run(cart, blind(0), seeds=(1,), **fields)
    np.testing.assert_array_equal(both.qpos[:, 1], alone.qpos[:, 0])
    assert both.interventions(1)["fallback"]["force"] == (0.1, pytest.approx(0.2))


@pytest.mark.parametrize("kind", ["hold", "zero", "open_loop"])
def test_nothing_is_noted_of_a_robot_for_which_time_stands_still(kind):
    missing = MissingCommands(Fallback(kind, 0.0), ["a", "b"], 2, 0.01)
    commands = np.full((2, 2), np.nan)
    missing(0, commands, np.array([True, False]))
    assert not commands.any()
    log, other = (missing.held, missing.replaced) if kind == "hold" else (missing.replaced, missing.held)
    assert log.shares(np.array([1, 1])).tolist() == [0, 1]
    assert other.shares(np.array([1, 1])).tolist() == [0, 0]


def test_a_fallback_that_there_is_not(cart):
    with pytest.raises(Exception, match="fallback"):
        Scenario(robot=cart, control_step=0.01, duration=0.1, fallback="brake")


# --- what a circuit needs -----------------------------------------------------------------------------------

TWO = """
circuit: two
timing: synchronous
control_step: 10 ms
inputs:
  place: {unit: m, range: [-1 m, 1 m]}
  speed: {unit: m/s, range: [-1 m/s, 1 m/s]}
  angle: {unit: rad, range: [-1 rad, 1 rad]}
neurons:
  a: {model: leaky_integrator, role: excitatory, tau: 50 ms}
  b: {model: leaky_integrator, role: excitatory, tau: 50 ms}
  c: {model: leaky_integrator, role: excitatory, tau: 50 ms}
synapses:
  - {from: place, to: a, weight: 1 /m}
  - {from: speed, to: b, weight: 1 s/m}
  - {from: a, to: b, weight: 0.5, delay: 30 ms}
  - {from: angle, to: c, weight: 1 /rad}
  - {from: c, to: a, weight: 0}
outputs:
  force: {unit: N, readout: {a: 1 N}}
  more: {unit: N, readout: {b: 1 N}, integrate: {leak: 10 %}, limits: [-9 N, 9 N]}
"""
NEEDS = {"force": [0], "more": [0, 1]}


def stepped(observations):
    graph = parse_circuit(TWO, "two.yaml")
    units = {node.name: node.unit for node in graph.inputs}
    commands = {node.name: node.unit for node in graph.outputs}
    made = CircuitController(graph).bind(Interface(units, commands, 0.01))
    made.reset(observations.shape[1])
    return np.array([made.step(each).copy() for each in observations])


@settings(max_examples=40, deadline=None)
@given(
    missing=st.lists(st.lists(st.booleans(), min_size=6, max_size=6), min_size=9, max_size=9),
    seed=st.integers(0, 99),
)
def test_outputs_that_do_not_need_what_is_missing_are_as_if_it_were_there(missing, seed):
    observations = np.random.default_rng(seed).uniform(-1, 1, (9, 2, 3))
    whole = stepped(observations)
    gone = np.array(missing).reshape(9, 2, 3)
    found = stepped(np.where(gone, np.nan, observations))
    for i, needed in enumerate(NEEDS.values()):
        lacks = gone[..., needed].any(axis=-1)
        np.testing.assert_array_equal(np.isnan(found[..., i]), lacks)
        for robot in range(2):
            if not lacks[:, robot].any():
                np.testing.assert_array_equal(found[:, robot, i], whole[:, robot, i])


def test_a_dead_sensor_that_no_output_needs_changes_no_bit_of_a_run(cart):
    graph = parse_circuit(TWO, "two.yaml")
    whole = run(cart, CircuitController(graph))
    dead = run(cart, CircuitController(graph), [Fault(channel="angle", reading="missing", start=0.1)])
    np.testing.assert_array_equal(whole.qpos, dead.qpos)
    np.testing.assert_array_equal(whole.commands, dead.commands)
    assert dead.interventions()["missing"] == {"angle": (0.1, pytest.approx(0.4))}
    assert dead.interventions()["held"] == {}


# --- references and controllers of others -------------------------------------------------------------------


class Odd(Reference):
    """A reference of somebody who has not read what a motion is."""

    name = "odd"

    def __init__(self, targets):
        self.targets = targets

    def motion(self, robot, ticks, step_s):  # noqa: ARG002 - of the base
        return Motion(self.targets, robot.start_qpos)


@pytest.mark.parametrize(
    ("targets", "found"),
    [
        (np.zeros((1, 3)), "an array of shape (1, 3)"),
        (np.zeros((7, 1)), "an array of shape (7, 1)"),
        (np.zeros(1), "an array of shape (1,)"),
        ([[0.0]], "a list of 1"),
        (np.full((10, 1), np.nan), "nan in row 0"),
    ],
)
def test_targets_that_do_not_fit_name_the_reference(cart, targets, found):
    with pytest.raises(InputError) as caught:
        run(cart, reference=Odd(targets), duration_s=0.1)
    assert str(caught.value) == (
        f"reference: the reference 'odd' (Odd) gave {found} as targets; allowed: an array of finite numbers "
        "of shape (1, 1) or (10, 1), a column for each control"
    )


def test_a_reference_beyond_a_range_is_told_at_planning(cart, caplog):
    recording = run(cart, reference=Odd(np.array([[25.0]] * 5 + [[1.0]] * 5)), duration_s=0.1)
    assert caplog.messages == [
        "the reference 'odd' asks 'motor' for 1 to 25, and its range is -20 to 20 (in 50 % of the run); it "
        "is cut to the range"
    ]
    assert recording.interventions()["clamped"] == {"motor": (0.0, 0.05)}


class Careless:
    """A controller that does with its readings and its commands what it likes."""

    name = "careless"
    observations = ("angle",)
    commands = ("force",)

    def __init__(self, act):
        self.step = act

    def reset(self, batch):
        """Nothing to forget."""


def test_a_controller_may_change_what_it_reads_and_the_recording_stays(cart):
    def spoil(observation):
        observation[...] = 7.0
        return np.ones((len(observation), 1))

    whole = run(cart, Careless(lambda observation: np.ones((len(observation), 1))))
    spoilt = run(cart, Careless(spoil))
    np.testing.assert_array_equal(whole.observations, spoilt.observations)
    np.testing.assert_array_equal(whole.qpos, spoilt.qpos)


def test_what_a_controller_does_not_tell_of_itself_is_no_number(cart):
    careless = Careless(lambda observation: np.ones((len(observation), 1)))
    careless.trace_names = ("told", "left out")

    def store_trace(row):
        row[:, 0] = 7.0

    careless.store_trace = store_trace
    trace = run(cart, careless).trace
    assert (trace[..., 0] == 7.0).all()
    assert np.isnan(trace[..., 1]).all()


def test_a_command_beyond_all_floats_is_no_command(cart):
    huge = Careless(lambda observation: np.full((len(observation), 1), np.longdouble("1e4000")))
    assert run(cart, huge).interventions()["held"].keys() == {"force"}


@pytest.mark.parametrize(
    ("commands", "found"),
    [
        (np.ma.masked_array(np.ones((1, 1)), mask=True), "a masked array of shape (1, 1)"),
        (np.ones((1, 1), dtype=bool), "an array of shape (1, 1) of bool"),
        (np.ones((1, 1), dtype=complex), "an array of shape (1, 1) of complex128"),
    ],
)
def test_commands_that_are_no_plain_numbers_are_refused_and_named(cart, commands, found):
    with pytest.raises(InputError, match=re.escape(f"controller.'careless'.step: found {found}; allowed: ")):
        run(cart, Careless(lambda _: commands))


def test_an_object_that_is_a_controller_runs_a_shipped_scenario():
    class Mine:
        name = "mine"
        observations = ("zmp_y",)
        commands = ("ankle_roll",)

        def reset(self, batch):
            self.batch = batch

        def step(self, observation):
            return 0.1 * observation

    from circuitkit import load_scenario

    short = load_scenario("nao_push").model_copy(update={"duration": 0.5}).with_disturbances(())
    result = simulate(short, controller=Mine())
    assert (result.recording.controller, result.outcome) == ("mine", "stood")
