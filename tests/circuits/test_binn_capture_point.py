"""The networks that read the capture point's error: in x, in both directions, and in three."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.base.units import parse_unit
from circuitkit.circuit import check, load_circuit
from circuitkit.control import CircuitController, Interface, PlannedChannel
from circuitkit.engine import compile_circuit, run
from circuitkit.robots import build_model, load_robot
from circuitkit.study import load_study, open_workers, run_cases

FALL_TIME_S = 0.166
SHIPPED = ("binn_sagittal_capture", "binn_sagittal_tuned", "binn_planar_tuned", "binn_omnidirectional_tuned")
_ERRORS = st.lists(st.tuples(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08)), min_size=1, max_size=12)


def _compiled(name):
    """With the backend that rounds alike whatever stands beside a neuron."""
    return compile_circuit(load_circuit(name), backend="numpy", reproducible=True)


@pytest.fixture(scope="module")
def programs():
    return {name: _compiled(name) for name in (*SHIPPED, "binn_lateral_capture_tuned", "binn_sagittal")}


def _driven(program, **series):
    """Readout by output name, in degrees, of one robot; inputs that are not named are 0."""
    steps = len(next(iter(series.values())))
    inputs = np.zeros((steps, 1, len(program.input_names)))
    for name, values in series.items():
        if name in program.input_index:
            inputs[:, 0, program.input_index[name]] = values
    readout = np.degrees(run(program, inputs).readout[:, 0])
    return {name: readout[:, column] for name, column in program.output_index.items()}


@pytest.mark.parametrize("name", SHIPPED)
def test_there_are_no_errors_and_no_warnings(name):
    assert check(name) == ((), ())


@pytest.mark.parametrize("name", SHIPPED)
def test_the_nao_has_all_channels(name):
    model = build_model(load_robot("nao").with_servos(None))
    planned = {}
    for axis in "xy":
        planned[f"planned_com_{axis}"] = PlannedChannel(parse_unit("m"), np.zeros(1))
        planned[f"planned_com_velocity_{axis}"] = PlannedChannel(parse_unit("m/s"), np.zeros(1))
    known = Interface(model.channel_units, model.command_units, 0.01, planned)
    controller = CircuitController(load_circuit(name)).bind(known)
    assert set(controller.commands) <= {"ankle_roll", "ankle_pitch"}


def test_only_the_error_counts_and_velocity_counts_for_the_time_of_the_fall(programs):
    """CoM and plan may be anywhere; 1 cm ahead is as much as 1 cm / 0.166 s too quick."""
    program, still = programs["binn_sagittal_capture"], np.zeros(10)
    ahead = _driven(program, com_x=still + 0.01)["ankle_pitch"]
    elsewhere = _driven(program, com_x=still + 0.05, planned_com_x=still + 0.04)["ankle_pitch"]
    quick = _driven(program, com_velocity_x=still + 0.01 / FALL_TIME_S)["ankle_pitch"]
    behind_a_quick_plan = _driven(
        program, com_x=still + 0.03, planned_com_velocity_x=still + 0.02 / FALL_TIME_S
    )["ankle_pitch"]
    for other in (elsewhere, quick, behind_a_quick_plan):
        np.testing.assert_allclose(other, ahead, rtol=1e-9)


def test_at_the_edge_p_is_one_half_and_the_toes_are_pressed(programs):
    """Eqs. 12 and 14: ahead of the plan by the edge, p2 is S(10 (1/2 - 1/2)); pitch turns toes down."""
    graph = load_circuit("binn_sagittal_capture")
    edge, w = graph.parameters["edge"].value_si, graph.parameters["w"].value_si
    (pitch,) = _driven(programs["binn_sagittal_capture"], com_x=np.array([edge]))["ankle_pitch"]
    # p1 is silenced by h1 but for S(10 (q1 - h2 - 1/2)), which is less than 1e-6.
    assert pitch == pytest.approx(math.degrees(w) / 2, rel=1e-5)


@settings(max_examples=50, deadline=None)
@given(errors=_ERRORS)
def test_to_the_front_and_to_the_back_it_does_the_same_mirrored(programs, errors):
    x = np.array(errors)[:, 0]
    program = programs["binn_sagittal_tuned"]
    there, back = (_driven(program, com_x=sign * x)["ankle_pitch"] for sign in (1.0, -1.0))
    np.testing.assert_allclose(there, -back, rtol=0, atol=1e-9)


def test_neurons_and_synapses_are_those_of_binn_sagittal():
    """Named as in the instance, with the same roles and the same weights between them."""
    plain, fed = (load_circuit(name) for name in ("binn_sagittal", "binn_sagittal_tuned"))
    roles = {f"sagittal.{node.name}": node.role for node in plain.neurons}
    assert {node.name: node.role for node in fed.neurons} == roles

    def inner(graph, prefix=""):
        names = {node.name for node in graph.neurons}
        return {
            (f"{prefix}{s.source}", f"{prefix}{s.target}"): s.weight
            for s in graph.synapses
            if s.source in names
        }

    assert inner(fed) == inner(plain, "sagittal.")


@settings(max_examples=50, deadline=None)
@given(errors=_ERRORS, force=st.sampled_from([-1.0, 0.0, 1.0]))
def test_each_half_of_the_planar_circuit_does_what_it_does_alone(programs, errors, force):
    x, y = np.array(errors).T
    series = {"com_x": x, "com_y": y, "force_difference": np.full(len(x), force), "zmp_y": y / 2}
    both = _driven(programs["binn_planar_tuned"], **series)
    lateral, sagittal = (_driven(programs[name], **series) for name in PARTS)
    np.testing.assert_array_equal(both["ankle_roll"], lateral["ankle_roll"])
    np.testing.assert_array_equal(both["ankle_pitch"], sagittal["ankle_pitch"])


PARTS = ("binn_lateral_capture_tuned", "binn_sagittal_tuned")


def _moved(program, errors):
    """How the body is turned to the front and to the left, for errors forward and left; (T, 2) to (T, 2)."""
    found = _driven(program, com_x=errors[:, 0], com_y=errors[:, 1])
    return np.stack([-found["ankle_pitch"], found["ankle_roll"]], axis=-1)


def _turned(points, degrees):
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return points @ np.array([[cosine, sine], [-sine, cosine]])


@pytest.mark.parametrize("degrees", [60, 120, 180, 240, 300])
@settings(max_examples=25, deadline=None)
@given(errors=_ERRORS)
def test_a_turned_error_gives_the_turned_response(programs, degrees, errors):
    program, errors = programs["binn_omnidirectional_tuned"], np.array(errors)
    # Where three lines cross a threshold at once, exp() rounds what the turn rounds: 1e-9 of a degree.
    expected = _turned(_moved(program, errors), degrees)
    np.testing.assert_allclose(_moved(program, _turned(errors, degrees)), expected, atol=1e-8)


@pytest.mark.parametrize("degrees", range(0, 360, 15))
def test_the_body_is_moved_against_the_error(programs, degrees):
    """Along an axis and between two axes exactly, elsewhere nearly: three networks make no perfect circle."""
    way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    moved = _moved(programs["binn_omnidirectional_tuned"], 0.02 * np.tile(way, (20, 1)))[-1]
    across = moved[0] * way[1] - moved[1] * way[0]
    off = abs(math.degrees(math.atan2(across, -moved @ way)))
    assert off < (1e-9 if degrees % 30 == 0 else 20.0)


def test_pushed_forward_and_backward_the_circuits_hold_what_fells_the_open_loop():
    """Marching, 13.5 N for 0.2 s: more than stiff ankles hold, less than the bounds, 14.4 and 15.3 N."""
    study = load_study("sagittal").with_({"watch": "2.5 s"})
    pushed = {"reference": {"gait": "gait_march"}, "push.duration": "0.2 s", "push.force": "13.5 N"}
    circuits = ("binn_sagittal_tuned", "binn_planar_tuned", "binn_omnidirectional_tuned")
    contenders = [
        {"controller": "open_loop"},
        *({"controller": "circuit", "circuit": circuit} for circuit in circuits),
    ]
    points = [
        {**pushed, **contender, "push.direction": direction}
        for contender in contenders
        for direction in ("forward", "backward")
    ]
    with open_workers(1) as workers:
        runs = run_cases(study, points, [0], workers)
    survived = np.array([[run.survived for run in each] for each in runs]).reshape(4, 2)
    assert not survived[0].any()
    assert survived[1:].all()
