"""`circuitkit design`."""

from __future__ import annotations

import json

import pytest

PUSH = ("design", "--force", "20N", "--duration", "200ms")


def test_the_push_of_the_paper_as_tables(circuitkit):
    outcome = circuitkit(*PUSH)
    assert (outcome.code, outcome.err) == (0, "")
    for words in ("1.655 deg", "22.58 N", "32.24 N", "under both", "for ever", "w: 1.655 deg"):
        assert words in outcome.out


def test_what_it_says_to_set_can_be_set(circuitkit):
    command = next(line.strip() for line in circuitkit(*PUSH).out.splitlines() if "circuitkit diff" in line)
    outcome = circuitkit(*command.split()[1:])
    assert (outcome.code, outcome.err) == (0, "")
    assert "w: 1.63 deg → 1.655 deg" in outcome.out


def test_json(circuitkit):
    found = json.loads(circuitkit(*PUSH, "--json").out)
    assert found["weight_deg"] == pytest.approx(1.655, abs=5e-4)
    assert found["set"] == "w=1.655deg"
    assert found["body"]["mass_kg"] == 5.18
    (bound,) = found["bounds"]
    assert bound["duration_s"] is None  # for ever
    assert (bound["distance_m"], bound["under_lasting"], bound["under_bound"]) == (0.12, True, True)
    assert {check["met"] for check in found["checks"]} == {True, False}


def test_the_force_of_a_w(circuitkit):
    found = json.loads(
        circuitkit("design", "--w", "1.63deg", "--duration", "0.2s", "--gamma", "1", "--json").out
    )
    assert found["force_n"] == pytest.approx(0.995 * 20.0, abs=0.01)


def test_other_robots(circuitkit):
    words = (
        "--mass",
        "10.36kg",
        "--com-height",
        "54cm",
        "--edge",
        "6cm",
        "--ankle-limit",
        "30deg",
        "--step",
        "5ms",
    )
    found = json.loads(circuitkit(*PUSH, *words, "--json").out)
    # Half the speed, half the time for a step, twice as high: an eighth; m g L / z is half of 22.58 N.
    assert found["com_shift_m"] == pytest.approx(1.01 * 20 * 0.2 / 10.36 * 0.005)
    assert found["weight_rad"] == pytest.approx(found["com_shift_m"] / 0.54, rel=1e-4)
    assert found["bounds"][0]["lasting_force_n"] == pytest.approx(11.29, abs=5e-3)
    assert "up to 30 deg" in [check["allowed"] for check in found["checks"]]


def test_a_robot_that_walks(circuitkit, tmp_path):
    outcome = circuitkit(*PUSH, "--robot", "nao", "--at", "20%", "-o", "w.png", "--push-height", "368mm")
    assert (outcome.code, outcome.err) == (0, "wrote w.png\n")
    assert (tmp_path / "w.png").stat().st_size > 10_000
    for words in ("outward", "inward", "the same by the measured lever", "the ankle's speed"):
        assert words in outcome.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--force", "20", "--duration", "200ms"),
            "--force: found '20', which is dimensionless; allowed: a quantity such as '20 N'",
        ),
        (
            ("--force", "20N", "--duration", "2mm"),
            "--duration: found '2mm', which is length; allowed: a quantity such as '200 ms'",
        ),
        (
            ("--force", "-20N", "--duration", "2ms"),
            "--force: found '-20N'; allowed: more than 0, such as '20 N'",
        ),
        (
            ("--force", "1e9N", "--duration", "200ms"),
            "--force: found '1e9N' for 200ms, too strong for any w: no angle shifts the CoM by ",
        ),
        (("--w", "95deg", "--force", "20N"), "--w: found '95deg'; allowed: up to 90 deg"),
        ((*PUSH[1:], "--robot", "nao", "--at", "1.5"), "--at: found '1.5'; allowed: up to 100 %"),
        (
            (*PUSH[1:], "--robot", "nau"),
            "--robot: unknown robot 'nau'; allowed: nao, or the path of a robot.yaml; did you mean 'nao'?",
        ),
        ((*PUSH[1:], "-o", "w.gif"), "w.gif: found the suffix '.gif'; allowed: .png, .svg, .pdf"),
    ],
)
def test_mistakes(refused, words, message):
    assert refused("design", *words).startswith(message)


def test_a_robot_that_is_no_biped_is_refused(refused):
    said = refused(*PUSH, "--robot", "vehicle")
    assert "the robot file has no block 'biped', which says what are torso, feet and legs" in said


def test_an_unknown_unit_is_told_with_what_was_meant(refused):
    said = refused("design", "--force", "20Nn", "--duration", "200ms")
    assert said.startswith("--force: unknown unit 'Nn'; allowed: ")
    assert "did you mean" in said


def test_a_gait_needs_a_robot(circuitkit):
    outcome = circuitkit(*PUSH, "--gait", "gait_march")
    assert outcome.code == 2
    assert "--gait and --at go with --robot" in outcome.err


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ((), "none of them"),
        (("--force", "20N"), "--force"),
        ((*PUSH[1:], "--w", "1deg"), "--force, --duration, --w"),
    ],
)
def test_a_push_is_two_of_three(circuitkit, words, found):
    outcome = circuitkit("design", *words)
    assert (outcome.code, outcome.out) == (2, "")
    said = " ".join(outcome.err.replace("│", " ").split())
    assert f"found {found}; allowed: two of --force, --duration, --w" in said
