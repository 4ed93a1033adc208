"""Faults of the world around us: kills, full disks, clocks. `make torture` runs them, others skip them."""

from __future__ import annotations

from pathlib import Path

import pytest

_HERE = Path(__file__).parent


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--torture", action="store_true", help="kill, fill disks, stop clocks: make torture")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    # pytest knows the option only if this folder is named on the command line, as `make torture` does.
    if not config.getoption("--torture", default=False):
        skip = pytest.mark.skip(reason="runs by `make torture` only")
        for item in items:
            if _HERE in item.path.parents:
                item.add_marker(skip)
