"""The gait file: what it says, and every complaint word for word."""

from __future__ import annotations

import math

import pytest
from walking import GAITS

from circuitkit.base.errors import InputError
from circuitkit.base.source.data_files import shipped_names
from circuitkit.biped.gait import load_gait

GOOD = """\
gait: mine
pattern: three_movements
control_step: 10 ms
double_support: 50 ms
single_support: 500 ms
step_length: 2 cm
stand: 1 s
knee: 33 deg
com_height: 270 mm
zmp: {forward: 22 mm, sideways: 53 mm}
lift: {height: 8 mm, start: 5 %, end: 100 %}
swing: {start: 20 %, end: 80 %}
"""


def complaints(tmp_path, old, new):
    """What is said about a gait file with one thing changed."""
    path = tmp_path / "mine.yaml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_gait(path)
    return str(caught.value).replace(str(path), "mine.yaml")


def test_quantities_are_kept_in_si_units(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD, encoding="utf-8")
    gait = load_gait(path)
    assert gait.step_length == pytest.approx(0.02)
    assert gait.knee == pytest.approx(math.radians(33))
    assert (gait.lift.start, gait.lift.end) == pytest.approx((0.05, 1.0))
    assert gait.step_ticks == 55


@pytest.mark.parametrize("name", GAITS)
def test_shipped_gaits_have_the_papers_times(name):
    """Section 5.1: 10 ms; section 5.2: 0.05 s on both feet, 0.5 s on one."""
    gait = load_gait(name)
    assert gait.gait == name
    assert (gait.control_step, gait.double_support, gait.single_support) == (0.01, 0.05, 0.5)
    assert gait.step_length == {"march": 0.0, "walk_2cm": 0.02, "walk_4cm": 0.04}[name.removeprefix("gait_")]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "three_movements",
            "preview_control",
            "mine.yaml:2:10: pattern: found 'preview_control'; allowed: three_movements",
        ),
        (
            "control_step: 10 ms",
            "control_step: 10",
            "mine.yaml:3:15: control_step: found 10, which is dimensionless; allowed: a quantity such as "
            "'200 ms'",
        ),
        (
            "step_length: 2 cm",
            "step_length: 2 kg",
            "mine.yaml:6:14: step_length: found '2 kg', which is mass; allowed: a quantity such as "
            "'80 mm'",
        ),
        (
            "step_length: 2 cm",
            "step_length: 12 cm",
            "mine.yaml:6:14: step_length: found '12 cm'; allowed: at most 8 cm",
        ),
        (
            "sideways: 53 mm",
            "sideways: -53 mm",
            "mine.yaml:10:33: zmp.sideways: found '-53 mm'; allowed: more than 0 mm",
        ),
        (
            "start: 20 %, end: 80 %",
            "start: 80 %, end: 20 %",
            "mine.yaml:12:8: swing: found start 0.8 and end 0.2; allowed: start before end",
        ),
        (
            "single_support: 500 ms",
            "single_support: 505 ms",
            "mine.yaml:1:1: single_support is 50.5 control steps; allowed: a whole number of control steps",
        ),
        (
            "knee: 33 deg",
            "knees: 33 deg",
            "mine.yaml:1:1: missing key 'knee'",
        ),
    ],
)  # fmt: skip
def test_a_complaint(tmp_path, old, new, said):
    assert said in complaints(tmp_path, old, new)


def test_every_wrong_value_is_reported_at_once(tmp_path):
    text = complaints(tmp_path, "stand: 1 s\nknee: 33 deg", "stand: 0 s\nknee: 3 rad")
    assert text == (
        "mine.yaml:7:8: stand: found '0 s'; allowed: more than 0 s\n"
        "mine.yaml:8:7: knee: found '3 rad'; allowed: less than 2 rad"
    )


def test_an_unknown_key_is_answered_with_the_nearest(tmp_path):
    assert "unknown key 'knees'" in complaints(tmp_path, "knee: 33 deg", "knees: 33 deg")
    assert "did you mean 'knee'?" in complaints(tmp_path, "knee: 33 deg", "knees: 33 deg")


def test_a_foot_must_not_move_forward_on_the_ground(tmp_path):
    """It would drag the robot over."""
    said = complaints(tmp_path, "lift: {height: 8 mm, start: 5 %", "lift: {height: 8 mm, start: 25 %")
    assert said == (
        "mine.yaml:1:1: swing is from 0.2 to 0.8 of single support, the lift from 0.25 to 1; "
        "allowed: a swing within the lift"
    )


def test_a_foot_must_be_lifted_to_step(tmp_path):
    said = complaints(tmp_path, "height: 8 mm", "height: 0 mm")
    assert said == (
        "mine.yaml:1:1: lift.height is 0 and step_length 0.02 m; "
        "allowed: a lift of more than 0, or a step of 0"
    )


def test_an_unknown_gait_is_answered_with_the_shipped_ones():
    with pytest.raises(InputError) as caught:
        load_gait("gait_walk_3cm")
    names = ", ".join(shipped_names("sims/gaits"))
    assert str(caught.value) == (
        "gait_walk_3cm:1:1: unknown name 'gait_walk_3cm'; allowed: a path, or one of the shipped gaits: "
        f"{names}; did you mean 'gait_walk_2cm'?"
    )
