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

from circuitkit.base.errors import CircuitkitError, InputError, Problem, listing
from circuitkit.base.files import replacing, write_text
from circuitkit.study.cases import Outcome
from circuitkit.study.identity import Identity
from circuitkit.study.results import Results, Row, arrow, outcome_of, table_of
from circuitkit.study.spec import RMS, Study, make_study

_FORMAT = 2
_READABLE = (1, _FORMAT)  # an older one says of its runs what they are, but not all that determines them


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
        older = manifest["format"] != _FORMAT
        different = "" if older else identity.differences(manifest.get("identity"))
        if not resume:
            count = sum(1 for _ in self._rows())
            if count == 0 and not older and not different:  # it was stopped before the first batch
                return {}
            message = (
                f"'{self.folder}' has {count} runs of the study '{manifest['study'].get('study')}'; "
                "go on with them by --resume (resume=True), or name another folder"
            )
            raise InputError(Problem("", 0, 0, "", message))
        if older:
            message = (
                f"cannot go on in '{self.folder}': it was begun by an older circuitkit, which did not keep "
                "all that determines a run; name another folder"
            )
            raise OtherStudyError(Problem("", 0, 0, "", message))
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
            manifest = json.loads(self._study_file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            message = (
                f"there are no results of a sweep in '{self.folder}'; allowed: the folder that a sweep wrote"
            )
            raise OtherStudyError(Problem("", 0, 0, "", message)) from error
        if not isinstance(manifest, dict) or manifest.get("format") not in _READABLE:
            found = manifest.get("format") if isinstance(manifest, dict) else None
            allowed = listing(map(str, _READABLE))
            message = f"'{self._study_file}' has the format {found}, of another version; allowed: {allowed}"
            raise OtherStudyError(Problem("", 0, 0, "", message))
        return manifest

    def _rows(self) -> Iterator[dict[str, Any]]:
        """The rows that are there; those of a finished sweep, if it was stopped before it tidied up."""
        pa = arrow()
        whole = self.results_file.is_file()
        files = [self.results_file] if whole else sorted(self._parts.glob("part-*.parquet"))
        for file in files:
            try:
                table = pa.parquet.read_table(file, partitioning=None)
            except (OSError, pa.ArrowException) as error:
                message = f"cannot read '{file}': {error}; take it away, and --resume runs what it held again"
                raise CircuitkitError(message) from error
            for row in table.to_pylist():
                yield {
                    name: value
                    for name, value in row.items()
                    if value is not None or not name.startswith(RMS)
                }

    @staticmethod
    def _write(path: Path, table: Any) -> None:  # noqa: ANN401 - pyarrow ships no types
        with replacing(path) as part:
            arrow().parquet.write_table(table, part, compression="zstd")


def read_results(folder: str | Path) -> Results:
    """Read what a sweep has written, also while it is under way or after it was stopped.

    Args:
        folder: The folder of the sweep.

    Raises:
        InputError: There are no results there.
        MissingDependencyError: pyarrow is not installed.
    """
    return Store(Path(folder)).results()
