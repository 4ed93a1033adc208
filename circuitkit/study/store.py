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
from circuitkit.simulation.measures import RMS
from circuitkit.study.cases import Outcome
from circuitkit.study.identity import Identity
from circuitkit.study.results import Results, Row, arrow, outcome_of, table_of
from circuitkit.study.spec import Study, make_study

_FORMAT = 2
_SEAL_KEY = "checksum"  # in the metadata of a Parquet file


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

    def begin(self, study: Study, identity: Identity, *, resume: bool) -> dict[str, Outcome]:
        """Make the folder ready.

        Args:
            study: What is run.
            identity: All that determines its runs.
            resume: Go on with what is there.

        Returns:
            The outcomes that are there, by the run's key.

        Raises:
            InputError: The folder has results and `resume` is not set.
            OtherStudyError: The results there are of another study.
            OutputError: The folder cannot be written.
        """
        arrow()
        if not self._study_file.is_file():
            if self.results_file.exists() or self._parts.exists():
                message = (
                    f"'{self.folder}' has results, but no study.json that says of what; name another folder"
                )
                raise InputError(Problem("", 0, 0, "", message))
            self._remember({"format": _FORMAT, "study": study.document.data, "identity": identity.as_json()})
            return {}
        manifest = self._manifest()
        different = identity.differences(manifest.get("identity"))
        if not resume:
            count = sum(1 for _ in self._rows())
            if count == 0 and not different:  # it was stopped before the first batch
                return {}
            message = (
                f"'{self.folder}' has {count} runs of the study '{manifest['study'].get('study')}'; "
                "go on with them by --resume (resume=True), or name another folder"
            )
            raise InputError(Problem("", 0, 0, "", message))
        if different:
            message = (
                f"cannot go on in '{self.folder}', for its runs are others: {different}; "
                "undo that, or name another folder"
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
        try:
            study = make_study(manifest["study"])
        except InputError as error:
            message = f"is damaged: {error.problems[0].message}; name another folder"
            raise OtherStudyError(Problem(str(self._study_file), 1, 1, "study", message)) from error
        cells = {tuple(cell.labels.values()): i for i, cell in enumerate(study.cells)}
        searched = [study.search.field] if study.search is not None else []

        def order(row: Row) -> tuple[Any, ...]:
            labels = tuple(row[axis] for axis in study.axes)
            return cells[labels], *(row[name] for name in searched), row["seed"]

        try:
            rows = tuple(sorted(self._rows(), key=order))
        except (KeyError, TypeError) as error:
            message = f"its rows do not fit the study in '{self._study_file.name}'; name another folder"
            raise OtherStudyError(Problem(str(self.folder), 1, 1, "", message)) from error
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
            format_ = found.get("format")
            message = f"'{self._study_file}' has the format {format_}, of another version; allowed: {_FORMAT}"
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
            except (InputError, OSError, UnicodeDecodeError, pa.ArrowException) as error:
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
