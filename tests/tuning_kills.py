"""Kills a small tuning with made-up runs at its n-th moment, again and again, by forks of one process.

A moment is an SQL statement before or after it is executed, the end of a transaction, the beginning of a
measurement, or a file's renaming. `python tuning_kills.py FOLDER POINT...` prints a JSON object: how many
moments there are, and the points at which a kill and a resumption leave another result than none.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import sqlalchemy
from small_tuning import SMALL, written
from sqlalchemy.engine import Engine

from circuitkit.base.errors import CircuitkitError, SimulationError
from circuitkit.study.tuning import run
from circuitkit.study.tuning.measure import Measure
from circuitkit.study.tuning.objective import Score

TEXT = SMALL.replace("sampler: tpe", "sampler: cmaes").replace("generation: 2", "generation: 4")
TEXT = TEXT.replace("trials: 3", "trials: 13")
SEEN = ("trials.csv", "small_tuned.yaml")
_KILLED = 137


class Moments:
    """Counts, and ends the process at one of them."""

    def __init__(self) -> None:
        self.count, self.last = 0, None

    def __call__(self, *_: object, **__: object) -> None:
        self.count += 1
        if self.count == self.last:
            os._exit(_KILLED)


MOMENTS = Moments()
for name in ("before_cursor_execute", "after_cursor_execute", "commit"):
    sqlalchemy.event.listen(Engine, name, MOMENTS)


def measured(_: object, candidates: list[dict[str, str]]) -> list[Score | CircuitkitError]:
    """Scores of one's own; one candidate in six cannot be measured."""
    MOMENTS()
    found: list[Score | CircuitkitError] = []
    for each in candidates:
        leak, w = (float(each[name].split()[0]) for name in ("leak", "w"))
        value = -((leak - 7.0) ** 2) - (w + 1.0) ** 2
        found.append(SimulationError("no luck") if int(leak * 1e4) % 6 == 1 else Score(value, (leak, -w), 4))
    return found


def renaming(old: Path, new: Path, *, rename=Path.replace) -> Path:
    MOMENTS()
    return rename(old, new)


def tuned(study: Path, out: Path, last: int | None = None, *, resume: bool = False) -> tuple[int, int]:
    """Tune in a fork: how it ended, and how many moments there were."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            MOMENTS.count, MOMENTS.last = 0, last
            run.tune(study, out, workers=1, resume=resume)
            os.write(writer, str(MOMENTS.count).encode())
            code = 0
        except BaseException as error:
            sys.stderr.write(f"{type(error).__name__} {error}\n")
        finally:
            os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as stream:
        said = stream.read()
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), int(said or 0)


def contents(out: Path) -> list[str]:
    return [(out / name).read_text(encoding="utf-8").replace(str(out), "") for name in SEEN]


def main(folder: Path, points: list[int]) -> None:
    Measure.__call__ = measured
    run.draw_history = lambda *_: MOMENTS()  # a picture takes a second, and nobody reads it back
    Path.replace = renaming
    study = written(folder, text=TEXT)
    code, count = tuned(study, folder / "whole")
    assert code == 0, code
    expected, differing = contents(folder / "whole"), []
    for point in points or range(1, count + 1):
        out = folder / f"at_{point}"
        killed, _ = tuned(study, out, point)
        resumed, _ = tuned(study, out, resume=True)
        if killed != _KILLED or resumed != 0 or contents(out) != expected:
            differing.append((point, killed, resumed))
    rows = expected[0].splitlines()
    found = {"moments": count, "differing": differing, "candidates": len(rows) - 1}
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [int(each) for each in sys.argv[2:]])
