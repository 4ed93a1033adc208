"""The quadruped: stands, walks and trots by its drive, and steps aside when it is pushed."""

from __future__ import annotations

import numpy as np
import pytest
from seeds import changed

from circuitkit import compile_circuit, load_circuit, run
from circuitkit.simulation.disturbance import RunSpec
from circuitkit.simulation.loop import run_loop
from circuitkit.simulation.plan import make_plan
from circuitkit.simulation.scenario import parse_push, with_push

LEGS = ("LF", "RF", "LH", "RH")
SETTLED = 300  # ticks
STANDS_N = 2.0


def runs(name, seeds, push=None, settings=None, **changes):
    """The recording of a shipped scenario with several seeds at once."""
    scenario = changed(name, **changes)
    plan = make_plan(scenario, None, settings, "auto")
    specs = [plan.own_spec(seed) for seed in seeds]
    if push is not None:
        specs = [RunSpec(spec.seed, with_push(scenario, parse_push(push, scenario))) for spec in specs]
    return run_loop(plan.setup(plan.controller(None), specs))


def measured(recording, name):
    return np.array([float(each[name]) for each in recording.measures])


def onsets(active, least=4):
    """Steps at which something becomes active, to stay so after it was silent for a while."""
    found = np.flatnonzero(active[1:] & ~active[:-1]) + 1
    return np.array([i for i in found if active[i : i + least].all() and not active[i - least : i].any()])


def lags(swings):
    """By which part of a cycle each leg begins to swing after LH, as a circular mean."""
    first = onsets(swings["LH"])
    assert len(first) > 2
    found = {}
    for leg, active in swings.items():
        then = onsets(active)
        cycle = np.searchsorted(first, then, "right") - 1
        inside = (cycle >= 0) & (cycle < len(first) - 1)
        part = (then[inside] - first[cycle[inside]]) / np.diff(first)[cycle[inside]]
        mean = np.exp(2j * np.pi * part).mean()
        assert abs(mean) > 0.97  # every cycle alike
        found[leg] = np.angle(mean) / (2 * np.pi) % 1
    return found


def footfall_lags(recording, robot, start=SETTLED, end=None):
    return lags({leg: recording.channel(f"load_{leg}")[start:end, robot] < STANDS_N for leg in LEGS})


def apart(lag, expected):
    return abs((lag - expected + 0.5) % 1 - 0.5)


def neurons(drive, steps=1500):
    """Outputs of flexors and extensors of the circuit alone, by leg; after it has settled."""
    program = compile_circuit(load_circuit("quadruped_gaits", {"drive": str(drive)}))
    output = run(program, np.zeros((steps, 1, len(program.input_names)))).output[SETTLED:, 0]
    names = list(program.neuron_names)
    return {
        leg: tuple(output[:, names.index(f"{leg}.{kind}")] for kind in ("flexor", "extensor")) for leg in LEGS
    }


def test_up_to_the_drive_that_theory_gives_all_legs_stand():
    # A tired extensor's output is excitation / (1 + beta); times the inhibition it must exceed drive.
    tone, share, beta, inhibition = 0.67, 0.67, 6, 3
    limit = inhibition * tone / (1 + beta - inhibition * share)
    below, above = neurons(limit - 0.01), neurons(limit + 0.03)
    for leg in LEGS:
        flexor, extensor = below[leg]
        assert flexor.max() == 0
        np.testing.assert_allclose(extensor[-1], (tone + share * (limit - 0.01)) / (1 + beta), rtol=1e-3)
        assert above[leg][0].max() > 0.1


@pytest.mark.parametrize(
    ("drive", "lag"), [(0.6, 0.2), (0.7, 0.225), (0.8, 0.25), (0.95, 0.3), (1.05, 0.51), (2, 0.51)]
)
def test_the_circuit_alone_walks_below_a_drive_of_1_and_trots_above(drive, lag):
    found = lags({leg: flexor > extensor for leg, (flexor, extensor) in neurons(drive).items()})
    assert apart(found["RH"], 0.5) < 0.02
    assert apart(found["LF"], lag) < 0.02
    assert apart(found["RF"], lag + 0.5) < 0.02


def test_more_drive_shortens_the_stance_and_hardly_the_swing():
    def stance_and_swing(drive):
        flexor, extensor = neurons(drive)["LF"]
        swings = flexor > extensor
        cycle = np.diff(onsets(swings)).mean() * 0.01
        return cycle * (1 - swings.mean()), cycle * swings.mean()

    (slow_stance, slow_swing), (fast_stance, fast_swing) = stance_and_swing(0.5), stance_and_swing(1.6)
    assert fast_stance < 0.5 * slow_stance
    assert fast_swing == pytest.approx(slow_swing, rel=0.35)


def test_it_trots_and_survives_a_push_from_the_side_in_20_of_20_seeds():
    recording = runs("quadruped_trots", range(20))
    assert measured(recording, "survived").all()
    assert measured(recording, "speed").min() > 0.6
    assert np.rad2deg(measured(recording, "largest_roll")).max() < 6
    assert measured(recording, "diagonal").min() > 0.9
    found = footfall_lags(recording, 0, end=470)
    assert max(apart(found["LF"], 0.5), apart(found["RF"], 0), apart(found["RH"], 0.5)) < 0.06


def test_at_a_low_drive_it_walks_in_the_lateral_sequence():
    recording = runs("quadruped_trots", range(3), settings={"drive": "0.7"})
    assert measured(recording, "survived").all()
    assert measured(recording, "speed").min() > 0.35
    assert measured(recording, "duty_fore").min() > 0.63
    assert measured(recording, "duty_hind").min() > 0.6
    for robot in range(3):
        found = footfall_lags(recording, robot, end=470)
        assert max(apart(found["LF"], 0.25), apart(found["RH"], 0.5), apart(found["RF"], 0.75)) < 0.03


def test_at_a_lower_one_it_stands():
    recording = runs("quadruped_trots", [0], settings={"drive": "0.4"}, duration=4.0)
    assert measured(recording, "survived").all()
    assert all(recording.channel(f"load_{leg}")[SETTLED:].min() > STANDS_N for leg in LEGS)


def test_the_gait_changes_between_two_drives_that_lie_close_together():
    for drive, lag, by in ((0.95, 0.33, 0.03), (1.05, 0.52, 0.04)):
        recording = runs("quadruped_trots", [0], settings={"drive": str(drive)}, duration=4.7)
        assert apart(footfall_lags(recording, 0, start=200)["LF"], lag) < by


def test_it_goes_over_from_walk_to_trot_while_the_drive_rises():
    recording = runs("quadruped_changes_gait", range(3))
    assert measured(recording, "survived").all()
    assert measured(recording, "diagonal_before").max() < 0.55
    assert measured(recording, "diagonal_after").min() > 0.9
    assert measured(recording, "duty_before").min() > 0.6
    assert measured(recording, "duty_after").max() < 0.56
    assert (measured(recording, "speed_after") > 1.25 * measured(recording, "speed_before")).all()


def test_the_stepping_reflex_survives_twice_the_push():
    for direction in ("left", "right"):
        push = f"160N,200ms,{direction}"
        assert measured(runs("quadruped_trots", range(6), push, duration=8.0), "survived").all()
    weaker = runs(
        "quadruped_trots", range(6), "120N,200ms,left", duration=8.0, silenced=("lateral_velocity",)
    )
    assert not measured(weaker, "survived").any()
