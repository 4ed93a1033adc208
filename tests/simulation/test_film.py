"""Films and the viewer; those that need a renderer say so where there is none."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest
from walking import a_push, nao_body, scenario, walk_alone

from circuitkit import parse_circuit
from circuitkit.base.errors import MissingDependencyError
from circuitkit.simulation import make_plan
from circuitkit.simulation import renderer as renderers
from circuitkit.simulation.film import FRAMES_PER_S, SCENE_HEIGHT, Reel, film, frame_count
from circuitkit.simulation.panel import Panel, _value_font, chart_of
from circuitkit.simulation.renderer import RendererError
from circuitkit.simulation.result import PushSpan, Result, summarise
from circuitkit.simulation.scene import ReplayModel, film_model
from circuitkit.simulation.viewer import DisplayError, replay, watch

LEFTWARD = np.array([0.0, 1.0, 0.0])


def span(body, start_s, end_s, force):
    return PushSpan(body, start_s, end_s, force, np.zeros(3))


def run(controller, force):
    """A short walk with a push to the right in its second step."""
    push = a_push(force=force, direction="right", step=1)
    plan = make_plan(scenario("gait_walk_2cm", [push], duration=3.2))
    recording = walk_alone(plan, controller)
    return Result(plan.scenario, recording, recording.measures[0])


def cut(result, begin_s, end_s):
    """A part of a run; its clock starts anew, and it has no push any more."""
    rows = slice(round(begin_s * 100), round(end_s * 100))
    fields = ("readings", "qpos", "observations", "commands", "trace")
    parts = {name: getattr(result.recording, name)[rows] for name in fields}
    effects = dataclasses.replace(result.recording.effects, forces=[])
    recording = dataclasses.replace(result.recording, effects=effects, end_tick=np.array([-1]), **parts)
    return dataclasses.replace(result, recording=recording)


@pytest.fixture(scope="module")
def pushed():
    return run("circuit", 9.0)


@pytest.fixture(scope="module")
def fallen():
    return run("open_loop", 80.0)


@pytest.fixture(scope="module")
def renderer():
    """Skips where nothing can be drawn; what then happens is tested below without a renderer."""
    try:
        return renderers.graphics_library()
    except RendererError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def frames(renderer, pushed):  # noqa: ARG001 - skips without one
    """Pictures before, during and after the push."""
    start, end = pushed.recording.effects.windows_s[0]
    reel = Reel(pushed)
    moments = {"before": start - 0.1, "during": (start + end) / 2, "after": end + 0.1}
    pictures = {name: np.asarray(reel.frame(round(time * FRAMES_PER_S))) for name, time in moments.items()}
    reel.close()
    return pictures


def decoded(path, size):
    """Frames of a film of a size, and what ffmpeg says about it."""
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    command = [ffmpeg, "-hide_banner", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    pictures = np.frombuffer(done.stdout, np.uint8).reshape(-1, size[1], size[0], 3)
    return done.stderr.decode(errors="replace"), pictures


def arrow_pixels(picture):
    """Pure red in the upper part, where the robot is; nothing else of the scene has this colour."""
    red, green, blue = np.moveaxis(picture[:SCENE_HEIGHT].astype(int), -1, 0)
    return int(((red > 170) & (green < 60) & (blue < 60)).sum())


def test_the_arrow_is_there_during_the_push_only(frames):
    assert arrow_pixels(frames["during"]) > 300
    assert arrow_pixels(frames["before"]) == 0
    assert arrow_pixels(frames["after"]) == 0


def test_a_push_to_the_right_comes_from_the_robots_left_which_is_on_the_right_of_the_picture(frames):
    picture = frames["during"][:SCENE_HEIGHT].astype(int)
    columns = np.flatnonzero(((picture[..., 0] > 170) & (picture[..., 1:].max(axis=-1) < 60)).any(axis=0))
    assert columns.min() > picture.shape[1] / 2


def test_the_robot_stands_in_the_picture_and_moves(frames):
    spread = frames["before"][:SCENE_HEIGHT].std(axis=(0, 1)).min()
    assert spread > 20  # not one colour
    assert np.abs(frames["before"].astype(int) - frames["after"]).mean() > 1


@pytest.mark.parametrize("force_n", [10.0, 40.0])
def test_the_arrow_points_along_the_force_and_ends_at_the_robot(pushed, force_n):
    """It is nearly half as long as the robot is large, whatever the force, which stands beside it."""
    model = ReplayModel(pushed.recording)
    model.stand(100)
    tail, tip = model.arrow(span(nao_body().torso_id, 1.0, 1.2, -force_n * LEFTWARD))
    np.testing.assert_allclose(tip - tail, -0.45 * model.size_m * LEFTWARD, atol=1e-12)
    assert 0.5 < model.size_m < 1.2
    centre = model.data.body(nao_body().block.torso).xipos
    np.testing.assert_allclose(tip[[0, 2]], centre[[0, 2]])
    assert 0.05 < tip[1] - centre[1] < 0.2  # on the arm or the side of the body


def test_an_arrow_ends_where_the_push_acts(pushed):
    model = ReplayModel(pushed.recording)
    model.stand(100)
    high = PushSpan(nao_body().torso_id, 1.0, 1.2, -LEFTWARD, np.array([0.0, 0.0, 0.05]))
    tips = [model.arrow(push)[1] for push in (span(nao_body().torso_id, 1.0, 1.2, -LEFTWARD), high)]
    assert tips[1][2] - tips[0][2] == pytest.approx(0.05)


def test_a_short_push_is_shown_long_enough_to_be_seen():
    short = span(1, 2.0, 2.05, LEFTWARD)
    assert [short.shown_at(time) for time in (1.99, 2.0, 2.19, 2.21)] == [False, True, True, False]
    longer = span(1, 2.0, 2.4, LEFTWARD)
    assert longer.shown_at(2.39)
    assert not longer.shown_at(2.4)


def test_the_model_takes_the_recorded_poses(pushed):
    """Forward kinematics of the film's model gives the ankles where the run's own sensors saw them."""
    recording = pushed.recording
    model = ReplayModel(recording)
    for tick in (0, 57, 200):
        model.stand(tick)
        for side, foot in enumerate((nao_body().block.feet.left, nao_body().block.feet.right)):
            seen = recording.readings[tick, 0, nao_body().layout.foot(side)]
            # Sensors are read before the last of the tick's time steps, positions after it.
            np.testing.assert_allclose(model.data.body(foot.body).xpos, seen, atol=5e-3)


def test_the_films_model_has_the_joints_of_the_robot_and_all_its_looks(pushed):
    robot = pushed.recording.robot
    model = film_model(robot)
    assert model.nq == robot.model.nq
    assert [model.joint(i).name for i in range(model.njnt)] == [
        robot.model.joint(i).name for i in range(model.njnt)
    ]
    assert model.nmesh > 0
    assert model.nlight == 1


def test_a_fallen_robot_is_not_shown_inside_the_ground(fallen):
    """Only its soles touch the ground, so that it sinks in; the picture stops before."""
    recording, model = fallen.recording, ReplayModel(fallen.recording)
    fall = int(recording.end_tick[0])
    last = model.last_above_ground(fall)
    assert fall <= last < recording.ticks - 1
    heights = []
    for tick in (last, recording.ticks - 1):
        model.stand(tick)
        heights.append(model.data.body(nao_body().block.torso).xpos[2])
    assert heights[0] > 0.03
    assert heights[1] < 0


def test_an_arrow_points_at_a_point_of_the_body_however_it_stands(pushed):
    """The line of the arrow passes through the point, which may lie along the world's axes or the body's."""
    recording = pushed.recording
    replayed = ReplayModel(recording)
    replayed.stand(100)
    bodies = range(1, recording.robot.model.nbody)
    number = max(bodies, key=lambda i: abs(replayed.data.xmat[i][0] - 1))  # the one that is turned most
    turned = replayed.data.xmat[number].reshape(3, 3)
    assert np.abs(turned - np.eye(3)).max() > 0.3
    point = np.array([0.01, 0.0, 0.02])
    for turns, where in ((False, point), (True, turned @ point)):
        tail, tip = replayed.arrow(PushSpan(number, 0.0, 1.0, LEFTWARD, point, turns))
        beside = tip - replayed.data.xipos[number] - where
        np.testing.assert_allclose(np.cross(beside, LEFTWARD), 0, atol=1e-12)
        np.testing.assert_allclose(np.cross(tip - tail, LEFTWARD), 0, atol=1e-12)


def test_a_robot_that_stays_above_the_ground_is_shown_to_the_end(pushed):
    assert ReplayModel(pushed.recording).last_above_ground(100) == pushed.recording.ticks - 1


def test_active_neurons_light_up(pushed):
    def panel(activity):
        recording = dataclasses.replace(
            pushed.recording, trace=np.full_like(pushed.recording.trace, activity)
        )
        result = dataclasses.replace(pushed, recording=recording)
        return np.asarray(Panel(result, summarise(result)).picture(150)).astype(int)

    def coloured(picture):
        return int((picture.max(axis=-1) - picture.min(axis=-1) > 100)[:, :420].sum())

    quiet, half, active = (coloured(panel(activity)) for activity in (0.0, 0.5, 1.0))
    assert active > 4 * quiet
    assert quiet <= half < active


def test_the_panel_works_without_a_circuit_and_with_readings_that_are_missing(pushed, fallen):
    assert np.asarray(Panel(fallen, summarise(fallen)).picture(10)).shape == (200, 640, 3)
    observations = np.full_like(pushed.recording.observations, np.nan)
    result = dataclasses.replace(
        pushed, recording=dataclasses.replace(pushed.recording, observations=observations)
    )
    assert np.asarray(Panel(result, summarise(result)).picture(10)).shape == (200, 640, 3)


LARGE = """
circuit: large
control_step: 10 ms
timing: ordered
inputs: {gyro_x: {unit: rad/s, range: [-5 rad/s, 5 rad/s]}}
neurons:
NEURONS
populations:
  ring: {size: 4, model: sigmoid, role: inhibitory, slope: 10 s/rad, shift: 1 rad/s}
