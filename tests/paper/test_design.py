"""What the design equations take from the NAO and its walk, and the picture of a design."""

from __future__ import annotations

import math

import pytest

from circuitkit.base.errors import InputError
from circuitkit.biped.gait import load_gait
from circuitkit.paper.design import robot_and_reaches
from circuitkit.paper.design_figure import design_figure, draw_design
from circuitkit.paper.design_sheet import make_sheet


@pytest.fixture(scope="module")
def nao():
    return robot_and_reaches("nao")


def test_the_nao_is_that_of_the_data_sheets(nao):
    """Mass and height as in the paper; limits of LAnkleRoll, stall torque and speed of its motor and gear."""
    body, _ = nao
    assert body.mass_kg == pytest.approx(5.18, abs=0.03)
    assert body.com_height_m == pytest.approx(0.27, abs=0.003)
    assert math.degrees(body.ankle_limit_rad) == pytest.approx(22.79, abs=0.01)
    assert body.joint_torque_nm == pytest.approx(14.8)
    assert body.joint_speed_rad_s == pytest.approx(4.16, abs=0.02)
    assert body.sole_edge_m == pytest.approx(0.0388)


def test_the_com_shifts_less_than_eq_16_says(nao):
    """With hips that turn back; the paper's own 0.06 m at 22 degrees is a lever of 0.16 m."""
    body, _ = nao
    assert body.lever_m == pytest.approx(0.15, abs=0.005)
    assert body.lever_m * math.sin(body.ankle_limit_rad) == pytest.approx(0.06, abs=0.004)


@pytest.mark.parametrize("moment", [0.0, 0.2, 0.7, 1.0])
def test_the_dcm_is_that_of_the_periodic_pendulum(moment):
    """The closed form of a ZMP that goes linearly from one foot to the other and back.

    In steady walking xi(t) = omega * integral of p(t + s) exp(-omega s) ds: a sum over the steps to come.
    """
    body, (outward, inward) = robot_and_reaches("nao", "gait_march", moment)
    gait = load_gait("gait_march")
    omega = math.sqrt(9.81 / body.com_height_m)
    single, double, p = gait.single_support, gait.double_support, gait.zmp.sideways
    fade = math.exp(-omega * (single + double))
    # One ramp from p to -p that begins at 0: what it adds to xi(0) beyond a ZMP that stays at p.
    ramp = -2 * p * (1 - math.exp(-omega * double)) / (omega * double)
    left = (1 - moment) * single
    xi = p + ramp * math.exp(-omega * left) / (1 + fade)
    assert 0.1 - outward.distance_m == pytest.approx(xi, abs=5e-4)
    assert outward.distance_m + inward.distance_m == pytest.approx(0.2)  # from edge to edge of both feet


def test_a_push_inward_has_more_room(nao):
    _, (outward, inward) = nao
    assert (outward.direction, inward.direction) == ("outward", "inward")
    assert inward.distance_m > outward.distance_m


def test_a_moment_that_is_not_in_single_support():
    with pytest.raises(InputError, match=r"^moment: found 1\.2; allowed: 0 to 1, a part of single support$"):
        robot_and_reaches("nao", moment=1.2)


def overlapping(figure):
    """Pairs of texts whose boxes overlap."""
    renderer = figure.canvas.get_renderer()
    boxes = []
    for axes in figure.axes:
        parts = [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.get_legend().get_texts()]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            parts += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        parts += [axes._left_title]
        boxes += [(part.get_text(), part.get_window_extent(renderer)) for part in parts if part.get_text()]
    inside = figure.bbox
    outside = [
        text
        for text, box in boxes
        if not (inside.x0 <= box.x0 and box.x1 <= inside.x1 and inside.y0 <= box.y0)
    ]
    pairs = [
        (a, b)
        for i, (a, one) in enumerate(boxes)
        for b, other in boxes[i + 1 :]
        if one.width and other.width and one.overlaps(other)
    ]
    return outside, pairs


@pytest.mark.parametrize("robot", [False, True])
def test_nothing_overlaps_in_the_picture(robot, nao):
    body_and_reaches = nao if robot else ()
    figure = design_figure(make_sheet(*body_and_reaches, force_n=20.0, duration_s=0.2))
    figure.canvas.draw()
    assert overlapping(figure) == ([], [])


def test_the_picture_is_a_file(tmp_path):
    sheet = make_sheet(force_n=20.0, duration_s=0.2)
    draw_design(sheet, tmp_path / "w.svg")
    text = (tmp_path / "w.svg").read_text(encoding="utf-8")
    assert text.count("<path") > 20
    with pytest.raises(InputError, match=r"found the suffix '\.gif'"):
        draw_design(sheet, tmp_path / "w.gif")
