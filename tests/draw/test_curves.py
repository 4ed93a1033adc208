"""Activation curves, and pictures over time."""

import numpy as np
import pytest

from circuitkit.base.errors import InputError
from circuitkit.circuit import load_circuit
from circuitkit.draw import draw_activations, draw_traces
from circuitkit.draw.activations import activations_figure, make_panels
from circuitkit.draw.traces import Activity, Band, Line, Panel, Span, _columns, traces_figure


@pytest.fixture(scope="module")
def binn():
    return load_circuit("binn_lateral")


def test_neurons_of_a_layer_share_axes_and_equal_ones_a_curve(binn):
    panels = make_panels(binn)
    assert [panel.title for panel in panels] == [
        "lf, bf, rf (inhibitory)",
        "q1, q2, q3, q4 (excitatory)",
        "h1, h2 (inhibitory)",
        "p1, p2 (excitatory)",
    ]
    assert [curve.text for curve in panels[1].curves] == [
        "q1, q4: slope 0.1 /mm, shift 79.9 mm",
        "q2, q3: slope 0.1 /mm, shift \N{MINUS SIGN}26.9 mm",
    ]


def test_the_curves_are_those_of_fig_6(binn):
    axes = activations_figure(binn).axes
    assert [each.get_xlabel() for each in axes] == [
        "activation A [1]",
        "activation A [mm]",
        "activation A [1]",
        "activation A [1]",
    ]
    line = axes[1].get_lines()[0]
    a, o = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    np.testing.assert_allclose(o, 1 / (1 + np.exp(-0.1 * (a - 79.9))), rtol=1e-9)
    assert np.isclose(a, 79.9).any()  # the half is on the grid
    steep = axes[0].get_lines()[0]
    rising = np.asarray(steep.get_ydata())
    assert ((rising > 0.05) & (rising < 0.95)).sum() > 20  # also where the slope is 500


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_curves_go_to_a_file(binn, tmp_path, suffix):
    draw_activations(binn, tmp_path / f"curves{suffix}")
    assert (tmp_path / f"curves{suffix}").stat().st_size > 1000


def test_curves_in_a_format_they_have_not(binn, tmp_path):
    with pytest.raises(InputError, match=r"found the suffix '.dot'; allowed: .png, .svg, .pdf"):
        draw_activations(binn, tmp_path / "curves.dot")


def test_panels_and_activity_share_their_time(tmp_path):
    time = np.arange(50) * 0.01
    figure = traces_figure(
        time,
        [
            Panel(
                "ZMP [mm]",
                [Line("ZMP", np.sin(time)), Line("edge", np.full(50, np.nan))],
                [Band("foot", -1, 1)],
            ),
            Panel("angle [deg]", [Line("", np.cos(time))]),
        ],
        Activity(["a", "b"], np.zeros((50, 2)), {"a": "inhibitory"}),
        [Span(0.1, 0.2, "push")],
    )
    assert [axes.get_ylabel() for axes in figure.axes] == ["ZMP [mm]", "angle [deg]", ""]
    assert all(axes.get_xlim() == (0.0, 0.49) for axes in figure.axes)
    assert [tick.get_text() for tick in figure.axes[2].get_yticklabels()] == ["a", "b"]
    draw_traces(tmp_path / "t.png", time, [Panel("x [1]", [Line("", time)])])
    assert (tmp_path / "t.png").exists()


def test_what_spans_say_stays_within_the_axes_and_apart():
    """Six spans that begin close to each other, the last one at the end."""
    time = np.arange(100) * 0.01
    texts = [f"sensor_{i} missing" for i in range(5)] + ["fell"]
    spans = [Span(0.7 + 0.02 * i, 0.9, text) for i, text in enumerate(texts[:-1])]
    spans.append(Span(0.97, 0.99, texts[-1], over=True))
    figure = traces_figure(time, [Panel("x [1]", [Line("x", time)])], None, spans, "a title")
    figure.draw_without_rendering()
    axes = figure.axes[0]
    words = [each for each in axes.texts if each.get_text() in texts]
    assert sorted(each.get_text() for each in words) == sorted(texts)
    boxes = [each.get_window_extent() for each in words]
    boxes.append(axes.get_legend().get_window_extent())
    assert all(box.x1 <= axes.bbox.x1 + 1 for box in boxes[:-1])
    assert not [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]
    assert max(box.y1 for box in boxes) < figure.texts[0].get_window_extent().y0


def test_what_came_after_the_end_is_hatched_and_what_befell_is_not():
    spans = [Span(0.1, 0.2, "push"), Span(0.4, 0.49, "fell", over=True)]
    figure = traces_figure(np.arange(50) * 0.01, [Panel("x [1]", [Line("", np.zeros(50))])], None, spans)
    befell, over = figure.axes[0].patches
    assert (befell.get_hatch(), over.get_hatch()) == (None, "////")
    assert befell.get_facecolor()[:3] != over.get_facecolor()[:3]


@pytest.mark.parametrize(
    ("values", "least", "ticks"),
    [
        (270 + 1e-4 * np.sin(np.arange(50)), 0.0, 2.7),
        (1e-6 * np.sin(np.arange(50)), 1.0, 1.0),
        (1e7 + np.arange(50), 0.0, 1e5),
        (np.arange(50.0), 1.0, 49.0),
    ],
)
def test_what_hardly_changes_does_not_fill_its_panel_and_ticks_are_whole_numbers(values, least, ticks):
    """A hundredth of the size, the least span, or what there is; nothing is to be added to the ticks."""
    panel = Panel("x [mm]", [Line("", values)], least_span=least)
    figure = traces_figure(np.arange(50) * 0.01, [panel])
    figure.draw_without_rendering()
    (axes,) = figure.axes
    low, high = axes.get_ylim()
    assert ticks * 0.999 <= high - low <= ticks * 1.2
    assert low <= values.min() <= values.max() <= high
    assert axes.yaxis.get_offset_text().get_text() == ""
    places = [each for each in axes.get_yticks() if low <= each <= high]
    shown = [each.get_text() for each in axes.get_yticklabels()]
    shown = [text for text, place in zip(shown, axes.get_yticks(), strict=True) if place in places]
    assert len(set(shown)) == len(places) > 1
    found = [float(text.replace("\N{MINUS SIGN}", "-")) for text in shown]
    np.testing.assert_allclose(found, places, rtol=1e-5, atol=1e-9)


def test_a_short_peak_survives_the_thinning_of_a_long_raster():
    outputs = np.zeros((100_001, 1))
    outputs[77_777] = 1.0
    edges, shown = _columns(np.arange(100_001) * 0.002, outputs)
    assert len(shown) <= 4000
    assert len(edges) == len(shown) + 1
    assert shown.max() == 1.0


def test_curves_that_are_not_as_long_as_the_time_are_named(tmp_path):
    with pytest.raises(InputError) as error:
        draw_traces(tmp_path / "t.png", np.arange(5), [Panel("x", [Line("speed", np.zeros(4))])])
    assert str(error.value) == "speed: found shape (4,); allowed: (5,), as the time, or a number"
    with pytest.raises(InputError) as error:
        draw_traces(tmp_path / "t.png", np.arange(5), activity=Activity(["a"], np.zeros((5, 2))))
    assert str(error.value) == (
        "activity: found shape (5, 2); allowed: (5, 1), a row a time and a column a neuron"
    )


def test_nothing_to_show_is_a_picture_too(tmp_path):
    draw_traces(tmp_path / "t.svg", [], [Panel("x [1]", [Line("x", [])])], Activity([], np.zeros((0, 0))))
    assert (tmp_path / "t.svg").exists()
