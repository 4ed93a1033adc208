"""Plots, summaries and files of any robot, against what was recorded."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image
from simulation.test_objects import CIRCUIT
from small_robots import CART, CART_FILE, PUCK, PUCK_FILE, Told, run, small_robot

from circuitkit import parse_circuit
from circuitkit.base.units import parse_unit
from circuitkit.control import CircuitController
from circuitkit.simulation.disturbances.fault import Fault
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.plots import (
    channels_of_interest,
    comparison_figure,
    draw_comparison,
    draw_result,
    neuron_figure,
    path_figure,
    result_figures,
    shown_unit,
)
from circuitkit.simulation.recording import column_name
from circuitkit.simulation.result import Result, find_pushes, summarise
from circuitkit.simulation.scenario import Scenario

CONNECT = {"inputs": {"lean": "angle"}, "outputs": {"motor_force": "force"}}


def result_of(robot, controller=None, disturbances=(), **more):
    recording = run(robot, controller, disturbances, **more)
    scenario = Scenario(scenario="small", robot=robot, duration=1.0)
    return Result(scenario, recording, recording.measures[0])


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("cart"), CART, **CART_FILE)


@pytest.fixture(scope="module")
def puck(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("puck"), PUCK, **PUCK_FILE)


@pytest.fixture(scope="module")
def caught(cart):
    push = Push(body="pole", force=3.0, direction="backward", duration=0.1, start=0.105)
    broken = Fault(channel="angle", reading="missing", start=0.3, duration=0.05)
    controller = CircuitController(parse_circuit(CIRCUIT), connect=CONNECT)
    return result_of(cart, controller, [push, broken], measures={"most": "max(abs(place))"})


# --- summaries ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("direction", "force", "text"),
    [
        ("left", 12.5, "12.5 N to the left"), ("forward", 7.0, "7 N forward"),
        ("backward", 30.0, "30 N backward"),
        ("right", 2.0, "2 N to the right"), ("up", 1.0, "1 N upward"), ("down", 1.0, "1 N downward"),
    ],
)  # fmt: skip
def test_pushes_in_words_with_their_exact_times(puck, direction, force, text):
    """Also where they begin and end within ticks."""
    push = Push(body="puck", force=force, direction=direction, duration=0.1033, start=0.0412)
    (span,) = find_pushes(run(puck, disturbances=[push]), 0)
    assert span.text == text
    assert (span.start_s, span.end_s) == pytest.approx((0.0412, 0.1445))
    assert span.size_n == pytest.approx(force)


def test_pushes_come_in_their_order_and_only_those_that_were_reached(cart):
    starts = (0.4, 0.1, 0.3)
    pushes = [
        Push(body="cart", force=1.0, direction="forward", duration=0.05, start=start) for start in starts
    ]
    recording = run(cart, Told(["place"]), pushes, until="t > 0.35 s")
    assert recording.ticks > 36  # it is recorded for a while longer
    cut = dataclasses.replace(recording, readings=recording.readings[:36])
    assert [span.start_s for span in find_pushes(cut, 0)] == pytest.approx([0.1, 0.3])


def test_a_summary_tells_what_befell_and_how_it_ended(cart):
    fault = Fault(channel="place", reading="missing", start=0.1, duration=0.05)
    push = Push(body="cart", force=50.0, direction="forward", duration=0.4, start=0.2)
    summary = summarise(result_of(cart, Told(["place"]), [fault, push], until="place > 10 cm"))
    assert summary.title.startswith("told: ended at 0.")
    assert not summary.good
    assert summary.spans == (("place missing", 0.1, pytest.approx(0.15)),)
    np.testing.assert_array_equal(np.flatnonzero(summary.missing), np.arange(10, 15))
    assert summary.window_s == (0.0, pytest.approx(summary.ended_s + 0.15))
    assert summary.before_end().sum() == round(summary.ended_s / 0.01)
    assert summary.pushed().argmax() == 19


def test_noise_for_a_while_and_torques_are_among_what_befell(cart):
    """As is what needs no span: noise all the time."""
    befell = [
        Noise(channel="place", std="1 mm", start=0.1, duration=0.2),
        Noise(channel="speed", std="1 mm/s"),
        Push(body="pole", torque=0.5, direction="left", duration=0.1, start=0.2),
    ]
    summary = summarise(result_of(cart, Told(["place", "speed"]), befell))
    assert summary.pushes == ()
    assert [text for text, _, _ in summary.spans] == ["noise on place", "0.5 N m"]
    np.testing.assert_allclose([span[1:] for span in summary.spans], [(0.1, 0.3), (0.2, 0.3)], atol=1e-9)


def test_the_end_of_a_run_is_marked_by_its_own_word(cart):
    for measures, word in ((None, "ended"), ({"survived": "max(place) < 5 cm"}, "failed")):
        more = {} if measures is None else {"measures": measures}
        recording = run(cart, Told(["place"], force=5.0), until="place > 10 cm", **more)
        given = {"scenario": "small", "robot": cart, "duration": 1.0, **more}
        result = Result(Scenario(**given), recording, recording.measures[0])
        assert result.ending == word
        assert result.outcome == f"{word} at {recording.ended_s():.2f} s"
        figure = result_figures(result, summarise(result))["channels"]
        assert word in [text.get_text() for text in figure.axes[0].texts]


def test_a_run_that_reaches_its_goal_did_not_fall(cart):
    measures = {"survived": "ended"}
    result = result_of(cart, Told(["place"], force=5.0), until="place > 10 cm", measures=measures)
    assert result.survived
    assert result.outcome == f"ended at {result.recording.ended_s():.2f} s"
    assert result_of(cart).outcome == "ran to the end"


# --- plots --------------------------------------------------------------------------------------------------


def test_what_is_read_measured_and_commanded_is_drawn(caught):
    names = list(channels_of_interest([caught]))
    assert names == ["angle", "place", "force"]
    figure = result_figures(caught, summarise(caught))["channels"]
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["angle [deg]", "place [mm]", "force [N]"]
    curves = {axes.get_ylabel(): axes.lines[0].get_ydata() for axes in figure.axes}
    recording = caught.recording
    np.testing.assert_allclose(curves["angle [deg]"], np.degrees(recording.channel("angle")[:, 0]))
    np.testing.assert_allclose(curves["place [mm]"], recording.channel("place")[:, 0] * 1e3)
    np.testing.assert_allclose(curves["force [N]"], recording.command("force")[:, 0])
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert "3 N backward" in texts
    assert "angle missing" in texts


def test_every_neuron_has_its_row(caught):
    figure = neuron_figure(caught, summarise(caught))
    assert [label.get_text() for label in figure.axes[-1].get_yticklabels()] == ["right", "left"]
    shown = figure.axes[-1].collections[0].get_array()
    np.testing.assert_allclose(np.asarray(shown).reshape(2, -1), caught.recording.trace[:, 0].T)


def test_the_way_of_what_moves_is_drawn_from_above(puck, cart):
    push = Push(body="puck", force=4.0, direction="30 deg", duration=0.2, start=0.0)
    figure = path_figure([result_of(puck, disturbances=[push])])
    x, y = figure.axes[0].lines[0].get_data()
    assert y[-1] / x[-1] == pytest.approx(np.tan(np.radians(30)), rel=1e-6)
    assert path_figure([result_of(puck)]) is None
    assert path_figure([result_of(cart, Told(force=8.0))]) is None  # on rails it goes nowhere else


def test_a_comparison_has_a_curve_for_every_controller(cart):
    results = [result_of(cart, Told(["place"], force=each)) for each in (0.5, 1.0)]
    figure = comparison_figure(results)
    axes = figure.axes[0]
    assert axes.get_ylabel() == "place [mm]"
    for line, result in zip(axes.lines, results, strict=True):
        np.testing.assert_allclose(line.get_ydata(), result.recording.channel("place")[:, 0] * 1e3)
    words = [text.get_text() for text in figure.findobj(Text)]
    assert any("told: ran to the end; told: ran to the end" in each for each in words)


def test_a_shorter_run_ends_its_curve_earlier(cart):
    short = result_of(cart, Told(["place"], force=9.0), until="place > 1 cm", duration_s=1.5)
    long = result_of(cart, Told(["place"], force=0.1), until="place > 1 m", duration_s=1.5)
    assert short.recording.ticks < long.recording.ticks
    first, second = comparison_figure([short, long]).axes[0].lines
    assert np.isnan(first.get_ydata()[short.recording.ticks :]).all()
    assert not np.isnan(second.get_ydata()).any()


@pytest.mark.filterwarnings("error")
def test_what_is_missing_all_the_time_is_drawn_as_it_truly_was(cart):
    result = result_of(cart, Told(["place"]), [Fault(channel="place", reading="missing")])
    read = np.full(result.recording.ticks, np.nan)
    np.testing.assert_array_equal(result.recording.observations[:, 0, 0], read)
    (line,) = result_figures(result, summarise(result))["channels"].axes[0].lines
    np.testing.assert_allclose(line.get_ydata(), 0.0, atol=1e-9)  # where the cart truly is
    assert shown_unit(read, parse_unit("m")) == (0.001, "mm")


@pytest.mark.parametrize(
    ("values", "unit", "shown"),
    [([0.01], "m", "mm"), ([3.0], "m", "m"), ([0.01], "cm", "cm"), ([2.0], "rad", "deg"), ([9.0], "N", "N")],
)
def test_values_are_shown_in_units_that_are_easy_to_read(values, unit, shown):
    assert shown_unit(np.array(values), parse_unit(unit))[1] == shown


def test_the_files_of_a_run_and_of_a_comparison(caught, puck, tmp_path):
    draw_result(caught, tmp_path / "one")
    push = Push(body="puck", force=4.0, direction="left", duration=0.2, start=0.0)
    gone = result_of(puck, Told(["y"]), disturbances=[push])
    draw_result(gone, tmp_path / "two")
    draw_comparison([gone, gone], tmp_path)
    found = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.png"))
    assert found == [
        "compare.png",
        "one/channels.png",
        "one/neurons.png",
        "path.png",
        "two/channels.png",
        "two/path.png",
    ]
    for name in found:
        with Image.open(tmp_path / name) as picture:
            assert min(picture.size) > 200


@pytest.mark.parametrize("ticks", [1, 2])
def test_a_run_that_was_stopped_at_once_is_drawn_as_far_as_it_got(caught, ticks, tmp_path):
    fields = ("readings", "qpos", "observations", "commands", "trace")
    parts = {name: getattr(caught.recording, name)[:ticks] for name in fields}
    result = dataclasses.replace(
        caught, recording=dataclasses.replace(caught.recording, interrupted=True, **parts)
    )
    draw_result(result, tmp_path)
    assert (tmp_path / "channels.png").exists() == (ticks > 1)


# --- recordings ---------------------------------------------------------------------------------------------


def test_columns_are_named_with_their_si_units(caught):
    columns = caught.recording.columns()
    expected = {
        "time_s", "push_n", "place_m", "speed_m_s", "angle_rad", "twice_m", "pull_n", "slide_m", "hinge_rad",
        "input_angle", "neuron_right", "neuron_left", "output_force", "input_missing",
        "held_force",
    }  # fmt: skip
    assert set(columns) == expected
    assert all(values.shape == (caught.recording.ticks,) for values in columns.values())
    np.testing.assert_array_equal(columns["twice_m"], 2 * columns["place_m"])
    assert np.isnan(columns["input_angle"]).sum() == columns["input_missing"].sum() == 5
    np.testing.assert_array_equal(columns["held_force"], columns["input_missing"])
    assert columns["push_n"].sum() * 0.01 == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("name", "unit", "column"),
    [
        ("eye left", "m", "eye_left_m"),
        ("turn", "deg", "turn_rad"),
        ("share", "1", "share"),
        ("a.b", "N*m", "a_b_n_m"),
    ],
)
def test_a_column_is_a_word(name, unit, column):
    assert column_name(name, parse_unit(unit)) == column
