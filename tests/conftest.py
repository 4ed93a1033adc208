"""What holds for all tests."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# Makes the modules beside the tests importable, for pytest's importlib mode adds no folder by itself.
sys.path.insert(0, str(Path(__file__).parent))

import cases

# A shell that runs tests in the background lets them ignore Ctrl-C, and their children inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# How long an example takes says how busy the machine is.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "circuits with extreme numbers to try; above 300 others each time, and one in 300 with sanitizers"
    parser.addoption("--cases", type=int, default=cases.CASES, metavar="N", help=text)


def pytest_configure(config: pytest.Config) -> None:
    cases.CASES = config.getoption("--cases")
