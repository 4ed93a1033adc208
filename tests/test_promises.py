"""Each promise of docs/promises.md names tests, and all of them exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
PAGE = TESTS.parent / "docs" / "promises.md"
PROMISES = re.findall(r"^- (.*?)(?=^- |^#|\Z)", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
NAMED = [
    (name, promise.split("`")[0])
    for promise in PROMISES
    for name in re.findall(r"`([\w/]+\.py::\w+)`", promise)
]


def test_every_promise_has_a_test():
    assert len(PROMISES) >= 30
    without = [each for each in PROMISES if not re.search(r"`[\w/]+\.py::\w+`", each)]
    assert without == []


@pytest.mark.parametrize("name", sorted({name for name, _ in NAMED}))
def test_every_test_that_a_promise_names_exists(name):
    file, _, function = name.partition("::")
    path = TESTS / file
    assert path.is_file()
    assert not function or re.search(rf"^def {function}\(", path.read_text(encoding="utf-8"), re.MULTILINE)
