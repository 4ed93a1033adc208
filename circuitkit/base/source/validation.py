"""Data to pydantic models, with every complaint in the words of the file: where, found, allowed, hint."""

from __future__ import annotations

import json
import re
import types
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.source.reader import Data, Document, Place
from circuitkit.base.units import format_quantity, parse_quantity

_UNION_KINDS = (Union, types.UnionType)
STRAY_TEXT = "inside braces, put a text that contains a comma in quotes"


class FileModel(BaseModel):
    """Base of all models of files: frozen, no unknown keys, no silent conversion of types.

    A list in the file becomes a tuple where the model says so, but not behind a validator of mode "before".
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def __init__(self, **data: Any) -> None:  # noqa: ANN401 - whatever the fields are
        """Make a model of values that Python gives, which complains in the same words as one of a file.

        Raises:
            InputError: With every complaint; places are those in the model.
        """
        try:
            super().__init__(**data)
        except ValidationError as error:
            findings = _findings(Document("", None, {}), type(self), data, (), error)
            raise InputError(*(finding.problem for finding in findings)) from error

    # Pydantic need not call it for what stands inside of another model, and keeps its own mode there.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]


ModelT = TypeVar("ModelT", bound=BaseModel)


def unfilled(make: Callable[[], type[ModelT]]) -> ModelT:
    """An instance without values of a class that is made when it is first asked for.

    Pickle finds a class by its name; it finds such a class by the function that makes it, in a
    `__reduce__` that gives `unfilled, (make,), self.__getstate__()`.
    """
    made = make()
    return made.__new__(made)


@dataclass(frozen=True)
class Finding:
    """A complaint of pydantic, translated.

    Attributes:
        place: The part of the document; for a missing key, where it should be.
        kind: Pydantic's name of the complaint, such as "missing".
        problem: The complaint in the words of the file.
    """

    place: Place
    kind: str
    problem: Problem


def validate_model(document: Document, model: type[ModelT], at: Place = ()) -> ModelT:
    """Make a model from a document or from a part of it.

    Args:
        document: The document.
        model: The pydantic model, usually a `FileModel`.
        at: The part.

    Raises:
        InputError: With every complaint, in the order of the file.
    """
    result, findings = model_problems(document, model, _part(document.data, at), at)
    if result is None:
        raise InputError(*(finding.problem for finding in findings))
    return result


def model_problems(
    document: Document, model: type[ModelT], data: Data, at: Place = ()
) -> tuple[ModelT | None, list[Finding]]:
    """Make a model from data that came from a part of a document, or say everything that is wrong with it.

    The data goes through pydantic's JSON mode, which is strict about types and still takes lists for tuples.

    Args:
        document: Where the data came from, for line and column.
        model: The pydantic model.
        data: The data.
        at: The part of the document that the data came from.

    Returns:
        The model and no findings, or None and the findings in the order of the file.
    """
    try:
        return model.model_validate_json(json.dumps(data), strict=True), []
    except ValidationError as error:
        findings = _findings(document, model, data, at, error)
    if not at and isinstance(data, dict):
        findings = _of_another_kind(document, model, data, findings)
    return None, sorted(findings, key=lambda finding: (finding.problem.line, finding.problem.column))


def _findings(
    document: Document, model: type[BaseModel], data: Data, at: Place, error: ValidationError
) -> list[Finding]:
    """The complaints of pydantic in the words of the file, in no order."""
    details = error.errors(include_url=False)
    findings: list[Finding] = []
    by_place: dict[Place, list[Any]] = {}
    for detail in details:
        by_place.setdefault(_place(detail, data), []).append(detail)
    around = {place[:depth] for place in by_place for depth in range(len(place))}
    for place, group in by_place.items():
        if group[0]["type"] == "missing" and isinstance(place[-1], int):
            next_one = (*place[:-1], place[-1] + 1)
            if next_one not in by_place:  # of a list that is too short, the last one says it
                findings.append(_too_short(document, data, at, place))
            continue
        if group[0]["type"] == "missing":
            findings.extend(_misspelt(document, model, data, at, place))
        # One branch of a union may refuse the type where another takes it and complains about the inside.
        if not (place in around and _is_wrong_type(group)):
            findings.append(
                _finding(document, model, at, place, [_as_written(d, data, place) for d in group])
            )
    return findings


# Every file begins with its name, under the key that is its kind. A study names a scenario, and a scenario a
# robot, so that the first of these keys tells.
_FILE_KINDS = ("study", "scenario", "gait", "controller", "robot", "circuit", "model")
OTHER_KIND = "other_kind"  # the finding that a file is of another kind, or of none


def _of_another_kind(
    document: Document, model: type[BaseModel], data: dict[str, Data], findings: list[Finding]
) -> list[Finding]:
    """One finding in the place of all, where most keys are unknown: the file is not what it should be."""
    keys = keys_of(model)
    unknown = [key for key in data if key not in keys]
    wanted = next((kind for kind in _FILE_KINDS if kind in keys), None)
    found = next((kind for kind in _FILE_KINDS if kind in data), None)
    if wanted is None or found == wanted or 2 * len(unknown) <= max(len(data), 3):
        return findings
    if found is not None:
        message = f"this is a {found}; allowed: a {wanted}"
        return [Finding((found,), OTHER_KIND, document.problem((found,), message, at_key=True))]
    message = f"unknown key '{unknown[0]}' and {len(unknown) - 1} more, so this is no {wanted}"
    allowed = f"{message}; allowed: {listing(sorted(keys))}"
    return [Finding((unknown[0],), OTHER_KIND, document.problem((unknown[0],), allowed, at_key=True))]


def _part(data: Data, place: Place) -> Data:
    """The part of the data at a place that is there."""
    for part in place:
        data = data[part]  # type: ignore[index]  # a place has keys of mappings and numbers of lists
    return data


def _too_short(document: Document, data: Data, at: Place, place: Place) -> Finding:
    found = describe(_part(data, place[:-1]))
    message = f"found {found}; allowed: a list of {int(place[-1]) + 1}"
    return Finding((*at, *place[:-1]), "missing", document.problem((*at, *place[:-1]), message))


def _misspelt(
    document: Document, model: type[BaseModel], data: Data, at: Place, place: Place
) -> Iterator[Finding]:
    """Where further keys are allowed: the one that was probably meant by a missing key."""
    around = model_at(model, place[:-1])
    if around is None or around.model_config.get("extra") != "allow":
        return
    keys, written = keys_of(around), _part(data, place[:-1])
    for key in written if isinstance(written, dict) else ():
        if key not in keys and suggest(key, keys) == f"did you mean '{place[-1]}'?":
            message = f"unknown key '{key}'; allowed: {listing(sorted(keys))}"
            problem = document.problem((*at, *place[:-1], key), message, suggest(key, keys), at_key=True)
            yield Finding((*at, *place[:-1], key), "extra_forbidden", problem)


def _place(detail: Mapping[str, Any], data: Data) -> Place:
    """The part of the data that a complaint means: its `loc` without the labels of union branches."""
    place: list[str | int] = []
    loc = detail["loc"]
    for position, part in enumerate(loc, start=1):
        is_missing_key = position == len(loc) and detail["type"] == "missing"
        keys = _keys_in(data)
        if part in keys:
            data = data[part]  # type: ignore[index]  # it is a list or a mapping, for it has keys
        elif not is_missing_key:
            continue
        place.append(part)
    return tuple(place)


def _keys_in(data: object) -> Collection[object]:
    """What a part of the data can be asked for."""
    if isinstance(data, dict):
        return data.keys()
    return range(len(data)) if isinstance(data, list | tuple) else ()


def _as_written(detail: Any, data: Data, place: Place) -> Any:  # noqa: ANN401 - pydantic's own mapping
    """A complaint about the size of a quantity in the unit in which the file has it, not in SI units."""
    for part in place:
        keys = _keys_in(data)
        data = data[part] if part in keys else None  # type: ignore[index]  # it has keys
    if not (isinstance(data, str) and isinstance(detail["input"], float | str) and detail["type"] in _SIZES):
        return detail
    unit = parse_quantity(data).unit
    bounds = {name: format_quantity(bound, unit) for name, bound in detail.get("ctx", {}).items()}
    return {**detail, "input": data, "ctx": bounds}


def _is_wrong_type(group: list[Any]) -> bool:
    return all(detail["type"].endswith("_type") for detail in group)


def _finding(
    document: Document, model: type[BaseModel], at: Place, place: Place, group: list[Any]
) -> Finding:
    detail, kind = group[0], group[0]["type"]
    around = model_at(model, place[:-1]) if kind in {"missing", "extra_forbidden"} else None
    keys = keys_of(around) if around else {}
    name = str(place[-1]) if place else ""
    if kind == "missing":
        required = [key for key, is_required in keys.items() if is_required]
        message = f"missing key '{name}'; required: {listing(required)}"
        return Finding((*at, *place), kind, document.problem((*at, *place[:-1]), message, at_key=True))
    if kind == "extra_forbidden":
        hint = STRAY_TEXT if detail["input"] is None else suggest(name, keys)
        message = f"unknown key '{name}'; allowed: {listing(sorted(keys))}"
        return Finding((*at, *place), kind, document.problem((*at, *place), message, hint, at_key=True))
    message, hint = _found_and_allowed(group)
    is_key = detail["loc"][-1:] == ("[key]",)
    return Finding((*at, *place), kind, document.problem((*at, *place), message, hint, at_key=is_key))


def _found_and_allowed(group: list[Any]) -> tuple[str, str]:
    """The message and the hint for the complaints about one value: several if it may be of several types."""
    own_words = [detail for detail in group if detail["type"] in {"value_error", "assertion_error"}]
    if own_words:
        return str(own_words[0]["ctx"]["error"]), ""
    allowed = list(dict.fromkeys(_allowed(detail) for detail in group))
    found = group[0]["input"]
    hint = ""
    if isinstance(found, str):
        words = [word for detail in group for word in _literals(detail)]
        words += ["true", "false"] if any(detail["type"].startswith("bool") for detail in group) else []
        hint = suggest(found, words)
    return f"found {describe(found)}; allowed: {' or '.join(allowed)}", hint


def describe(value: object) -> str:
    """What was found, as text for a message: `'abc'`, `5`, `true`, `a list of 3`, `nothing`.

    In Python anything may be found: `the class Damper`, or `an object of the class Damper`.
    """
    if isinstance(value, str):
        return f"'{value}'" if len(value) <= 60 else f"'{value[:60]}…'"  # noqa: PLR2004 - fits on a line
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return f"a mapping of {len(value)}"
    if value is None or isinstance(value, bool | int | float):
        return "nothing" if value is None else json.dumps(value)
    return _describe_object(value)


def _describe_object(value: object) -> str:
    """What no file can hold."""
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(shape := getattr(value, "shape", None), tuple):
        article = "a masked" if hasattr(value, "mask") else "an"
        dtype = getattr(getattr(value, "dtype", None), "name", "float64")
        return f"{article} array of shape {shape}{'' if dtype == 'float64' else f' of {dtype}'}"
    return f"an object of the class {type(value).__name__}"


_ALLOWED = {
    "string": "a text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "dict": "a mapping",
    "model": "a mapping",
    "list": "a list",
    "tuple": "a list",
    "set": "a list",
    "path": "a path",
}
_BOUNDS = {
    "finite_number": "a finite number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "multiple_of": "a multiple of {multiple_of}",
    "string_too_short": "a text of at least {min_length} characters",
    "string_too_long": "a text of at most {max_length} characters",
    "string_pattern_mismatch": "a text that matches {pattern}",
    "too_short": "at least {min_length}",
    "too_long": "at most {max_length}",
    "union_tag_invalid": "{expected_tags}",
    "union_tag_not_found": "a mapping with the key {discriminator}",
}
_SIZES = frozenset({"greater_than", "greater_than_equal", "less_than", "less_than_equal"})


def _allowed(detail: Mapping[str, Any]) -> str:
    kind: str = detail["type"]
    if literals := _literals(detail):
        return listing(literals)
    if kind in _BOUNDS:
        return _BOUNDS[kind].format(**{k: _number(v) for k, v in detail.get("ctx", {}).items()})
    return _ALLOWED.get(kind.partition("_")[0], str(detail["msg"]))


def _number(value: object) -> object:
    return f"{value:g}" if isinstance(value, float) else value


def _literals(detail: Mapping[str, Any]) -> list[str]:
    if detail["type"] not in {"literal_error", "enum", "union_tag_invalid"}:
        return []
    context = detail["ctx"]
    return re.findall(r"'([^']*)'", str(context.get("expected", context.get("expected_tags", ""))))


@cache
def keys_of(model: type[BaseModel]) -> Mapping[str, bool]:
    """Every key of a model's mapping, with whether it is required."""
    return {field.alias or name: field.is_required() for name, field in model.model_fields.items()}


def model_at(annotation: Any, place: Place) -> type[BaseModel] | None:  # noqa: ANN401 - any annotation
    """The model that describes the mapping at a place, starting from the annotation of the top."""
    for candidate in _branches(annotation):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            if not place:
                return candidate
            for name, field in candidate.model_fields.items():
                if place[0] in {field.alias or name} and (found := model_at(field.annotation, place[1:])):
                    return found
        elif place and (arguments := [a for a in get_args(candidate) if a is not Ellipsis]):
            origin = get_origin(candidate)
            is_mapping = isinstance(origin, type) and issubclass(origin, Mapping)
            inner = arguments[-1:] if is_mapping else arguments
            if found := next(filter(None, (model_at(each, place[1:]) for each in inner)), None):
                return found
    return None


def _branches(annotation: Any) -> Iterator[Any]:  # noqa: ANN401 - any annotation
    """The branches of a union, or the annotation itself, without `Annotated`."""
    if hasattr(annotation, "__metadata__"):
        annotation = annotation.__origin__
    if get_origin(annotation) in _UNION_KINDS:
        for branch in get_args(annotation):
            yield from _branches(branch)
    else:
        yield annotation
