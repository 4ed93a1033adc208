"""The controller file: a kind of controller and its numbers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from pydantic import ConfigDict, Field, field_validator

from circuitkit.base.errors import UnknownNameError, listing, suggest
from circuitkit.base.reading import is_file
from circuitkit.base.registry import Registry
from circuitkit.base.source import (
    Data,
    Document,
    FileModel,
    find_data_file,
    path_of,
    read_yaml,
    shipped_names,
    validate_model,
)
from circuitkit.circuit import CircuitGraph
from circuitkit.control.controller import Controller, Interface

FOLDER = "sims/controllers"


class ControllerSpec(FileModel):
    """Base of the kinds of controllers that have a file of numbers; a kind names itself in `kind`."""

    kind: ClassVar[str]

    controller: str = Field(description="Name.")
    description: str = ""

    @property
    def name(self) -> str:
        """As the user calls it."""
        return self.controller

    @abstractmethod
    def bind(self, interface: Interface) -> Controller:
        """The controller for a run.

        Raises:
            InputError: It does not fit the robot or the reference.
            MissingDependencyError: It needs a package that is an extra.
        """

    def circuits(self) -> Mapping[str, CircuitGraph]:
        """The circuits that the file names, by key; none for most kinds."""
        return {}

    def packages(self) -> tuple[str, ...]:
        """Distributions of others that compute for it, on whose versions its commands depend."""
        return ()


KINDS: Registry[ControllerSpec] = Registry("controllers", ControllerSpec, "circuitkit.control")  # type: ignore[type-abstract]  # as the base of classes


class _Kind(FileModel):
    """The key that says what the other keys are."""

    model_config = ConfigDict(extra="allow")

    controller: str = Field(description="Name.")
    kind: str = Field(description="Kind of controller.")

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in KINDS.kinds:
            hint = suggest(kind, KINDS.kinds)
            message = f"unknown kind '{kind}'; allowed: {listing(KINDS.kinds)}{'; ' if hint else ''}{hint}"
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
    path = path_of(name_or_path, Path(FOLDER).name)
    names = shipped_controllers()
    if not path.suffix and len(path.parts) == 1 and not is_file(path) and path.name not in names:
        kind = "controller"
        raise UnknownNameError(kind, path.name, names)
    document = read_yaml(find_data_file(name_or_path, FOLDER))
    for key, value in (changes or {}).items():
        document = replace(document, data=_changed(document.data, key.split("."), value))
    kind_of = KINDS[validate_model(document, _Kind).kind]
    return validate_model(without_kind(document), kind_of)


def without_kind(document: Document) -> Document:
    """The document without the key `kind`, which the class stands for."""
    data = document.data
    kept = {key: value for key, value in data.items() if key != "kind"} if isinstance(data, dict) else data
    return replace(document, data=kept)


def _changed(data: Data, path: list[str], value: Data) -> Data:
    """The data with one value of a mapping, or of a mapping within it, put in the place of another."""
    inside = data if isinstance(data, dict) else {}
    name, *rest = path
    return {**inside, name: _changed(inside.get(name), rest, value) if rest else value}
