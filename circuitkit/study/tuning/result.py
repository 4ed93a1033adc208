"""What a tuning leaves: the tuned file, with where its numbers come from.

Comments, order and spelling of everything that was not tuned stay.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import circuitkit
from circuitkit.base.errors import CircuitkitError, InputError, listing, suggest
from circuitkit.base.files import make_folder, write_text
from circuitkit.base.reading import read_text
from circuitkit.base.source import dump_yaml, find_data_file
from circuitkit.base.source.commented import Collection, Entry, Scalar, read_commented
from circuitkit.base.source.rewriting import write_commented
from circuitkit.circuit import load_circuit, parse_circuit, read_circuit
from circuitkit.circuit.authoring.difference import compare_circuits
from circuitkit.circuit.authoring.flat import flat_document
from circuitkit.circuit.authoring.formatting import format_text
from circuitkit.circuit.parts import FOLDER, Module
from circuitkit.control.spec import FOLDER as CONTROLLERS
from circuitkit.simulation.reference import REFERENCES
from circuitkit.study.tuning.objective import Score, Term
from circuitkit.study.tuning.runs import in_words
from circuitkit.study.tuning.search import History, Trial
from circuitkit.study.tuning.spec import TuneSpec, Tuning

_WIDTH = 110
_SCHEMA = "circuit.schema.json"
_SECTIONS = ("parameters", "neurons", "populations", "inputs", "outputs")
_HEADER = ("control_step", "timing", "substeps", "seed")
_FOR_EDITORS = "# yaml-language-server:"


def folder_of(tuning: Tuning) -> str:
    """Where shipped files of the kind that is tuned lie.

    Raises:
        InputError: There is no such kind of reference, or it has no file.
    """
    spec = tuning.spec
    if spec.reference is None:
        return FOLDER if spec.target == "circuit" else CONTROLLERS
    place = ("tune", "reference")
    with_file = [kind for kind, made in REFERENCES.kinds.items() if made.file is not None]
    made = REFERENCES.kinds.get(spec.kind)
    if made is None or made.file is None:
        message = f"found '{spec.kind}', which is no reference with a file; allowed: {listing(with_file)}"
        hint = suggest(spec.kind, with_file)
        raise InputError(tuning.document.problem((*place, spec.kind), message, hint, at_key=True))
    return made.file.folder


class ResultError(CircuitkitError):
    """What was written does not mean what was measured; this is a defect of circuitkit."""


def write_result(tuning: Tuning, values: Mapping[str, str], comment: Sequence[str], path: Path) -> Path:
    """Write the tuned file.

    Args:
        tuning: What was tuned.
        values: The values by name.
        comment: Lines that stand above it.
        path: The file.

    Raises:
        ResultError: The text does not mean what was measured.
        OutputError: It cannot be written.
    """
    target = tuning.spec.target
    make_folder(path.parent)
    if target == "circuit":
        text = _circuit_text(tuning, values, comment, path)
    else:
        base = read_text(find_data_file(tuning.base, folder_of(tuning)), "a YAML file")
        text = changed_file(base, {tuning.spec.kind: tuning.spec.result, **values}, comment)
    write_text(path, text)
    return path


def _circuit_text(tuning: Tuning, values: Mapping[str, str], comment: Sequence[str], path: Path) -> str:
    """The shortest text that means the circuit that was measured.

    A file that includes the base and sets parameters; where values are tuned that an including file cannot
    set (of neurons, of instances), a copy of the base with these values; where they stand in files that the
    base includes, the circuit written out.

    Raises:
        ResultError: None of them means what was measured.
    """
    base = find_data_file(tuning.base, FOLDER)
    files, graph = read_circuit(base), load_circuit(base, values)
    spec = files.spec
    words = f"{spec.description or spec.circuit}, tuned by {tuning.file.study}"
    named = {"circuit": tuning.spec.result, "description": words}
    folders = (base.parent, path.parent)
    ways: Sequence[Callable[[], str]] = (
        lambda: _including(files, base, named, values, comment, path.parent),
        lambda: changed_circuit(read_text(base, "a YAML file"), {**named, **values}, comment, folders),
        lambda: "\n".join([*commented(comment), dump_yaml({**flat_document(graph), **named})]),
    )
    for text in ways:
        try:
            formatted = format_text(text(), str(path))
            written = parse_circuit(formatted, str(path))
        except (ElsewhereError, InputError):
            continue
        alike = replace(written, name=graph.name, description=graph.description, parameters=graph.parameters)
        if not compare_circuits(graph, alike):
            return formatted
    message = f"nothing that could be written to '{path}' means the circuit that was measured; please report"
    raise ResultError(message)


def _including(
    files: Module,
    base: Path,
    named: Mapping[str, str],
    values: Mapping[str, str],
    comment: Sequence[str],
    folder: Path,
) -> str:
    """A file that includes the base and sets parameters.

    Raises:
        ElsewhereError: What is tuned is no parameter of these files.
    """
    spec = files.spec
    if not set(values) <= files.parameter_names:
        raise ElsewhereError(*(set(values) - files.parameter_names))
    head = [f"# yaml-language-server: $schema={_SCHEMA}", "#"] if (folder / _SCHEMA).is_file() else []
    data: dict[str, Any] = {
        **named,
        "control_step": spec.control_step,
        "timing": spec.timing,
        "include": [os.path.relpath(base.resolve(), folder.resolve())],
        "parameters": dict(values),
    }
    return "\n".join([*head, *commented(comment), dump_yaml(data)])


def provenance(
    tuning: Tuning, history: History, best: Trial, confirmed: Score | None, test: Score | None
) -> list[str]:
    """Where the numbers of a result come from, as lines of a comment.

    Args:
        tuning: What was tuned.
        history: The candidates.
        best: The one that was chosen.
        confirmed: What the runs said by which it was chosen among the best; None without such.
        test: What the test says; None if it was not run.
    """
    spec, file = tuning.spec, tuning.file
    ended = ", ended early" if history.interrupted else ""
    train = Score(best.value or 0.0, best.figures, best.runs)
    by = f"{spec.sampler}, seed {spec.seed}, {len(history.trials)} candidates{ended}; number {best.number}"
    command = f"circuitkit tune {Path(tuning.document.path).name}"
    sentences = [
        f"Found by circuitkit {circuitkit.__version__}: {command} (study {file.study}; {by}).",
        f"Objective, {'most' if spec.maximise else 'least'}: {objective_in_words(spec)}.",
        f"Training, {in_words(spec.train.seeds)}: {_figures(spec, train)}.",
    ]
    if confirmed is not None and spec.confirm is not None:
        among = f"Chosen among the best {spec.confirm.best}"
        sentences.append(f"{among}, {in_words(spec.confirm.seeds)}: {_figures(spec, confirmed)}.")
    seeds = in_words(spec.test.seeds)
    sentences.append(f"Test, {seeds}: {_figures(spec, test)}." if test else "The test was not run.")
    return [line for each in sentences for line in textwrap.wrap(each, _WIDTH - 2, break_on_hyphens=False)]


def objective_in_words(spec: TuneSpec) -> str:
    """Such as `survived of pushed - 0.2 rms_ankle_roll of calm [deg] beyond 0.1 deg`."""
    parts = []
    for number, term in enumerate(spec.terms):
        sign = "-" if term.weight < 0 else "+" if number else ""
        size = "" if abs(term.weight) == 1 else f"{abs(term.weight):g} "
        unit = f" [{term.unit}]" if term.unit else ""
        beyond = f" beyond {term.beyond}" if term.beyond else ""
        parts.append(f"{sign}{' ' if sign and number else ''}{size}{term.name}{unit}{beyond}")
    return " ".join(parts)


def _figures(spec: TuneSpec, score: Score) -> str:
    runs = "1 run" if score.runs == 1 else f"{score.runs} runs"
    return f"{score.value:.6g} ({', '.join(figures_in_words(spec.terms, score.figures))}; {runs})"


def figures_in_words(terms: Sequence[Term], figures: Sequence[float]) -> Iterator[str]:
    """Such as `survived of pushed 0.81`."""
    for term, figure in zip(terms, figures, strict=True):
        yield f"{term.name} {figure:.4g}{f' {term.unit}' if term.unit else ''}"


class ElsewhereError(LookupError):
    """What shall be changed stands in another file."""


def changed_file(text: str, values: Mapping[str, str], comment: Sequence[str]) -> str:
    """A file in which values are others; fields that it lacks are added.

    Args:
        text: The text of the file.
        values: By path, such as `lateral.limit`.
        comment: Lines that stand above it.
    """
    tree = read_commented(text)
    for path, value in values.items():
        _put(tree.top, path.split("."), value)
    return _headed(write_commented(tree, _WIDTH), comment)


def changed_circuit(
    text: str, values: Mapping[str, str], comment: Sequence[str], folders: tuple[Path, Path]
) -> str:
    """A circuit file in which values are others, by the names that `--set` takes.

    Args:
        text: The text of the file.
        values: Of parameters, of nodes, or of parameters of instances that the file includes; by name.
        comment: Lines that stand above it.
        folders: Where the file lies, and where the new one will lie: the paths of includes follow.

    Raises:
        ElsewhereError: A value does not stand in this file.
    """
    tree = read_commented(text)
    for name, value in values.items():
        _put(*_place(tree.top, name), value)
    include = _inside(tree.top, "include")
    for entry in () if include is None else include.entries:
        holder = entry if isinstance(entry.value, Scalar) else _entry(entry.value, "file")
        if holder is not None and isinstance(holder.value, Scalar):
            path = os.path.relpath((folders[0] / holder.value.value).resolve(), folders[1].resolve())
            holder.value = _scalar(path)
    return _headed(write_commented(tree, _WIDTH), comment)


def _place(top: Collection, name: str) -> tuple[Collection, Sequence[str]]:
    """The mapping in which a value stands, and the way from there."""
    if name in (*_HEADER, "circuit", "description"):
        return top, (name,)
    first, *rest = name.split(".")
    for section in _SECTIONS:
        found = _inside(top, section)
        entry = None if found is None else _entry(found, name if section == "parameters" else first)
        if found is not None and entry is not None:
            if section != "parameters":
                return found, (first, *rest)
            return found, (name, "value") if isinstance(entry.value, Collection) else (name,)
    include = _inside(top, "include")
    for entry in () if include is None else include.entries:
        if isinstance(entry.value, Collection) and len(rest) == 1:
            instance = _entry(entry.value, "as")
            if instance and isinstance(instance.value, Scalar) and instance.value.value == first:
                return entry.value, ("parameters", *rest)
    raise ElsewhereError(name)


def _inside(mapping: Collection, name: str) -> Collection | None:
    entry = _entry(mapping, name)
    return entry.value if entry is not None and isinstance(entry.value, Collection) else None


def _entry(mapping: Collection, name: str) -> Entry | None:
    if not mapping.is_mapping:
        return mapping.entries[int(name)] if name.isdigit() and int(name) < len(mapping.entries) else None
    return next((each for each in mapping.entries if each.name == name), None)


def _scalar(value: str) -> Scalar:
    return Scalar((dump_yaml(value).splitlines()[0],), value)


def _put(mapping: Collection, path: Sequence[str], value: str) -> None:
    """Change or add a value of a mapping, or of one in it."""
    name, *inner = path
    entry = _entry(mapping, name)
    if entry is None:
        content = Collection(is_mapping=True, flow=True) if inner else _scalar(value)
        entry = Entry(name, name, content, (0, 0), (0, 0), mapping)
        mapping.entries.append(entry)
    if not inner:
        entry.value = _scalar(value)
    elif isinstance(entry.value, Collection):
        _put(entry.value, inner, value)
    else:
        raise ElsewhereError(".".join(path))


def _headed(text: str, comment: Sequence[str]) -> str:
    """The text with a comment above it, below a line for editors."""
    first, _, rest = text.partition("\n")
    head = [f"{first}\n#"] if first.startswith(_FOR_EDITORS) else []
    below = rest if head else text
    above = "\n".join([*head, *commented(comment)])
    return (
        f"{above}\n#\n{below.removeprefix('#').lstrip()}" if below.startswith("#\n") else f"{above}\n{below}"
    )


def commented(lines: Sequence[str]) -> list[str]:
    """Lines as comments."""
    return [f"# {line}".rstrip() for line in lines]
