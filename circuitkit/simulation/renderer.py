"""Off-screen pictures by MuJoCo's renderer, and the search for a graphics library that can make them."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from functools import lru_cache
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.reading import environment

Image = NDArray[np.uint8]

_VARIABLE = "MUJOCO_GL"
_MODULES = {"egl": "mujoco.egl", "osmesa": "mujoco.osmesa", "glfw": "mujoco.glfw", "glx": "mujoco.glfw"}
_SEARCHED = ("egl", "osmesa")  # of those that need no window system
_PACKAGES = {
    "egl": "on Debian or Ubuntu `apt install libegl1 libgl1`, on Fedora `dnf install mesa-libEGL mesa-libGL`",
    "osmesa": "on Debian or Ubuntu `apt install libosmesa6`, on Fedora `dnf install mesa-compat-libOSMesa`",
}
_PROBE = """
import importlib, sys, mujoco
context = importlib.import_module(sys.argv[1]).GLContext(8, 8)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""
_PROBE_LIMIT_S = 60.0
_MOST_GEOMS = 2000


class RendererError(CircuitkitError):
    """No off-screen renderer works here; the message names the missing system package."""


@lru_cache(maxsize=1)
def graphics_library() -> str:
    """The graphics library to draw with: that of the variable MUJOCO_GL, or the first one that works.

    Each is tried in a process of its own, for a library that is tried in this one would shut out the next.

    Returns:
        A value of MUJOCO_GL; empty where MuJoCo chooses by itself, on macOS and Windows.

    Raises:
        RendererError: None works.
    """
    wanted = environment(_VARIABLE).lower()
    if not sys.platform.startswith("linux"):
        return wanted
    if wanted and wanted not in _MODULES:
        allowed = ", ".join(_MODULES)
        message = f"no off-screen renderer: {_VARIABLE} is '{wanted}'; allowed: {allowed}, or unset to search"
        raise RendererError(message)
    failures = {}
    for name in (wanted,) if wanted else _SEARCHED:
        complaint = _try(name)
        if complaint is None:
            return name
        failures[name] = complaint
    raise RendererError(_nothing_works(failures, wanted))


def _nothing_works(failures: dict[str, str], wanted: str) -> str:
    found = "; ".join(f"{name}: {complaint}" for name, complaint in failures.items())
    remedy = _PACKAGES.get(wanted, _PACKAGES["egl"])
    chosen = f", or unset {_VARIABLE}, which asks for {wanted} alone" if wanted else ""
    return (
        f"found no off-screen renderer ({found}); install the system package that brings one "
        f"(no graphics card is needed): {remedy}{chosen}"
    )


def _try(name: str) -> str | None:
    """What is wrong with a graphics library; None if it works."""
    taken = (_VARIABLE, "PYOPENGL_PLATFORM")
    try:
        probe = subprocess.run(
            [sys.executable, "-c", _PROBE, _MODULES[name]],
            env={key: value for key, value in os.environ.items() if key not in taken},
            capture_output=True, text=True, errors="replace", timeout=_PROBE_LIMIT_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if probe.returncode == 0:
        return None
    lines = [line for line in probe.stderr.splitlines() if line.strip() and not line.startswith(" ")]
    last = lines[-1].strip() if lines else f"ended with code {probe.returncode}"
    return "not installed" if "'NoneType' object" in last else last  # PyOpenGL's word for a missing library


def _context_class() -> Callable[[int, int], Any]:
    name = graphics_library()
    module = _MODULES.get(name)
    if module is None:
        default: Callable[[int, int], Any] = mujoco.GLContext
        return default
    made: Callable[[int, int], Any] = importlib.import_module(module).GLContext
    return made


class Screen:
    """A picture of a MuJoCo model, made from a scene without a window.

    Attributes:
        scene: What `draw` shows; `look` fills it, and more can be added before `draw`.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        """Open a screen of a size, [pixels]; the model's `offwidth` and `offheight` are at least as large.

        Raises:
            RendererError: There is no graphics library that works.
        """
        context_class = _context_class()
        self._model = model
        self._options = mujoco.MjvOption()
        self.scene = mujoco.MjvScene(model, maxgeom=_MOST_GEOMS)
        self._view = mujoco.MjrRect(0, 0, width, height)
        self._pixels: Image = np.empty((height, width, 3), dtype=np.uint8)
        try:
            self._context = context_class(width, height)
            self._context.make_current()
            self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except (RuntimeError, ImportError, mujoco.FatalError) as error:
            message = f"the off-screen renderer does not start: {error}; {_PACKAGES['egl']}"
            raise RendererError(message) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)

    def look(self, data: mujoco.MjData, camera: mujoco.MjvCamera) -> None:
        """Fill the scene with the model as it stands, seen from a camera."""
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, data, self._options, None, camera, everything, self.scene)

    def draw(self) -> Image:
        """The scene; shape (height, width, 3). Valid until the next call."""
        self._context.make_current()
        mujoco.mjr_render(self._view, self.scene, self._renderer)
        mujoco.mjr_readPixels(self._pixels, None, self._view, self._renderer)
        return self._pixels[::-1]

    def close(self) -> None:
        """Give everything back."""
        self._context.make_current()
        self._renderer.free()
        self._context.free()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
