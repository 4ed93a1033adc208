"""Data to YAML text that `parse_yaml` reads back as the same data."""

from __future__ import annotations

import math
from typing import Any

import yaml

from circuitkit.base.source.reader import Data, RefusedScalarError, plain_scalar

_UNUSUAL_BREAKS = frozenset("\x85\u2028\u2029")


def dump_yaml(data: Data) -> str:
    """The data as YAML text; lists and mappings without others inside stand on one line.

    Args:
        data: Mappings, lists, texts, finite numbers, booleans and None.
    """
    text: str = yaml.dump(
        data, Dumper=_DUMPER, sort_keys=False, allow_unicode=True, default_flow_style=None, width=math.inf
    )
    return text


def _represent_text(dumper: Any, text: str) -> Any:  # noqa: ANN401 - PyYAML has no types of its own
    """A text; in double quotes where `plain_scalar` would take it for something else, or at odd breaks."""
    try:
        is_plain = plain_scalar(text) == text and not _UNUSUAL_BREAKS & set(text)
    except RefusedScalarError:
        is_plain = False
    style = None if is_plain else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_DUMPER: Any = type("_Dumper", (yaml.SafeDumper,), {"ignore_aliases": lambda *_: True})
_DUMPER.add_representer(str, _represent_text)
