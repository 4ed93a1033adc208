"""The polar plot: what is counted, how it is drawn, and a small cut of its studies."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from matplotlib.image import imread
from matplotlib.text import Text

from circuitkit.draw.style import house_style
from circuitkit.paper.push_bounds import BoundsAround, PushKind
from circuitkit.paper.reproduce import polar
from circuitkit.paper.reproduce.figure import Job
from circuitkit.paper.reproduce.finding import Finding, Verdict
from circuitkit.paper.reproduce.forces import Forces
from circuitkit.paper.reproduce.polar import OMNI, OPEN, PLANAR, Around
from circuitkit.study import CaseBuilder, load_study

STEP_N = 8.0
DEGREES = np.arange(0, 360, 15)


def made_up(open_n=4.0, planar_n=8.0, omni_n=6.0, bound_n=10.0):
    """Forces that are the same from all sides."""
    every, outline = np.ones(len(DEGREES)), np.ones(360)
    survived = {OPEN: open_n * every, PLANAR: planar_n * every, OMNI: omni_n * every}
    bounds, around = (BoundsAround(bound_n / 0.733 * ones, bound_n * ones) for ones in (every, outline))
    return Around(np.radians(DEGREES), survived, bounds, around, 0.2)


def edge_of_two_soles(degrees):
    """Bounds like those of two soles side by side, the body over the left one."""
    ways = np.stack([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))], axis=-1)
    edges = np.array([[20.0, 21.0], [15.0, 39.0]])  # [N]: front and back, left and right
    return (np.where(ways > 0, edges[:, 0], edges[:, 1]) / np.maximum(np.abs(ways), 1e-9)).min(axis=1)


def oblong():
    """Forces in proportion to such bounds."""
    bound, outline = edge_of_two_soles(DEGREES), edge_of_two_soles(np.arange(360))
    survived = {OPEN: 0.4 * bound, PLANAR: 0.7 * bound, OMNI: 0.66 * bound}
    bounds, around = (BoundsAround(each, 0.733 * each) for each in (bound, outline))
    return Around(np.radians(DEGREES), survived, bounds, around, 0.2)


def test_ratios_are_means_over_directions():
    around = made_up()
    assert around.ratio(PLANAR) == pytest.approx(2.0)
    assert around.of_bound(OMNI) == pytest.approx(0.6)
    assert around.not_worse(PLANAR) == len(DEGREES)
    around.survived[PLANAR][3] = 3.0
    assert around.not_worse(PLANAR) == len(DEGREES) - 1


def test_all_directions_are_claimed_so_that_a_single_worse_one_is_too_many():
    kind = PushKind("forward", 0.2)
    ahead = Forces({"binn_tuned": {kind: 11.0}, OPEN: {kind: 10.0}}, {kind: 20.0}, {kind: 20.0})
    sides = Forces({PLANAR: {kind: 9.0}, "binn_lateral": {kind: 9.0}}, {kind: 20.0}, {kind: 20.0})
    around = made_up(8.0, 8.1, 8.1)
    verdicts = [claim.verdict for claim in polar._claims(around, ahead, sides, 20)]
    assert verdicts == [Verdict.HOLDS] * 5
    around.survived[PLANAR][3] = 7.0
    around.survived[PLANAR][4] = 16.0
    ahead.survived["binn_tuned"][kind] = 10.0
    claims = polar._claims(around, ahead, sides, 20)
    assert [claim.verdict for claim in claims[:4]] == [
        Verdict.FAILS,
        Verdict.HOLDS,
        Verdict.FAILS,
        Verdict.FAILS,
    ]
    assert claims[0].ours.endswith("less than the open loop in 1 of 24 directions")


def test_a_direction_without_any_force_in_open_loop_has_no_ratio():
    around = made_up()
    around.survived[OPEN][0] = 0.0
    assert around.ratio(PLANAR) == pytest.approx(2.0)


@pytest.mark.parametrize("around", [made_up(), made_up(2.0, 60.0, 55.0, 70.0), oblong()])
def test_no_text_of_the_picture_lies_on_another_or_beyond_the_paper(around):
    with house_style():
        figure = polar.figure_of(around)
        figure.canvas.draw()
        texts = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
        boxes = [(text.get_text(), text.get_window_extent()) for text in texts]
    for (one, box), (other, against) in itertools.combinations(boxes, 2):
        assert not box.shrunk(0.95, 0.95).overlaps(against.shrunk(0.95, 0.95)), (one, other)
    for name, box in boxes:
        assert box.x0 >= 0, name
        assert box.y0 >= 0, name
        assert box.x1 <= figure.bbox.x1, name
        assert box.y1 <= figure.bbox.y1, name


def test_forward_is_up_and_left_is_left():
    with house_style():
        figure = polar.figure_of(oblong())
        figure.canvas.draw()
    axes = figure.axes[0]
    middle = axes.transData.transform((0.0, 0.0))
    forward, left = (axes.transData.transform((np.radians(degrees), 10.0)) - middle for degrees in (0, 90))
    assert forward[1] > abs(forward[0])
    assert left[0] < -abs(left[1])


def test_rings_have_numbers_only_where_no_curve_runs():
    with house_style():
        figure = polar.figure_of(oblong())
        figure.canvas.draw()
    numbers = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert "30 N" in numbers
    assert "10 N" not in numbers  # there the curves are


def test_all_directions_are_in_the_study_and_every_contender_can_be_run():
    study = load_study("polar")
    directions = [cell.labels["push.direction"] for cell in study.cells if cell.labels["contender"] == OPEN]
    np.testing.assert_allclose(directions, np.radians(DEGREES))
    cases = CaseBuilder(study)
    assert len({cases.of_cell(cell, "10 N").key for cell in study.cells}) == 3 * 24


def test_a_small_cut_of_the_studies_becomes_a_finding(tmp_path, monkeypatch):
    cut = {
        "watch": "1 s",
        "seeds": {"count": 1},
        "search": {"step": f"{STEP_N:g} N", "check_below": 0, "high": "64 N"},
    }
    monkeypatch.setattr(polar, "_QUICK", {**cut, "set": {"push.start.step": 2}})
    monkeypatch.setattr(polar, "_QUICK_AROUND", {polar.DIRECTION: ["0 deg", "90 deg", "180 deg", "270 deg"]})
    finding = polar.Polar().run(Job("polar", tmp_path, quick=True, workers=1))
    finding.save(tmp_path)
    again, _ = Finding.load(tmp_path)
    assert again.claims == finding.claims
    assert len(finding.claims) == 5
    assert imread(tmp_path / finding.pictures[0].file).std() > 0.02  # there is something on it
    assert (tmp_path / "polar.pdf").is_file()
    assert all(len(row) == len(table.headings) for table in finding.tables for row in table.rows)
    for forces in finding.data["largest_survived_n"].values():
        assert (forces % STEP_N == 0).all()
        assert (forces <= np.array(finding.data["bound_point_mass_n"]) + STEP_N).all()
