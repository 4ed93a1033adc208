"""The measure `thresholds`: lines at which a circuit's neurons stand, and walks made up by hand."""

from __future__ import annotations

import numpy as np
import pytest
from biped.made_up import EDGES, edges, judged, recording, thresholds
from walking import a_push, plan_of, walk_all

from circuitkit import load_circuit, parse_circuit
from circuitkit.base.errors import InputError
from circuitkit.biped.thresholds import threshold_lines
from circuitkit.simulation import RunSpec
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.loop import run_and_watch

ON_LEFT, ON_RIGHT, ON_BOTH = 0.97, 0.03, 0.5


class Verdict:
    """The measures of one robot, as attributes."""

    def __init__(self, measures):
        self.__dict__.update(measures)


def verdict(**what):
    return Verdict(recording(**what).measures[0])


# --- lines --------------------------------------------------------------------------------------------------


def test_lines_are_where_neurons_are_half_active():
    """Shift over weight: 160 mm with a weight of 2 is 80 mm, 80 mm with a weight of -1 is -80 mm."""
    np.testing.assert_allclose(
        threshold_lines(edges(), thresholds()), [[0.02, 0.08], [-0.08, -0.02], [-0.08, 0.08]]
    )


def test_lines_of_the_papers_network_are_the_edges_of_the_feet():
    """As section 4.2 has it; by force cells these are the outermost and innermost cells."""
    lines = threshold_lines(load_circuit("binn_lateral"), thresholds())
    np.testing.assert_allclose(lines, [[0.0269, 0.0799], [-0.0799, -0.0269], [-0.0799, 0.0799]])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"left_foot": {"right": "q33", "left": "q4"}},
            "measures.thresholds.left_foot: found 'q33': no neuron of 'edges' with a shift that reads "
            "'zmp_y'; allowed: q1, q3, q2, q4; did you mean 'q3'?",
        ),
        (
            {"both_feet": {"right": "q1", "left": "out"}},
            "measures.thresholds.both_feet: found 'out': no neuron of 'edges' with a shift that reads "
            "'zmp_y'; allowed: q1, q3, q2, q4",
        ),
        (
            {"channel": "zmp_x"},
            "measures.thresholds.left_foot: found 'q3': no neuron of 'edges' with a shift that reads "
            "'zmp_x'; allowed: nothing",
        ),
    ],
)
def test_a_neuron_that_is_no_edge(changes, said):
    data = thresholds().model_dump() | changes
    with pytest.raises(InputError) as caught:
        threshold_lines(edges(), type(thresholds()).model_validate(data))
    assert str(caught.value) == said


# --- verdicts -----------------------------------------------------------------------------------------------


def test_a_robot_that_stays_inside():
    found = verdict(zmp_mm=79.0)
    assert found.survived
    assert found.time_of_fall_s is None
    assert found.max_zmp_excursion_m == 0
    assert found.recovery_time_s is None


def test_a_crossing_of_eight_ticks():
    """87 mm on both feet is 7 mm outside; back inside for good after 80 ms, like the paper's 84 ms."""
    found = verdict(zmp_mm={60: 85.0, 63: 87.0, 68: 50.0})
    assert found.max_zmp_excursion_m == pytest.approx(0.007)
    assert found.recovery_time_s == pytest.approx(0.08)


def test_the_right_edge_counts_as_the_left_one():
    found = verdict(zmp_mm={60: -87.0, 68: 0.0})
    assert found.max_zmp_excursion_m == pytest.approx(0.007)
    assert found.recovery_time_s == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("left_load", "zmp_mm", "outside_mm"),
    [(ON_LEFT, 10.0, 10.0), (ON_LEFT, 50.0, 0.0), (ON_LEFT, 95.0, 15.0), (ON_RIGHT, -15.0, 5.0),
     (ON_RIGHT, -50.0, 0.0), (ON_BOTH, 10.0, 0.0), (0.94, 10.0, 0.0), (0.06, -10.0, 0.0)],
)  # fmt: skip
def test_edges_are_those_of_the_feet_that_carry(left_load, zmp_mm, outside_mm):
    """A foot carries alone with more than 95 % of the weight."""
    found = verdict(zmp_mm=zmp_mm, left_load=left_load)
    assert found.max_zmp_excursion_m == pytest.approx(outside_mm * 1e-3, abs=1e-9)


def test_a_short_return_is_no_recovery():
    """Outside from 60 to 64 and again from 70 to 76: back for a whole step of 55 ticks only at 76."""
    found = verdict(zmp_mm={60: 90.0, 64: 0.0, 70: 85.0, 76: 0.0})
    assert found.recovery_time_s == pytest.approx(0.16)


