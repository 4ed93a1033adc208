"""The folder of a sweep: what was asked, the rows as they come, and in the end one Parquet file.

`study.json` says what determines the runs; `parts/*.parquet` holds a batch each, whole or not there at all;
`results.parquet` takes their place when nothing is left to be run.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from circuitkit.base.errors import CircuitkitError, InputError, Problem
from circuitkit.base.files import SEAL, replacing, seal, verified, write_text
from circuitkit.base.reading import read_text
from circuitkit.study.cases import Outcome
from circuitkit.study.results import Results, Row, arrow, outcome_of, table_of
from circuitkit.study.spec import RMS, Study, make_study
from circuitkit.study.workers import versions

_FORMAT = 1
_UNSEEN = ("description",)  # keys of a study that determine no run
_SHOWN_DIFFERENCES = 6
_SEAL_KEY = "checksum"  # in the metadata of a Parquet file


def manifest_of(study: Study, inputs: Mapping[str, str]) -> dict[str, Any]:
    """All that determines the runs of a study."""
    data = study.document.data
    return {
        "format": _FORMAT,
        "study": {key: value for key, value in data.items() if key not in _UNSEEN}
        if isinstance(data, dict)
        else {},
        "files": dict(sorted(inputs.items())),
        "versions": versions(),
    }


class OtherStudyError(InputError):
    """The runs that are there are of another study, or of other files or versions."""


@dataclass(frozen=True)
class Store:
    """The folder of a sweep."""

    folder: Path

    @property
    def results_file(self) -> Path:
        """What a sweep leaves."""
        return self.folder / "results.parquet"

    @property
    def names(self) -> tuple[str, ...]:
        """What of a sweep lies in its folder."""
        return tuple(path.name for path in (self.results_file, self._study_file, self._parts))

    @property
    def _study_file(self) -> Path:
        return self.folder / "study.json"

    @property
    def _parts(self) -> Path:
        return self.folder / "parts"

    def begin(self, study: Study, inputs: Mapping[str, str], *, resume: bool) -> dict[str, Outcome]:
        """Make the folder ready.

        Args:
            study: What is run.
            inputs: What its files say; see `Case.inputs`.
            resume: Go on with what is there.

        Returns:
            The outcomes that are there, by the run's key.

        Raises:
            InputError: The folder has results and `resume` is not set.
            OtherStudyError: The results there are of another study.
            OutputError: The folder cannot be written.
        """
        arrow()
        manifest = manifest_of(study, inputs)
        if not self._study_file.is_file():
            if self.results_file.exists() or self._parts.exists():
                message = (
                    f"'{self.folder}' has results, but no study.json that says of what; name another folder"
                )
                raise InputError(Problem("", 0, 0, "", message))
            self._remember(manifest)
            return {}
        if not resume:
            count = sum(1 for _ in self._rows())
            if count == 0 and self._manifest() == manifest:  # it was stopped before the first batch
                return {}
            message = (
                f"'{self.folder}' has {count} runs of the study '{self._manifest()['study'].get('study')}'; "
                "go on with them by --resume (resume=True), or name another folder"
            )
            raise InputError(Problem("", 0, 0, "", message))
        if differences := list(_differences(self._manifest(), manifest)):
            shown = "; ".join(differences[:_SHOWN_DIFFERENCES])
            more = len(differences) - _SHOWN_DIFFERENCES
            message = (
                f"cannot go on in '{self.folder}', for its runs are of another study: {shown}"
                f"{f'; and {more} more' if more > 0 else ''}; name another folder"
            )
            raise OtherStudyError(Problem("", 0, 0, "", message))
        return {str(row["key"]): outcome_of(study, row) for row in self._rows()}

    def add(self, study: Study, rows: Sequence[Row]) -> None:
        """Write the rows of a batch.

        Raises:
            OutputError: They cannot be written.
        """
        keys = "".join(sorted(str(row["key"]) for row in rows))
        name = f"part-{hashlib.sha256(keys.encode()).hexdigest()[:16]}.parquet"
        self._write(self._parts / name, table_of(study, rows))

    def finish(self, results: Results) -> None:
        """Write the table of all rows, and take the parts away.

        Raises:
            OutputError: It cannot be written.
        """
        self._write(self.results_file, results.table)
        shutil.rmtree(self._parts, ignore_errors=True)

    def count(self) -> int:
        """How many runs are there."""
        return len({row["key"] for row in self._rows()})

    def results(self) -> Results:
        """What is there.

        Raises:
            InputError: Nothing is there.
        """
        arrow()
        manifest = self._manifest()
        study = make_study(manifest["study"])
        cells = {tuple(cell.labels.values()): i for i, cell in enumerate(study.cells)}
        searched = [study.search.field] if study.search is not None else []

        def order(row: Row) -> tuple[Any, ...]:
            labels = tuple(row[axis] for axis in study.axes)
            return cells[labels], *(row[name] for name in searched), row["seed"]

        rows = tuple(sorted(self._rows(), key=order))
        return Results(study, rows, complete=self.results_file.is_file())

    def _remember(self, manifest: Mapping[str, Any]) -> None:
        text = json.dumps(manifest, indent=2, ensure_ascii=False, allow_nan=False)
        write_text(self._study_file, text + "\n")

    def _manifest(self) -> dict[str, Any]:
        try:
            manifest: Any = json.loads(read_text(self._study_file, "what a sweep was about"))
        except (InputError, ValueError, RecursionError) as error:
            message = (
                f"there are no results of a sweep in '{self.folder}'; allowed: the folder that a sweep wrote"
            )
            raise OtherStudyError(Problem("", 0, 0, "", message)) from error
        found: dict[str, Any] = manifest if isinstance(manifest, dict) else {}
        if found.get("format") != _FORMAT or not isinstance(found.get("study"), dict):
            message = f"'{self._study_file}' was written by another version; allowed: format {_FORMAT}"
            raise OtherStudyError(Problem("", 0, 0, "", message))
        return found

    def _rows(self) -> Iterator[dict[str, Any]]:
        """The rows that are there; those of a finished sweep, if it was stopped before it tidied up."""
        pa = arrow()
        whole = self.results_file.is_file()
        files = [self.results_file] if whole else sorted(self._parts.glob("part-*.parquet"))
        remedy = "take it away, and --resume runs what it held again"
        for file in files:
            try:
                table = pa.parquet.read_table(pa.BufferReader(verified(file, remedy)))
            except (OSError, pa.ArrowException) as error:
                message = f"cannot read '{file}': {error}; {remedy}"
                raise CircuitkitError(message) from error
            for row in table.to_pylist():
                yield {
                    name: value
                    for name, value in row.items()
                    if value is not None or not name.startswith(RMS)
                }

    @staticmethod
    def _write(path: Path, table: Any) -> None:  # noqa: ANN401 - pyarrow ships no types
        metadata = {**(table.schema.metadata or {}), _SEAL_KEY: SEAL}
        with replacing(path) as part, part.open("wb") as file:
            arrow().parquet.write_table(table.replace_schema_metadata(metadata), file, compression="zstd")
            file.flush()
            seal(part)


def read_results(folder: str | Path) -> Results:
    """Read what a sweep has written, also while it is under way or after it was stopped.

    Args:
        folder: The folder of the sweep.

    Raises:
        InputError: There are no results there.
        MissingDependencyError: pyarrow is not installed.
    """
    return Store(Path(folder)).results()


def _differences(old: Any, new: Any, where: str = "") -> Iterator[str]:  # noqa: ANN401 - JSON data
    """What differs, as texts such as `seeds.count was 20 and is 10`."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys((*old, *new)):
            path = f"{where}.{key}" if where not in {"", "study", "files", "versions"} else str(key)
            if old.get(key, _Nothing) != new.get(key, _Nothing):
                if where == "files" and key in old and key in new:
                    yield f"the {key} says something else now"
                elif where == "files":
                    yield f"the {key} {'is new' if key in new else 'is no longer used'}"
                else:
                    yield from _differences(old.get(key, _Nothing), new.get(key, _Nothing), path)
    else:
        yield f"{where} was {_shown(old)} and is {_shown(new)}"


class _Nothing:
    """What is not there."""


def _shown(value: object) -> str:
    return "nothing" if value is _Nothing else json.dumps(value, ensure_ascii=False)
