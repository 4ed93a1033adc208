"""A run in MuJoCo's viewer."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from circuitkit.base.errors import CircuitkitError

if TYPE_CHECKING:
    from circuitkit.simulation.result import Result

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
    import mujoco.viewer

    from circuitkit.simulation.puppet import Puppet

    puppet = Puppet(result.recording)
    puppet.stand(0)
    try:
        window = mujoco.viewer.launch_passive(
            puppet.model, puppet.data, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # on macOS only the main thread may open windows
        message = f"the viewer does not start: {error}; or {_INSTEAD}"
        raise DisplayError(message) from error
    with window:
        replay(result, puppet, window)


def replay(
    result: Result,
    puppet: Any,  # noqa: ANN401 - a Puppet; its module loads MuJoCo
    window: Any,  # noqa: ANN401 - MuJoCo's handle is not typed
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], object] = time.sleep,
) -> None:
    """Show a run in a viewer until its window is closed.

    Args:
        result: The run.
        puppet: What the viewer shows.
        window: Handle of the viewer.
        clock: Time, [s].
        sleep: Waits for so long, [s].
    """
    from circuitkit.simulation.puppet import add_arrow
    from circuitkit.simulation.stage import place_camera
    from circuitkit.simulation.story import tell

    story = tell(result)
    start = clock()
    with window.lock():
        place_camera(window.cam, puppet.centre_m[0])
    while window.is_running():
        time_s = (clock() - start) % (story.time_s[-1] + _PAUSE_S)
        tick = min(int(time_s / story.step_s), len(story.time_s) - 1)
        with window.lock():
            puppet.stand(tick)
            puppet.data.time = story.time_s[tick]
            window.cam.lookat[:2] = puppet.centre_m[tick]
            window.user_scn.ngeom = 0
            for push in story.pushes:
                if push.shown_at(time_s):
                    add_arrow(window.user_scn, *puppet.arrow(push))
        window.sync()
        sleep(1.0 / _PICTURES_PER_S)


def _require_display() -> None:
    """Find out whether a window can be opened, for MuJoCo's viewer would wait for ever.

    Raises:
        DisplayError: It cannot.
    """
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not named:
        message = f"there is no display: neither DISPLAY nor WAYLAND_DISPLAY is set; {_INSTEAD}"
        raise DisplayError(message)
    if sys.platform == "darwin":  # there only mjpython may speak to the window system
        return
    import warnings

    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the message below says it better
        opened = glfw.init()
    if not opened:
        message = f"the display cannot be opened; {_INSTEAD}"
        raise DisplayError(message)
    glfw.terminate()  # the viewer starts it anew in its own thread
