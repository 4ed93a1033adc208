"""The controller file: a kind of controller and its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias, get_args

from pydantic import ConfigDict, Field, field_validator

from circuitkit.base.errors import UnknownNameError, listing, suggest
from circuitkit.base.source import Data, FileModel, find_data_file, read_yaml, shipped_names, validate_model
from circuitkit.biped.control.capture_step import CaptureStepSpec
from circuitkit.biped.control.dcm_ankle import DcmAnkleSpec
from circuitkit.biped.control.wieber_mpc import WieberMpcSpec

FOLDER = "sims/controllers"

# A new kind is a class with a `kind` and a `build`, and its name in this line.
ControllerSpec: TypeAlias = DcmAnkleSpec | WieberMpcSpec | CaptureStepSpec

KINDS: Mapping[str, type[ControllerSpec]] = {
    get_args(spec.model_fields["kind"].annotation)[0]: spec
    for spec in (get_args(ControllerSpec) or (ControllerSpec,))
}


class _Kind(FileModel):
    """The key that says what the other keys are."""

    model_config = ConfigDict(extra="allow")

    controller: str = Field(description="Name.")
    kind: str = Field(description="Kind of controller.")

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in KINDS:
            hint = suggest(kind, KINDS)
            message = f"unknown kind '{kind}'; allowed: {listing(KINDS)}{'; ' if hint else ''}{hint}"
            raise ValueError(message)
        return kind


def shipped_controllers() -> tuple[str, ...]:
    """Names of the controller files that come with circuitkit."""
    return shipped_names(FOLDER)


def load_controller(name_or_path: str | Path, changes: Mapping[str, Data] | None = None) -> ControllerSpec:
    """Read a controller file.

    Args:
        name_or_path: A path, or the name of a shipped one such as `dcm_ankle`.
        changes: Values that take the place of the file's, by key; `lateral.limit` is a key within one.

    Raises:
        UnknownNameError: There is no shipped one of this name; lists those there are.
        InputError: It cannot be read; says where and why.
    """
    path = Path(name_or_path)
    names = shipped_controllers()
    if not path.suffix and len(path.parts) == 1 and not path.is_file() and path.name not in names:
        kind = "controller"
        raise UnknownNameError(kind, path.name, names)
    document = read_yaml(find_data_file(name_or_path, FOLDER))
    for key, value in (changes or {}).items():
        document = replace(document, data=_changed(document.data, key.split("."), value))
    kind_of = validate_model(document, _Kind).kind
    return validate_model(document, KINDS[kind_of])


def _changed(data: Data, path: list[str], value: Data) -> Data:
    """The data with one value of a mapping, or of a mapping within it, put in the place of another."""
    inside = data if isinstance(data, dict) else {}
    name, *rest = path
    return {**inside, name: _changed(inside.get(name), rest, value) if rest else value}
