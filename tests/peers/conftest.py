"""Other simulators as fixtures: without `--peers` their tests are skipped, with it a missing one fails."""

from __future__ import annotations

import importlib
import warnings

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--peers", action="store_true", help="compare with other simulators: make test-peers")


@pytest.fixture(scope="session")
def nengo(request):
    return _peer("nengo", request)


@pytest.fixture(scope="session")
def brian2(request):
    peer = _peer("brian2", request)
    peer.prefs.codegen.target = "numpy"
    return peer


def _peer(name, request):
    # pytest knows the option only if this folder is named on the command line, as `make test-peers` does.
    if not request.config.getoption("--peers", default=False):
        pytest.skip("runs by `make test-peers` only")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # theirs, while they are imported
        return importlib.import_module(name)
