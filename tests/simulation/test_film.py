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

from circuitkit.base.errors import MissingDependencyError
from circuitkit.simulation import screen
from circuitkit.simulation.disturbance import Trial
from circuitkit.simulation.loop import run_loop
from circuitkit.simulation.panel import Panel
from circuitkit.simulation.puppet import Puppet, film_model
from circuitkit.simulation.run import Result, make_plan
from circuitkit.simulation.scenario import Push, Start, load_scenario
from circuitkit.simulation.screen import RendererError
from circuitkit.simulation.story import PushSpan, tell
from circuitkit.biped.thresholds import judge
from circuitkit.simulation.video import FRAMES_PER_S, SCENE_HEIGHT, Reel, film, film_side_by_side, frame_count
from circuitkit.simulation.watch import DisplayError, replay, watch

LEFTWARD = np.array([0.0, 1.0, 0.0])


def run(controller, force):
    """A short walk with a push to the right in its second step."""
    start = Start(step=1, phase="lift", at="40 %")
    push = Push(body="torso", force=force, direction="right", duration="200 ms", start=start)
    scenario = load_scenario("nao_push").model_copy(update={"duration": 3.2, "pushes": (push,)})
    plan = make_plan(scenario)
    recording = run_loop(plan.setup(controller, [Trial(0, scenario.pushes)]))
    return Result(scenario, push, recording, judge(recording, scenario.thresholds), None)


def cut(result, begin_s, end_s):
    """A part of a run; its clock starts anew, and it has no push any more."""
    rows = slice(round(begin_s * 100), round(end_s * 100))
    fields = ("readings", "qpos", "observations", "commands", "trace")
    parts = {name: getattr(result.recording, name)[rows] for name in fields}
    fates = dataclasses.replace(result.recording.fates, pushes=())
    recording = dataclasses.replace(result.recording, fates=fates, **parts)
    return dataclasses.replace(
        result, recording=recording, verdict=judge(recording, result.scenario.thresholds)
    )


@pytest.fixture(scope="module")
def pushed():
    return run("circuit", "20 N")


@pytest.fixture(scope="module")
def fallen():
    return run("open_loop", "80 N")


@pytest.fixture(scope="module")
def renderer():
    """Skips where nothing can be drawn; what then happens is tested below without a renderer."""
    try:
        return screen.graphics_library()
    except RendererError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def frames(renderer, pushed):  # noqa: ARG001 - skips without one
    """Pictures before, during and after the push."""
    start, end = pushed.recording.fates.windows_s[0]
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


@pytest.mark.parametrize("force_n", [10.0, 20.0, 40.0])
def test_the_arrow_is_as_long_as_the_force_is_large_and_ends_at_the_robot(pushed, force_n):
    puppet = Puppet(pushed.recording)
    puppet.stand(100)
    span = PushSpan(pushed.recording.robot.torso_id, 1.0, 1.2, -force_n * LEFTWARD)
    tail, tip = puppet.arrow(span)
    np.testing.assert_allclose(tip - tail, -0.011 * force_n * LEFTWARD, atol=1e-12)
    centre = puppet.data.body(pushed.recording.robot.spec.torso).xipos
    np.testing.assert_allclose(tip[[0, 2]], centre[[0, 2]])
    assert 0.05 < tip[1] - centre[1] < 0.2  # on the arm or the side of the body


def test_a_short_push_is_shown_long_enough_to_be_seen():
    span = PushSpan(1, 2.0, 2.05, LEFTWARD)
    assert [span.shown_at(time) for time in (1.99, 2.0, 2.19, 2.21)] == [False, True, True, False]
    longer = PushSpan(1, 2.0, 2.4, LEFTWARD)
    assert longer.shown_at(2.39)
    assert not longer.shown_at(2.4)


def test_the_puppet_takes_the_recorded_poses(pushed):
    """Forward kinematics of the film's model gives the ankles where the run's own sensors saw them."""
    recording = pushed.recording
    puppet = Puppet(recording)
    for tick in (0, 57, 200):
        puppet.stand(tick)
        for side, foot in enumerate((recording.robot.spec.feet.left, recording.robot.spec.feet.right)):
            seen = recording.readings[tick, 0, recording.robot.layout.foot(side)]
            # Sensors are read before the last of the tick's time steps, positions after it.
            np.testing.assert_allclose(puppet.data.body(foot.body).xpos, seen, atol=5e-3)


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
    puppet = Puppet(fallen.recording)
    fall = round(fallen.verdict.time_of_fall_s * 100)
    last = puppet.last_above_ground(fall)
    assert fall - 1 <= last < fallen.recording.ticks
    puppet.stand(last)
    torso = fallen.recording.robot.spec.torso
    assert puppet.data.body(torso).xpos[2] > 0.03


