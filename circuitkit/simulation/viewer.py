"""A run in MuJoCo's viewer."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.reading import environment
from circuitkit.simulation.result import Result, summarise
from circuitkit.simulation.scene import ReplayModel, add_arrow, place_camera

_PICTURES_PER_S = 60.0
_PAUSE_S = 1.0  # before it begins anew
_INSTEAD = "film it instead: -o DIR --video"


class DisplayError(CircuitkitError):
    """There is no window to show the robot in."""


def watch(result: Result) -> None:
    """Replay a run in MuJoCo's viewer in real time, again and again until its window is closed.

    Raises:
        DisplayError: There is no display.
    """
    if result.recording.ticks == 0:
        return
    _require_display()
    import mujoco.viewer  # opens the window system

    replayed = ReplayModel(result.recording)
    replayed.stand(0)
    try:
        window = mujoco.viewer.launch_passive(
            replayed.model, replayed.data, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # on macOS only the main thread may open windows
        message = f"the viewer does not start: {error}; or {_INSTEAD}"
        raise DisplayError(message) from error
    with window:
        replay(result, replayed, window)


def replay(
    result: Result,
    replayed: ReplayModel,
    window: Any,  # noqa: ANN401 - MuJoCo's handle is not typed
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], object] = time.sleep,
) -> None:
    """Show a run in a viewer until its window is closed.

    Args:
        result: The run.
        replayed: What the viewer shows.
        window: Handle of the viewer.
        clock: Time, [s].
        sleep: Waits for so long, [s].
    """
    summary = summarise(result)
    start = clock()
    with window.lock():
        place_camera(window.cam, replayed, 0)
    while window.is_running():
        time_s = (clock() - start) % (summary.time_s[-1] + _PAUSE_S)
        tick = min(int(time_s / summary.step_s), len(summary.time_s) - 1)
        with window.lock():
            replayed.stand(tick)
            replayed.data.time = summary.time_s[tick]
            window.cam.lookat[:] = replayed.centre_m[tick]
            window.user_scn.ngeom = 0
            for push in summary.pushes:
                if push.shown_at(time_s):
                    add_arrow(window.user_scn, *replayed.arrow(push))
        window.sync()
        sleep(1.0 / _PICTURES_PER_S)


def _require_display() -> None:
    """Find out whether a window can be opened, for MuJoCo's viewer would wait for ever.

    Raises:
        DisplayError: It cannot.
    """
    named = environment("DISPLAY") or environment("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not named:
        message = f"there is no display: neither DISPLAY nor WAYLAND_DISPLAY is set; {_INSTEAD}"
        raise DisplayError(message)
    if sys.platform == "darwin":  # there only mjpython may speak to the window system
        return
    import glfw  # opens the window system

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the message below says it better
        opened = glfw.init()
    if not opened:
        message = f"the display cannot be opened; {_INSTEAD}"
        raise DisplayError(message)
    glfw.terminate()  # the viewer starts it anew in its own thread
