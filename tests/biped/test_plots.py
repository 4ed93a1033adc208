"""Plots of walks, checked against the outline of the sole, the circuit file and the times of the push."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from walking import a_push, fault, scenario, view_of, walk_alone

from circuitkit.biped.plots import (
    BAND,
    PUSHED,
    _arrows,
    comparison_figure,
    phase_figure,
    summarise_biped,
    zmp_figure,
)
from circuitkit.biped.sensing import support_edges_m
from circuitkit.robots import load_robot
from circuitkit.simulation import make_plan
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.plots import draw_comparison, draw_result
from circuitkit.simulation.result import Result, summarise

TICK_S = 0.01
# The sole reaches 50.0 mm outwards and 38.8 mm inwards of the ankle (B-Human); ankles are at 50 and -50 mm.
LEFT_FOOT, RIGHT_FOOT, BOTH_FEET = (11.2, 100.0), (-100.0, -11.2), (-100.0, 100.0)
CHANCE = (Jitter(start=0.02, velocity=0.01), Noise(channel="*Fsr*", std="0.2 N"))


def run(controller, force=20.0, disturbances=None):
    """A short walk with a push to the right in its third step."""
    if disturbances is None:
        disturbances = (a_push(force=force, direction="right", step=2),)
    plan = make_plan(scenario("gait_walk_2cm", (*CHANCE, *disturbances), duration=3.2))
    recording = walk_alone(plan, controller)
    return Result(plan.scenario, recording, recording.measures[0])


def told(result):
    """What the plots of a biped show."""
    return summarise_biped(result, summarise(result))


def stopped_after(result, ticks):
    """The run as Ctrl-C would have left it."""
    fields = ("readings", "qpos", "observations", "commands", "trace")
    shorter = {name: getattr(result.recording, name)[:ticks] for name in fields}
    recording = dataclasses.replace(result.recording, interrupted=True, **shorter)
    return dataclasses.replace(result, recording=recording)


@pytest.fixture(scope="module")
def pushed():
    return run("circuit")


@pytest.fixture(scope="module")
def fallen():
    return run("open_loop", force=60.0)


def artist(figure, gid, axes=-1):
    """The one artist of a name in one axes of a figure."""
    found = [each for each in figure.axes[axes].get_children() if each.get_gid() == gid]
    assert len(found) == 1, (gid, found)
    return found[0]


def finite(line):
    x, y = (np.asarray(values, dtype=float) for values in line.get_data())
    seen = np.isfinite(x) & np.isfinite(y)
    return x[seen], y[seen]


def test_the_support_polygon_is_the_published_outline_of_the_sole():
    edges = support_edges_m(load_robot("nao").biped) * 1e3
    np.testing.assert_allclose(edges, [LEFT_FOOT, RIGHT_FOOT, BOTH_FEET], atol=1e-9)


def test_the_grey_band_follows_the_measured_load(pushed):
    story = told(pushed)
    loads = view_of(pushed.recording).loads_n[:, 0]
    share = loads[:, 0] / loads.sum(axis=1)
    clear = [(share > 0.96, LEFT_FOOT), (share < 0.04, RIGHT_FOOT), (abs(share - 0.5) < 0.4, BOTH_FEET)]
    for rows, edges in clear:
        assert rows.any()
        np.testing.assert_allclose(story.band_mm[rows], np.broadcast_to(edges, (rows.sum(), 2)), atol=1e-9)
    band = artist(zmp_figure(story), "support")
    heights = np.unique(np.round(band.get_paths()[0].vertices[:, 1], 6))
    assert set(heights) == {*LEFT_FOOT, *RIGHT_FOOT, *BOTH_FEET}


def test_the_dashed_lines_are_the_edges_of_the_circuit_file(pushed):
    figure = zmp_figure(told(pushed))
    parameters = {name: value.value_si * 1e3 for name, value in pushed.recording.circuit.parameters.items()}
    outer, inner = parameters["left_edge_left_foot"], parameters["right_edge_left_foot"]
    margin = parameters["margin"]
    outer, inner = outer - margin, inner + margin
    assert set(np.round(finite(artist(figure, "threshold_0"))[1], 6)) == {round(inner, 6), round(-outer, 6)}
    assert set(np.round(finite(artist(figure, "threshold_1"))[1], 6)) == {round(outer, 6), round(-inner, 6)}


def test_a_push_has_its_exact_times_although_it_is_applied_in_ticks(pushed):
    story = told(pushed).run
    assert len(story.pushes) == 1
    start, end = pushed.recording.effects.windows_s[0]
    assert (story.pushes[0].start_s, story.pushes[0].end_s) == pytest.approx((start, end), abs=1e-12)
    assert end - start == pytest.approx(0.2)
    assert start % TICK_S > 1e-6  # jittered: it begins within a tick
    np.testing.assert_allclose(story.pushes[0].force, [0.0, -20.0, 0.0])
    assert story.pushes[0].text == "20 N to the right"


def test_a_push_has_the_scenarios_own_word_beside_the_plain_one():
    """In step 2 the left foot carries, so inward is to the right."""
    result = run("circuit", disturbances=(a_push(step=2),))
    (push,) = told(result).run.pushes
    assert push.text == "20 N to the right (inward)"
    assert result.row()["push"]["direction"] == "inward"


@pytest.mark.parametrize("controller", ["circuit", "open_loop"])
def test_the_lines_are_named_after_the_circuit_whose_they_are(controller):
    """Also where the controller has no such neurons, as in open loop."""
    figure = zmp_figure(told(run(controller)))
    assert artist(figure, "threshold_0").get_label() == "threshold of binn_lateral_tuned"


def test_without_the_measure_there_are_no_lines():
    plan = make_plan(scenario("gait_march", (), duration=1.0, measures={"survived": "not ended"}))
    recording = walk_alone(plan, "open_loop")
    figure = zmp_figure(told(Result(plan.scenario, recording, recording.measures[0])))
    assert not [each for each in figure.axes[0].lines if (each.get_gid() or "").startswith("threshold")]


@pytest.mark.parametrize(
    ("until", "angle"),
    [
        ("upright < 0.5 or com_z < 0.6 * first(com_z)", 60.0),
        ("com_z < 0.6 * first(com_z)", None),
        ("upright < 0.5 and com_z < 0.2 m", None),
    ],
)
def test_the_line_of_a_fall_is_the_bound_of_the_scenario(until, angle):
    plan = make_plan(scenario("gait_march", (), duration=0.5, until=until))
    recording = walk_alone(plan, "open_loop")
    axes = comparison_figure([Result(plan.scenario, recording, recording.measures[0])]).axes[-1]
    lines = [each for each in axes.lines if each.get_gid() == "fall_bound"]
    assert [each.get_ydata()[0] for each in lines] == pytest.approx([] if angle is None else [angle])
    assert [each.get_text() for each in axes.get_legend().get_texts()][1:] == ["counts as a fall"] * len(
        lines
    )


def test_nothing_hides_the_curves_of_the_comparison(pushed, fallen):
    """The legend of the lower axes stands above them, and no words stand in them."""
    figure = comparison_figure([fallen, pushed])
    figure.draw_without_rendering()
    axes = figure.axes[-1]
    assert axes.get_legend().get_window_extent().y0 >= axes.bbox.y1 - 1
    assert not [each for each in axes.texts if each.get_text()]


def test_the_red_part_begins_at_the_push_and_together_they_are_the_zmp(pushed):
    figure = zmp_figure(told(pushed))
    start = pushed.recording.effects.windows_s[0, 0]
    before, after = artist(figure, "zmp_before"), artist(figure, "zmp_after")
    assert after.get_color() == PUSHED
    assert before.get_color() != PUSHED
    x_before, y_before = finite(before)
    x_after, y_after = finite(after)
    assert x_before[-1] < start
    assert x_after[0] == pytest.approx(x_before[-1])  # no gap between them
    assert start - x_after[0] < TICK_S + 1e-9
    zmp = pushed.recording.channel("zmp_y")[:, 0] * 1e3
    np.testing.assert_allclose(np.concatenate([y_before, y_after[1:]]), zmp)


def test_the_view_is_two_seconds_before_and_four_after_the_push_or_until_the_fall(pushed, fallen):
    start = pushed.recording.effects.windows_s[0, 0]
    assert told(pushed).run.window_s == pytest.approx((max(start - 2.0, 0.0), 3.2))
    low, high = told(fallen).run.window_s
    assert low == pytest.approx(max(start - 2.0, 0.0))
    assert 0.0 < high - fallen.measures["time_of_fall_s"] < 0.2


def test_a_fall_is_marked_and_ends_the_curves(fallen):
    figure = zmp_figure(told(fallen))
    fall = fallen.measures["time_of_fall_s"]
    assert np.unique(artist(figure, "fall").get_xdata()) == pytest.approx(fall)
    for name in ("zmp_after", "pressure", "threshold_0"):
        assert finite(artist(figure, name))[0].max() <= fall + 1e-9
    assert figure.get_suptitle() == f"nao_push, open_loop: fell at {fall:.2f} s"


def test_missing_readings_are_marked_where_the_cell_failed():
    result = run("circuit", disturbances=[fault("LFsrFL", "missing", 1.0, 0.3)])
    missing = artist(zmp_figure(told(result)), "missing").get_xdata()
    # The ends of the ticks from 1.0 to 1.3 s.
    np.testing.assert_allclose(missing, np.arange(101, 131) * TICK_S)


def test_the_phase_portrait_shows_the_centre_of_mass_and_its_velocity(pushed):
    figure = phase_figure(told(pushed))
    y, v = finite(artist(figure, "com_after"))
    recording, view = pushed.recording, view_of(pushed.recording)
    rows = slice(recording.ticks - len(y), None)
    np.testing.assert_allclose(y, view.com_m[rows, 0, 1] * 1e3)
    np.testing.assert_allclose(v, view.com_velocity[rows, 0, 1] * 1e3)
    start, end = recording.effects.windows_s[0]
    for name, moment in (("push_begins", start), ("push_ends", end)):
        at = np.interp(moment, recording.time_s, view.com_m[:, 0, 1] * 1e3)
        assert artist(figure, name).get_xdata()[0] == pytest.approx(at)


def test_the_dotted_lines_are_where_the_capture_point_is_at_the_outer_edges(fallen):
    story = told(fallen)
    y, v = finite(artist(phase_figure(story), "capture_right"))
    omega = np.sqrt(9.81 / story.com_height_m)
    np.testing.assert_allclose(y + v / omega, -100.0)


def test_the_comparison_titles_each_column_with_its_verdict(pushed, fallen):
    figure = comparison_figure([fallen, pushed])
    fall = fallen.measures["time_of_fall_s"]
    end = pushed.outcome
    assert [axes.get_title() for axes in figure.axes[:2]] == [
        f"open_loop: fell at {fall:.2f} s",
        f"circuit: {end}",
    ]
    time, tilt = artist(figure, "tilt_0").get_data()
    # The fall is where the torso's axis leans by 45 degrees.
    assert tilt[time < fall - TICK_S / 2].max() < 45.6
    assert tilt[np.searchsorted(time, fall - TICK_S / 2)] > 45.0


@pytest.mark.parametrize(
    "draw",
    [
        lambda result: zmp_figure(told(result)),
        lambda result: phase_figure(told(result)),
        lambda result: comparison_figure([result, result]),
    ],
)
def test_nothing_is_cut_off_and_axes_have_units(pushed, draw):
    figure = draw(pushed)
    figure.draw_without_rendering()
    box, page = figure.get_tightbbox(), figure.get_size_inches()
    assert min(box.x0, box.y0) >= -0.01
    assert box.x1 <= page[0] + 0.01
    assert box.y1 <= page[1] + 0.01
    labels = [figure.axes[-1].get_xlabel(), *(axes.get_ylabel() for axes in figure.axes if axes.get_ylabel())]
    assert all("[" in label or "from 0 to 1" in label for label in labels), labels


def test_the_lines_stay_apart_in_grey():
    def lightness(colour):
        red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
        return 0.299 * red + 0.587 * green + 0.114 * blue

    assert lightness(BAND) - lightness(PUSHED) > 100


def test_the_files_that_each_controller_leaves(tmp_path, pushed, fallen):
    draw_result(pushed, tmp_path / "circuit")
    draw_result(fallen, tmp_path / "open_loop")
    draw_comparison([fallen, pushed], tmp_path)
    written = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*"))
    assert written == [
        "circuit/channels.png",
        "circuit/com_phase.png",
        "circuit/neurons.png",
        "circuit/path.png",
        "circuit/zmp.png",
        "compare.png",
        "open_loop/channels.png",
        "open_loop/com_phase.png",
        "open_loop/path.png",
        "open_loop/zmp.png",
        "path.png",
    ]
    for name in written:
        with Image.open(tmp_path / name) as picture:
            assert picture.format == "PNG"
            assert min(picture.size) > 300


@pytest.mark.parametrize("ticks", [1, 2, 3, 40])
def test_a_run_that_was_stopped_early_is_drawn_as_far_as_it_got(tmp_path, pushed, ticks):
    result = stopped_after(pushed, ticks)
    draw_result(result, tmp_path)
    draw_comparison([result], tmp_path)
    assert (tmp_path / "zmp.png").exists() == (ticks > 1)
    assert result.outcome == "stood until interrupted"
    assert summarise(result).pushes == ()


def test_without_a_push_there_is_one_view_of_everything():
    result = run("circuit", disturbances=())
    story = told(result)
    figure = zmp_figure(story)
    assert len(figure.axes) == 1
    assert figure.axes[0].get_xlim() == pytest.approx((0.0, 3.2))
    assert not [each for each in figure.axes[0].get_children() if each.get_gid() in {"push_0", "zmp_after"}]


def test_a_curve_of_one_point_gets_no_arrows():
    drawn = []
    axes = SimpleNamespace(annotate=lambda *_args, **_options: drawn.append(1))
    _arrows(axes, np.array([np.nan, 1.0]), np.array([0.0, 1.0]), "#000000")
    assert drawn == []
