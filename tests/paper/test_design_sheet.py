"""The design of one push: the third of force, duration and w, and where the equations are valid."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from circuitkit.base.errors import InputError
from circuitkit.paper.design_sheet import PAPER_BODY, Reach, make_sheet, show


def unmet(sheet):
    return [check.name for check in sheet.checks if not check.met]


def test_the_push_of_the_paper():
    """Section 5.2 and Fig. 7: w, under eq. 22; the angle adds up past 22 degrees before the push is over."""
    sheet = make_sheet(force_n=20.0, duration_s=0.2)
    assert math.degrees(sheet.weight_rad) == pytest.approx(1.655, abs=5e-4)
    assert sheet.setting == "w=1.655deg"
    (bound,) = sheet.bounds
    assert (bound.under_lasting, bound.under_bound, bound.duration_s) == (True, True, math.inf)
    assert bound.lasting_force_n == pytest.approx(22.58, abs=5e-3)
    assert unmet(sheet) == ["the ankle's range, p fully active all the while"]
    assert sheet.checks[2].found == "33.11 deg; the limit comes after 130 ms"  # 13 steps of 1.655 degrees


def test_any_two_of_the_three_give_the_third():
    sheet = make_sheet(force_n=20.0, duration_s=0.2, gamma=1.1)
    for given in (
        {"weight_rad": sheet.weight_rad, "duration_s": 0.2},
        {"weight_rad": sheet.weight_rad, "force_n": 20.0},
    ):
        other = make_sheet(**given, gamma=1.1)
        assert other.force_n == pytest.approx(20.0)
        assert other.duration_s == pytest.approx(0.2)
        assert other.com_shift_m == pytest.approx(sheet.com_shift_m)


@pytest.mark.parametrize(
    "given", [{}, {"force_n": 20.0}, {"force_n": 1.0, "duration_s": 1.0, "weight_rad": 1.0}]
)
def test_not_two_of_them(given):
    with pytest.raises(InputError, match=r"allowed: two of force, duration and w; eq\. 21 gives the third$"):
        make_sheet(**given)


def test_a_push_that_lasts_is_not_short():
    assert "a short push (section 4.2)" not in unmet(make_sheet(force_n=2.0, duration_s=0.99))
    assert "a short push (section 4.2)" in unmet(make_sheet(force_n=2.0, duration_s=1.0))


def test_a_push_between_the_two_bounds():
    """25 N are more than eq. 22's 22.58 N, and held for 0.2 s: 1 - exp(-omega d) is 0.7005."""
    (bound,) = make_sheet(force_n=25.0, duration_s=0.2).bounds
    assert (bound.under_lasting, bound.under_bound) == (False, True)
    assert bound.force_n == pytest.approx(22.5848 / 0.70047, rel=1e-4)
    assert 0.2 < bound.duration_s < math.inf


def test_the_angle_reaches_the_ankles_limit_exactly():
    sheet = make_sheet(weight_rad=math.radians(1.1), duration_s=0.2)
    assert not unmet(sheet)  # 20 steps of 1.1 degrees are 22 degrees


def test_a_leak_takes_the_angle_back():
    """1.655 degrees with a leak of 5 % add up to (1 - 0.95^20) / 0.05 = 12.8 of them, not to 20."""
    check = make_sheet(force_n=20.0, duration_s=0.2, leak=0.05).checks[2]
    assert (check.found, check.met) == ("21.24 deg", True)
    longer = make_sheet(force_n=20.0, duration_s=0.25, leak=0.05).checks[2]
    assert not longer.met
    # 14 of 2.069 degrees make 21.2, 15 make 22.2.
    assert longer.found.endswith("the limit comes after 140 ms")


def test_a_joint_that_is_too_slow():
    slow = replace(PAPER_BODY, joint_speed_rad_s=math.radians(150.0))
    assert "the ankle's speed" in unmet(make_sheet(slow, force_n=20.0, duration_s=0.2))  # 165.5 deg/s
    assert "the ankle's speed" not in unmet(make_sheet(slow, force_n=18.0, duration_s=0.2))


def test_the_measured_lever_asks_for_more():
    """Eq. 16 has z_CoM where 0.152 m are measured: sin w is 0.27 / 0.152 times as large."""
    sheet = make_sheet(replace(PAPER_BODY, lever_m=0.152), force_n=20.0, duration_s=0.2)
    ratio = math.sin(sheet.weight_by_lever_rad) / math.sin(sheet.weight_rad)
    assert ratio == pytest.approx(0.27 / 0.152)
    huge = make_sheet(replace(PAPER_BODY, lever_m=0.152), force_n=500.0, duration_s=0.2)
    assert huge.weight_by_lever_rad is None  # 0.195 m in a step


def test_a_push_above_the_com_is_worth_more():
    low = make_sheet(force_n=20.0, duration_s=0.2).bounds[0]
    high = make_sheet(force_n=20.0, duration_s=0.2, push_height_m=0.36).bounds[0]
    assert high.force_n == pytest.approx(low.force_n * 0.75)
    assert high.lasting_force_n == pytest.approx(low.lasting_force_n * 0.75)
    assert high.force_at_com_n == low.force_at_com_n == low.force_n
    assert high.under_bound
    assert not high.under_lasting
    assert high.duration_s < math.inf


def test_a_push_is_on_the_torso_where_that_is_known():
    body = replace(PAPER_BODY, torso_height_m=0.36)
    given = make_sheet(force_n=20.0, duration_s=0.2, push_height_m=0.36)
    assert make_sheet(body, force_n=20.0, duration_s=0.2).bounds == given.bounds
    with pytest.raises(InputError, match=r"^push_height_m: found 0; allowed: more than 0$"):
        make_sheet(force_n=20.0, duration_s=0.2, push_height_m=0.0)


def test_no_room_holds_nothing():
    (bound,) = make_sheet(reaches=[Reach("outward", 0.0)], force_n=1.0, duration_s=0.2).bounds
    assert (bound.force_n, bound.duration_s, bound.under_bound) == (0.0, 0.0, False)


def test_the_traps_are_told_in_numbers():
    text = " ".join(make_sheet(force_n=20.0, duration_s=0.2).traps)
    for words in ("14.78 N*m, not 0.07344 N*m", "by 290.9 mm, not by 1.445 mm", "1.655 deg moves the CoM"):
        assert words in text


def test_numbers_are_shown_in_readable_units():
    assert [show(0.2, "s"), show(1.5, "s"), show(math.inf, "s")] == ["200 ms", "1.5 s", "for ever"]
    assert [show(0.12, "m"), show(math.radians(22), "rad"), show(5.18, "kg")] == [
        "120 mm",
        "22 deg",
        "5.18 kg",
    ]