synapses:
SYNAPSES
outputs: {ankle_roll: {unit: deg, readout: {n0: 1 deg}}}
"""


def large_circuit(size):
    """A chain of neurons, which is too long for a drawing that one can read."""
    neuron = "{model: sigmoid, role: excitatory, slope: 10 s/rad, shift: 1 rad/s}"
    neurons = [f"  n{i}: {neuron}" for i in range(size)]
    synapses = ["  - {from: gyro_x, to: n0, weight: 1}"]
    synapses += [f"  - {{from: n{i}, to: n{i + 1}, weight: 1 rad/s}}" for i in range(size - 1)]
    text = LARGE.replace("NEURONS", "\n".join(neurons)).replace("SYNAPSES", "\n".join(synapses))
    return parse_circuit(text)


def test_a_circuit_too_large_to_be_read_is_shown_as_cells(pushed):
    """Of 26 neurons and a population 13 stand in each of three columns, and one cell is lit by its own."""
    graph = large_circuit(26)
    names = tuple([f"n{i}" for i in range(26)] + [f"ring[{i}]" for i in range(4)])

    def picture(**active):
        trace = np.zeros((*pushed.recording.trace.shape[:2], len(names)))
        for name, value in active.items():
            trace[..., names.index(name.replace("_", "[") + "]" * ("_" in name))] = value
        recording = dataclasses.replace(pushed.recording, circuit=graph, trace=trace, trace_names=names)
        result = dataclasses.replace(pushed, recording=recording)
        return np.asarray(Panel(result, summarise(result)).picture(150)).astype(int)

    def lit(**active):
        """Where the picture differs from the one at rest: columns and rows, in pixels."""
        rows, columns = np.nonzero(np.abs(picture(**active) - picture()).max(axis=-1) > 40)
        return columns.min(), columns.max(), rows.min(), rows.max()

    wide, high = 404 / 3, 12.4
    for name, column, row in (("n0", 0, 0), ("n12", 0, 12), ("n13", 1, 0)):
        left, top = 8 + column * wide, 24 + row * high
        found = lit(**{name: 1.0})
        np.testing.assert_allclose(found, (left, left + wide - 2, top, top + high), atol=2.5)
    left, right, _, _ = lit(ring_2=1.0)  # the third of four stripes
    np.testing.assert_allclose((left, right), 8 + 2 * wide + np.array([0.5, 0.75]) * (wide - 2), atol=2.5)


def test_runs_side_by_side_show_the_same_channels_on_the_same_axes(pushed, fallen, monkeypatch, tmp_path):
    """Open loop reads and commands nothing, and shows what the circuit beside it reads and commands."""
    chart = chart_of([fallen, pushed])
    assert [row.name for row in chart] == ["force_difference", "zmp_y", "ankle_roll"]
    zmp = np.concatenate([result.recording.channel("zmp_y")[:, 0] for result in (fallen, pushed)])
    assert chart[1].low < zmp.min() < zmp.max() < chart[1].high
    assert chart_of([pushed, fallen]) == chart
    given = []

    def reel(*arguments):
        given.append(arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr("circuitkit.simulation.film.Reel", reel)
    with pytest.raises(KeyboardInterrupt):
        film([fallen, pushed], tmp_path / "film.mp4")
    assert given == [(fallen, 1, chart)]
    picture = Panel(fallen, summarise(fallen), chart=chart).picture(150)
    assert np.asarray(picture).shape == (200, 640, 3)


def test_values_of_inputs_touch_no_box(pushed):
    """They keep two pixels from the box above and from the one below."""
    panel = Panel(pushed, summarise(pushed))
    boxes = panel._lit.boxes
    assert set(panel._places) == set(boxes) == {"force_difference", "zmp_y", "ankle_roll"}
    for name, (_, y) in panel._places.items():
        _, above, _, below = _value_font().getbbox("\N{MINUS SIGN}0.98", anchor="mm")
        top, bottom = y + above / 2, y + below / 2  # it is drawn at twice the size
        x0, _, x1, _ = boxes[name]
        for left, upper, right, lower in boxes.values():
            if left < x1 and right > x0:
                offset = panel._at[1]
                assert bottom + 2 <= (offset + upper) / 2 or top - 2 >= (offset + lower) / 2, name


def test_whatever_has_a_beginning_and_an_end_is_marked_in_the_chart(pushed):
    """A fault as a push is, while it lasts and as long as it is in the picture."""

    def marked(spans, tick):
        effects = dataclasses.replace(pushed.recording.effects, forces=[], spans=spans)
        recording = dataclasses.replace(pushed.recording, effects=effects)
        result = dataclasses.replace(pushed, recording=recording)
        picture = np.asarray(Panel(result, summarise(result)).picture(tick))[:, 432:631]
        return int((np.abs(picture.astype(int) - (0xF8, 0xE3, 0xB0)).max(axis=-1) < 8).any(axis=0).sum())

    dead = [("LFsrFL missing", 1.0, 1.4)]
    assert marked([], 150) == 0
    assert marked(dead, 95) == 0
    assert marked(dead, 120) == pytest.approx(0.2 / 2 * 198, abs=3)  # the chart shows 2 s on 198 pixels
    assert marked(dead, 200) == pytest.approx(0.4 / 2 * 198, abs=3)


@pytest.mark.usefixtures("renderer")
def test_a_film_is_in_real_time(pushed, tmp_path):
    short = cut(pushed, 1.0, 1.44)
    path = film([short], tmp_path / "film.mp4")
    facts, pictures = decoded(path, (640, 640))
    assert " 640x640" in facts
    assert f" {FRAMES_PER_S} fps" in facts
    assert len(pictures) == frame_count(short) == 11  # 0.44 s


@pytest.mark.usefixtures("renderer")
def test_side_by_side_the_shorter_film_waits_in_grey(pushed, fallen, tmp_path):
    path = film([cut(fallen, 0.0, 0.2), cut(pushed, 0.0, 0.4)], tmp_path / "both.mp4")
    facts, pictures = decoded(path, (2 * 640 + 4, 640))
    assert " 1284x640" in facts
    assert len(pictures) == 10

    def colour(picture):
        return float((picture.max(axis=-1).astype(int) - picture.min(axis=-1)).mean())

    left, right = pictures[-1][:, :636], pictures[-1][:, 648:]
    assert colour(pictures[0][:, :636]) > 5
    assert colour(right) > 5
    assert colour(left) < 2
    still = np.abs(pictures[-1][:, :636].astype(int) - pictures[-2][:, :636]).mean()
    assert still < 1


def test_without_the_encoder_the_message_names_the_extra(monkeypatch, pushed, tmp_path):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingDependencyError) as caught:
        film([pushed], tmp_path / "film.mp4")
    assert str(caught.value) == (
        "writing a video needs the package 'imageio-ffmpeg', which is not installed; "
        "install it with: pip install 'neurocircuitkit[video]'"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def graphics(monkeypatch):
    """A system on which a set of graphics libraries works."""

    def works(names, wanted=None):
        monkeypatch.setattr(renderers, "_try", lambda name: None if name in names else "not installed")
        monkeypatch.setattr(renderers.sys, "platform", "linux")
        monkeypatch.delenv("MUJOCO_GL", raising=False)
        if wanted is not None:
            monkeypatch.setenv("MUJOCO_GL", wanted)
        renderers.graphics_library.cache_clear()

    yield works
    renderers.graphics_library.cache_clear()


def test_without_a_renderer_the_message_names_the_missing_package(graphics, pushed, tmp_path):
    graphics(set())
    with pytest.raises(RendererError) as caught:
        film([pushed], tmp_path / "film.mp4")
    assert str(caught.value) == (
        "found no off-screen renderer (egl: not installed; osmesa: not installed); install the system "
        "package that brings one (no graphics card is needed): on Debian or Ubuntu "
        "`apt install libegl1 libgl1`, "
        "on Fedora `dnf install mesa-libEGL mesa-libGL`"
    )
    assert caught.value.exit_code == 3
    assert list(tmp_path.iterdir()) == []


def test_the_first_library_that_works_is_taken_and_a_wanted_one_is_obeyed(graphics):
    graphics({"egl", "osmesa"})
    assert renderers.graphics_library() == "egl"
    graphics({"osmesa"})
    assert renderers.graphics_library() == "osmesa"
    graphics({"egl", "osmesa"}, wanted="OSMesa")
    assert renderers.graphics_library() == "osmesa"


def test_a_wanted_library_that_does_not_work_is_named_with_its_package(graphics):
    graphics({"egl"}, wanted="osmesa")
    with pytest.raises(RendererError) as caught:
        renderers.graphics_library()
    assert str(caught.value) == (
        "found no off-screen renderer (osmesa: not installed); install the system package that brings one "
        "(no graphics card is needed): on Debian or Ubuntu `apt install libosmesa6`, on Fedora "
        "`dnf install mesa-compat-libOSMesa`, or unset MUJOCO_GL, which asks for osmesa alone"
    )


def test_a_library_that_nobody_knows_is_refused(graphics):
    graphics({"egl"}, wanted="vulkan")
    with pytest.raises(RendererError) as caught:
        renderers.graphics_library()
    assert str(caught.value) == (
        "no off-screen renderer: MUJOCO_GL is 'vulkan'; allowed: egl, osmesa, glfw, glx, or unset to search"
    )


def test_watching_needs_a_display(monkeypatch, pushed):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(DisplayError) as caught:
        watch(pushed)
    assert str(caught.value) == (
        "there is no display: neither DISPLAY nor WAYLAND_DISPLAY is set; film it instead: -o DIR --video"
    )


def test_the_viewer_replays_in_real_time_again_and_again(pushed):
    """A window that is closed after some pictures, and a clock that jumps."""
    model = ReplayModel(pushed.recording)
    start, end = pushed.recording.effects.windows_s[0]
    duration = pushed.recording.time_s[-1]
    moments = iter([0.0, 0.5, (start + end) / 2, duration + 0.5, duration + 1.0 + 0.25])
    seen = []
    scene = mujoco.MjvScene(model.model, maxgeom=100)
    window = SimpleNamespace(
        cam=mujoco.MjvCamera(),
        user_scn=scene,
        lock=nullcontext,
        is_running=lambda: len(seen) < 4,
        sync=lambda: seen.append((round(model.data.time * 100), scene.ngeom)),
    )
    replay(pushed, model, window, clock=lambda: next(moments), sleep=lambda _: None)
    shown = [tick for tick, _ in seen]
    assert shown == [51, round((start + end) / 2 * 100 + 0.5), pushed.recording.ticks, 26]
    assert [geoms > 0 for _, geoms in seen] == [False, True, False, False]