def test_a_second_excursion_after_a_quiet_step_is_another_one():
    found = verdict(zmp_mm={60: 85.0, 64: 0.0, 130: 90.0, 140: 0.0})
    assert found.recovery_time_s == pytest.approx(0.04)
    assert found.max_zmp_excursion_m == pytest.approx(0.010)


@pytest.mark.parametrize("zmp_mm", [{60: 90.0}, {60: 90.0, 290: 0.0}])
def test_who_never_comes_back_for_a_step_has_not_recovered(zmp_mm):
    found = verdict(zmp_mm=zmp_mm)
    assert found.survived
    assert found.recovery_time_s is None


def test_only_what_comes_after_the_push_began_counts():
    found = verdict(zmp_mm={20: 95.0, 40: 0.0, 120: 82.0, 125: 0.0}, push_s=(1.0, 1.2))
    assert found.max_zmp_excursion_m == pytest.approx(0.002)
    assert found.recovery_time_s == pytest.approx(0.05)


def test_a_fall_ends_the_count():
    """Row t is the end of tick t: a lean of 60 degrees from row 149 on is a fall at 1.5 s."""
    found = verdict(zmp_mm={140: 85.0, 160: 120.0}, lean_deg={149: 60.0})
    assert not found.survived
    assert found.time_of_fall_s == pytest.approx(1.5)
    assert found.max_zmp_excursion_m == pytest.approx(0.005)
    assert found.recovery_time_s is None


def test_a_lean_of_40_degrees_is_no_fall():
    assert verdict(lean_deg={100: 40.0}).survived


def test_a_fall_before_the_push_leaves_nothing_to_count():
    found = verdict(zmp_mm={0: 95.0}, lean_deg={30: 60.0}, push_s=(2.0, 2.2))
    assert not found.survived
    assert found.max_zmp_excursion_m == 0
    assert found.recovery_time_s is None


def test_each_robot_of_a_batch_is_judged_by_itself():
    one, two = recording(zmp_mm=90.0), recording(lean_deg={200: 80.0})
    both = judged(np.concatenate([one.readings, two.readings], axis=1), one.specs * 2)
    assert both.measures == (*one.measures, *two.measures)


def test_weights_that_turn_an_edge_over_keep_it_where_it_is():
    """q2 may as well see the mirrored ZMP with the mirrored shift; the line is the same."""
    text = EDGES.replace(
        "q2: {model: sigmoid, role: excitatory, slope: 100 /m, shift: -20 mm}",
        "q2: {model: sigmoid, role: excitatory, slope: -100 /m, shift: 20 mm}",
    )
    text = text.replace("{from: zmp_y, to: q2, weight: 1}", "{from: zmp_y, to: q2, weight: -1}")
    lines = threshold_lines(parse_circuit(text), thresholds())
    assert lines[1, 1] == pytest.approx(-0.02)


# --- measures without a recording ---------------------------------------------------------------------------


def test_running_for_the_measures_alone_gives_those_of_the_recording():
    """A robot left alone, one that is pushed hard, one that falls, one whose push never comes."""
    jitter = Jitter(start=0.02, velocity=0.01)
    plan = plan_of("binn_lateral_tuned", duration=3.4)
    forces = (14.0, 60.0)
    specs = [
        RunSpec(3, (jitter,)),
        *(RunSpec(4 + i, (jitter, a_push(force=force))) for i, force in enumerate(forces)),
    ]
    setup = plan.setup(plan.controller("circuit"), specs)
    recorded = walk_all(plan, "circuit", specs)
    watched = run_and_watch(setup)
    assert watched.measures() == recorded.measures
    assert [each["survived"] for each in recorded.measures] == [True, True, False]
    assert recorded.measures[1]["max_zmp_excursion_m"] > 0
    for robot, effort in enumerate(watched.effort()):
        fall = recorded.measures[robot]["time_of_fall_s"]
        commands = recorded.commands[: None if fall is None else round(fall / 0.01) - 1, robot, 0]
        assert effort == {"ankle_roll": pytest.approx(np.sqrt(np.mean(commands**2)), rel=1e-12)}


def test_measures_are_the_same_to_the_bit_for_any_batch():
    plan = plan_of("binn_lateral_tuned", duration=2.4)
    controller = plan.controller("circuit")
    specs = [RunSpec(seed, (a_push(force=force),)) for seed, force in enumerate((10.0, 50.0, 25.0))]
    together = run_and_watch(plan.setup(controller, specs), threads=2)
    alone = [run_and_watch(plan.setup(controller, [spec])) for spec in specs]
    assert together.measures() == tuple(each.measures()[0] for each in alone)
    assert together.effort() == tuple(each.effort()[0] for each in alone)


def test_an_open_loop_spends_nothing():
    plan = plan_of(duration=0.5)
    watched = run_and_watch(plan.setup(plan.controller("open_loop"), [RunSpec(0)]))
    assert watched.effort() == ({},)
    assert watched.measures()[0]["survived"]
