"""What users set for graphics libraries, kept from stopping those who draw nothing or draw in our style."""

from __future__ import annotations

import importlib
import logging
import os
from pathlib import Path


def import_mujoco() -> None:
    """Import MuJoCo, also where it refuses what MUJOCO_GL says: only what draws a robot needs that.

    The renderer reads the variable itself and complains then.
    """
    wanted = os.environ["MUJOCO_GL"]
    try:
        importlib.import_module("mujoco")
    except ModuleNotFoundError:
        return  # who needs it says so
    except Exception:
        os.environ["MUJOCO_GL"] = "disable"
        try:
            importlib.import_module("mujoco")
        finally:
            os.environ["MUJOCO_GL"] = wanted


def shut_out_settings_of_matplotlib() -> None:
    """Have matplotlib, once it is imported, read neither the user's settings nor complain about them."""
    os.environ["MPLBACKEND"] = "agg"
    os.environ["MATPLOTLIBRC"] = os.devnull
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    if os.path.lexists("matplotlibrc"):  # in the working folder, which comes before all others
        here = Path.cwd()
        try:
            os.chdir(Path(__file__).parent)
            importlib.import_module("matplotlib")
        finally:
            os.chdir(here)
