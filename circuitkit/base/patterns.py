"""Patterns over names: a * stands for any letters or none, and everything else for itself."""

from __future__ import annotations

import re
from functools import cache

ANY = "*"


def matches(name: str, pattern: str) -> bool:
    """Whether a name fits a pattern; without a `*` only the very same name does."""
    return _compiled(pattern).fullmatch(name) is not None


@cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(".*".join(map(re.escape, pattern.split(ANY))), re.DOTALL)
