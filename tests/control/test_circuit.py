"""A circuit as a controller: bound by names and units, holding still where a reading is missing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit import load_circuit, parse_circuit, run
from circuitkit.base.errors import InputError
from circuitkit.base.units import parse_unit
from circuitkit.control import CircuitController, Interface
from circuitkit.engine import compile_circuit

OBSERVATIONS = {"zmp_y": parse_unit("m"), "force_difference": parse_unit("1"), "gyro_x": parse_unit("rad/s")}
COMMANDS = {"ankle_roll": parse_unit("deg"), "ankle_pitch": parse_unit("deg")}
CIRCUIT = """\
circuit: pair
control_step: 10 ms
timing: synchronous
inputs:
  zmp_y: {unit: mm, range: [-150 mm, 150 mm]}
  gyro_x: {unit: deg/s, range: [-100 deg/s, 100 deg/s]}
neurons:
  a: {model: sigmoid, role: excitatory, slope: 50 /m, shift: 10 mm}
  b: {model: sigmoid, role: inhibitory, slope: 1 s/rad, shift: 0 rad/s}
synapses:
  - {from: zmp_y, to: a, weight: 1}
  - {from: gyro_x, to: b, weight: 1}
outputs:
  ankle_roll: {unit: deg, readout: {a: 2 deg, b: -1 deg}, integrate: {leak: 10 %}, limits: [-9 deg, 9 deg]}