def test_active_neurons_light_up(pushed):
    def panel(activity):
        recording = dataclasses.replace(
            pushed.recording, trace=np.full_like(pushed.recording.trace, activity)
        )
        result = dataclasses.replace(pushed, recording=recording)
        return np.asarray(Panel(result, tell(result)).picture(150)).astype(int)

    def coloured(picture):
        return int((picture.max(axis=-1) - picture.min(axis=-1) > 100)[:, :420].sum())

    quiet, half, active = (coloured(panel(activity)) for activity in (0.0, 0.5, 1.0))
    assert active > 4 * quiet
    assert quiet <= half < active


def test_the_panel_works_without_a_circuit_and_with_readings_that_are_missing(pushed, fallen):
    assert np.asarray(Panel(fallen, tell(fallen)).picture(10)).shape == (200, 640, 3)
    observations = np.full_like(pushed.recording.observations, np.nan)
    result = dataclasses.replace(
        pushed, recording=dataclasses.replace(pushed.recording, observations=observations)
    )
    assert np.asarray(Panel(result, tell(result)).picture(10)).shape == (200, 640, 3)


@pytest.mark.usefixtures("renderer")
def test_a_film_is_in_real_time(pushed, tmp_path):
    short = cut(pushed, 1.0, 1.44)
    path = film(short, tmp_path / "film.mp4")
    facts, pictures = decoded(path, (640, 640))
    assert " 640x640" in facts
    assert f" {FRAMES_PER_S} fps" in facts
    assert len(pictures) == frame_count(short) == 11  # 0.44 s


@pytest.mark.usefixtures("renderer")
def test_side_by_side_the_shorter_film_waits_in_grey(pushed, fallen, tmp_path):
    path = film_side_by_side([cut(fallen, 0.0, 0.2), cut(pushed, 0.0, 0.4)], tmp_path / "both.mp4")
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
        film(pushed, tmp_path / "film.mp4")
    assert str(caught.value) == (
        "writing a video needs the package 'imageio-ffmpeg', which is not installed; "
        "install it with: pip install 'neurocircuitkit[video]'"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def graphics(monkeypatch):
    """A system on which a set of graphics libraries works."""

    def works(names, wanted=None):
        monkeypatch.setattr(screen, "_try", lambda name: None if name in names else "not installed")
        monkeypatch.setattr(screen.sys, "platform", "linux")
        monkeypatch.delenv("MUJOCO_GL", raising=False)
        if wanted is not None:
            monkeypatch.setenv("MUJOCO_GL", wanted)
        screen.graphics_library.cache_clear()

    yield works
    screen.graphics_library.cache_clear()


def test_without_a_renderer_the_message_names_the_missing_package(graphics, pushed, tmp_path):
    graphics(set())
    with pytest.raises(RendererError) as caught:
        film(pushed, tmp_path / "film.mp4")
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
    assert screen.graphics_library() == "egl"
    graphics({"osmesa"})
    assert screen.graphics_library() == "osmesa"
    graphics({"egl", "osmesa"}, wanted="OSMesa")
    assert screen.graphics_library() == "osmesa"


def test_a_wanted_library_that_does_not_work_is_named_with_its_package(graphics):
    graphics({"egl"}, wanted="osmesa")
    with pytest.raises(RendererError) as caught:
        screen.graphics_library()
    assert str(caught.value) == (
        "found no off-screen renderer (osmesa: not installed); install the system package that brings one "
        "(no graphics card is needed): on Debian or Ubuntu `apt install libosmesa6`, on Fedora "
        "`dnf install mesa-compat-libOSMesa`, or unset MUJOCO_GL, which asks for osmesa alone"
    )


def test_a_library_that_nobody_knows_is_refused(graphics):
    graphics({"egl"}, wanted="vulkan")
    with pytest.raises(RendererError) as caught:
        screen.graphics_library()
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
    puppet = Puppet(pushed.recording)
    start, end = pushed.recording.fates.windows_s[0]
    duration = pushed.recording.time_s[-1]
    moments = iter([0.0, 0.5, (start + end) / 2, duration + 0.5, duration + 1.0 + 0.25])
    seen = []
    scene = mujoco.MjvScene(puppet.model, maxgeom=100)
    window = SimpleNamespace(
        cam=mujoco.MjvCamera(),
        user_scn=scene,
        lock=nullcontext,
        is_running=lambda: len(seen) < 4,
        sync=lambda: seen.append((round(puppet.data.time * 100), scene.ngeom)),
    )
    replay(pushed, puppet, window, clock=lambda: next(moments), sleep=lambda _: None)
    shown = [tick for tick, _ in seen]
    assert shown == [51, round((start + end) / 2 * 100 + 0.5), pushed.recording.ticks, 26]
    assert [geoms > 0 for _, geoms in seen] == [False, True, False, False]
