"""Data to YAML text that `parse_yaml` reads back as the same data."""

from __future__ import annotations

import math
from typing import Any

import yaml

from circuitkit.source.document import Data
from circuitkit.source.scalars import RefusedScalarError, plain_scalar


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
    """A text; in quotes if `plain_scalar` would take it for something else, as PyYAML may not know."""
    try:
        style = None if plain_scalar(text) == text else '"'
    except RefusedScalarError:
        style = '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_DUMPER: Any = type("_Dumper", (yaml.SafeDumper,), {"ignore_aliases": lambda *_: True})
_DUMPER.add_representer(str, _represent_text)