"""


def graph(text=CIRCUIT):
    return parse_circuit(text, "pair.yaml")


def bound(circuit, observations=OBSERVATIONS, commands=COMMANDS, step_s=0.01, **more):
    """The controller that runs on a robot with these channels and commands."""
    return CircuitController(circuit, **more).bind(Interface(observations, commands, step_s))


def controller(text=CIRCUIT, step_s=0.01, **more):
    return bound(graph(text), step_s=step_s, **more)


def complaints(text, step_s=0.01, **more):
    with pytest.raises(InputError) as caught:
        controller(text, step_s, **more)
    return str(caught.value).splitlines()


def stepped(text_or_controller, observations):
    """Commands and traces over observations of shape (T, B, k)."""
    made = controller(text_or_controller) if isinstance(text_or_controller, str) else text_or_controller
    made.reset(observations.shape[1])
    commands, traces = [], []
    for row in observations:
        trace = np.full((observations.shape[1], len(made.trace_names)), np.nan)
        commands.append(made.step(row).copy())
        made.store_trace(trace)
        traces.append(trace)
    return np.array(commands), np.array(traces)


def readings(ticks, batch, seed=2):
    rng = np.random.default_rng(seed)
    return np.stack([rng.normal(0, 0.05, (ticks, batch)), rng.normal(0, 1, (ticks, batch))], axis=-1)


def test_it_reads_and_writes_by_the_circuits_names():
    made = controller()
    assert made.name == "circuit"
    assert made.observations == ("zmp_y", "gyro_x")
    assert made.commands == ("ankle_roll",)
    assert made.trace_names == ("a", "b")


def test_it_does_what_its_equations_say():
    """One step by hand, in SI units: 30 mm and 0.5 rad/s."""
    commands, traces = stepped(CIRCUIT, np.array([[[0.03, 0.5]]] * 2))
    a, b = 1 / (1 + math.exp(-50 * 0.02)), 1 / (1 + math.exp(-0.5))
    np.testing.assert_allclose(traces[0, 0], [a, b])
    change = math.radians(2 * a - b)
    np.testing.assert_allclose(commands[:, 0, 0], [change, 1.9 * change])


def test_it_is_the_circuit_run_alone():
    observations = readings(50, 3)
    program = compile_circuit(load_circuit("binn_lateral"))
    order = [("force_difference", "zmp_y").index(name) for name in program.input_names]
    observations = observations[..., order]
    made = bound("binn_lateral")
    commands, traces = stepped(made, observations)
    alone = run(program, observations)
    np.testing.assert_array_equal(commands, alone.readout)
    np.testing.assert_array_equal(traces, alone.output)


def test_members_of_populations_are_recorded_one_by_one():
    graph = load_circuit("ring_attractor")
    inputs, outputs = ({node.name: node.unit for node in nodes} for nodes in (graph.inputs, graph.outputs))
    made = bound(graph, inputs, outputs, graph.step_s)
    assert made.trace_names[:3] == ("global", "ring[0]", "ring[1]")
    observations = np.full((5, 2, 2), 0.5)
    commands, traces = stepped(made, observations)
    alone = run(compile_circuit(graph), observations)
    np.testing.assert_array_equal(commands, alone.readout)
    np.testing.assert_array_equal(traces, alone.output)


def test_reset_starts_again():
    made, observations = controller(), readings(20, 1)
    first = stepped(made, observations)
    second = stepped(made, observations)
    np.testing.assert_array_equal(first[0], second[0])


def test_a_robot_is_controlled_the_same_alone_and_in_a_batch():
    observations = readings(30, 5)
    together, _ = stepped(CIRCUIT, observations)
    for i in range(5):
        alone, _ = stepped(CIRCUIT, observations[:, i : i + 1])
        np.testing.assert_array_equal(alone[:, 0].view(np.int64), together[:, i].view(np.int64))


# --- missing readings ---------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(
    missing=st.lists(st.booleans(), min_size=12, max_size=12).filter(lambda ticks: not all(ticks)),
    value=st.sampled_from([math.nan, math.inf, -math.inf]),
    column=st.integers(0, 1),
)
def test_where_a_reading_is_missing_there_is_no_command_and_the_neurons_are_held(missing, value, column):
    """It is as if those ticks had not been; the other robots of the batch do not notice."""
    observations = readings(12, 3)
    whole, whole_traces = stepped(CIRCUIT, observations)
    broken = observations.copy()
    broken[np.array(missing), 1, column] = value
    commands, traces = stepped(CIRCUIT, broken)

    np.testing.assert_array_equal(commands[:, [0, 2]].view(np.int64), whole[:, [0, 2]].view(np.int64))
    np.testing.assert_array_equal(traces[:, [0, 2]], whole_traces[:, [0, 2]])
    there = ~np.array(missing)
    skipped, skipped_traces = stepped(CIRCUIT, observations[there][:, 1:2])
    np.testing.assert_array_equal(commands[there, 1], skipped[:, 0])
    np.testing.assert_array_equal(traces[there, 1], skipped_traces[:, 0])
    assert np.isnan(commands[~there, 1]).all()


def test_all_readings_missing_from_the_start_give_no_command():
    commands, traces = stepped(CIRCUIT, np.full((3, 2, 2), np.nan))
    assert np.isnan(commands).all()
    np.testing.assert_array_equal(traces, 0.0)


# --- circuits that do not fit -------------------------------------------------------------------------------


def test_an_output_that_the_robot_does_not_have():
    text = CIRCUIT.replace("  ankle_roll:", "  ankle_rol:")
    assert complaints(text) == [
        "pair.yaml:14:3: outputs.ankle_rol: the robot has no command 'ankle_rol'; "
        "allowed: ankle_roll, ankle_pitch; did you mean 'ankle_roll'?"
    ]


def test_an_input_that_the_robot_does_not_have():
    text = CIRCUIT.replace("  zmp_y:", "  zmp:").replace("from: zmp_y", "from: zmp")
    assert complaints(text) == [
        "pair.yaml:5:3: inputs.zmp: the robot has no channel 'zmp'; "
        "allowed: zmp_y, force_difference, gyro_x; did you mean 'zmp_y'?"
    ]


def test_an_output_of_another_dimension():
    text = CIRCUIT.replace(
        "unit: deg, readout: {a: 2 deg, b: -1 deg}", "unit: mm, readout: {a: 2 mm}"
    ).replace("[-9 deg, 9 deg]", "[-9 mm, 9 mm]")
    assert complaints(text) == [
        "pair.yaml:14:3: outputs.ankle_roll: found the unit 'mm'; allowed: the robot's command 'ankle_roll' "
        "has "
        "'deg', or like it"
    ]


def test_a_control_step_that_is_not_the_walks():
    assert complaints(CIRCUIT, 0.02) == [
        "pair.yaml:1:1: control_step: found 10 ms; allowed: the control step of the run, 20 ms"
    ]


def test_all_that_does_not_fit_is_said_at_once():
    text = CIRCUIT.replace("gyro_x", "gyro").replace("  ankle_roll:", "  hip_roll:")
    said = complaints(text, 0.02)
    assert [line.split(": ")[1] for line in said] == ["inputs.gyro", "outputs.hip_roll", "control_step"]


def test_two_outputs_cannot_write_one_command():
    text = CIRCUIT + "  lean: {unit: deg, readout: {a: 1 deg}}\n"
    with pytest.raises(InputError) as caught:
        bound(graph(text), connect={"outputs": {"lean": "ankle_roll"}})
    (problem,) = caught.value.problems
    assert problem.where == "connect.outputs.lean"
    assert problem.message == (
        "found the command 'ankle_roll', which the output 'ankle_roll' writes; "
        "allowed: one output for each command"
    )
