"""`make fuzz`: spoils files of every kind and reads them, in processes that may crash; writes a report.

Every file is made from the seed and a number, so that a run can be repeated, and one file of it as well.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from apart import without_streams
from fuzz.findings import LONGEST_S, Finding, Trial, judged, judged_apart, limit_memory, smallest
from fuzz.mutation import Mutator
from fuzz.seeds import Seed, all_seeds
from fuzz.targets import TARGETS

_FILES_A_PROCESS = 20_000
_TOLD_EVERY_S = 30.0
_STUCK_S = 5 * LONGEST_S


class Maker:
    """Makes the trial of a number."""

    def __init__(self, seed: int, targets: Sequence[str], cases: str | None = None) -> None:
        seeds = all_seeds(cases)
        self.seed = seed
        self.targets = list(targets)
        self.shares = [TARGETS[name].share for name in targets]
        self.seeds = seeds
        # What is long takes long to read: it is tried less often.
        self.weights = {kind: [_rarity(each) for each in found] for kind, found in seeds.items()}
        self.mutator = Mutator([each for found in seeds.values() for each in found])

    def trial(self, number: int) -> Trial:
        """The files of a number."""
        random = Random(f"{self.seed}/{number}")
        target = random.choices(self.targets, self.shares)[0]
        kind = TARGETS[target].kind
        seed = random.choices(self.seeds[kind], self.weights[kind])[0]
        files = {**seed.files, seed.spoilt: self.mutator.spoil(seed, random)}
        return Trial(target, files, seed.spoilt)


def _rarity(seed: Seed) -> float:
    return 1.0 / (1000 + sum(len(data) for data in seed.files.values()))


@dataclass
class Tally:
    """What has been tried so far, and what was found."""

    tried: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    first: dict[str, dict[str, Any]] = field(default_factory=dict)

    def report(self, seed: int, started: float) -> dict[str, Any]:
        """All of it as data."""
        findings = [
            {"finding": key, "count": count, **self.first[key]} for key, count in self.found.most_common()
        ]
        return {
            "seed": seed,
            "seconds": round(time.monotonic() - started, 1),
            "files": self.tried.total(),
            "files_by_target": dict(self.tried.most_common()),
            "findings": findings,
        }


def _work(maker: Maker, first: int, step: int, place: Path, current: Any, pipe: Any) -> None:
    """Try every `step`-th number from `first`; tell what is found, and now and then how many were tried."""
    os.nice(19)
    without_streams()
    limit_memory()
    tried: Counter[str] = Counter()
    told = time.monotonic()
    for count in range(_FILES_A_PROCESS):
        number = first + count * step
        trial = maker.trial(number)
        current[0], current[1] = number, time.monotonic_ns()
        found = judged(trial, place)
        for name in trial.files:  # the folder stays: to take one away takes as long as to read a file
            (place / name).unlink(missing_ok=True)
        tried[trial.target] += 1
        if found is not None:
            pipe.send((number, found))
        if time.monotonic() - told > 1.0:
            pipe.send((number, tried))
            tried, told = Counter(), time.monotonic()
    pipe.send((number, tried))


@dataclass
class Process:
    """A process that tries files, and what it is at."""

    place: Path
    lane: int
    step: int
    next: int
    process: Any = None
    pipe: Any = None
    current: Any = None

    def start(self, maker: Maker) -> None:
        """Begin, or begin again behind what ended the last process."""
        self.current = multiprocessing.RawArray("q", 2)
        self.current[0], self.current[1] = -1, time.monotonic_ns()
        self.pipe, other = multiprocessing.Pipe(duplex=False)
        arguments = (maker, self.next, self.step, self.place, self.current, other)
        self.process = multiprocessing.get_context("fork").Process(target=_work, args=arguments, daemon=True)
        self.process.start()
        other.close()

    def heard(self) -> Iterator[tuple[int, Finding | Counter[str]]]:
        """What it told since it was last asked."""
        try:
            while self.pipe.poll():
                yield self.pipe.recv()
        except EOFError:
            return


def campaign(options: argparse.Namespace) -> dict[str, Any]:
    """Try files until the time is over; returns the report."""
    names = [name for name in TARGETS if not options.only or name in options.only]
    maker = Maker(options.seed, names, options.cases)
    tally, started = Tally(), time.monotonic()
    end, told = started + options.seconds, started
    out = Path(options.output)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as place:
        lanes = range(options.processes)
        processes = [
            Process(Path(place) / str(lane), lane, len(lanes), options.first + lane) for lane in lanes
        ]
        for each in processes:
            each.start(maker)
        while time.monotonic() < end:
            time.sleep(0.2)
            for each in processes:
                _attend(each, maker, tally, out)
            if time.monotonic() - told > _TOLD_EVERY_S:
                told = time.monotonic()
                _write(out, tally.report(options.seed, started))
                print(f"{tally.tried.total()} files, {len(tally.found)} findings", flush=True)
        for each in processes:
            each.process.kill()
    report = tally.report(options.seed, started)
    _write(out, report)
    return report


def _attend(process: Process, maker: Maker, tally: Tally, out: Path) -> None:
    """Hear a process, end it if it is stuck, and start it anew if it has ended."""
    has_ended = not process.process.is_alive()
    for number, told in process.heard():
        if isinstance(told, Finding):
            _note(tally, maker, number, told, out)
        else:
            tally.tried += told
    number, since_ns = process.current
    is_stuck = not has_ended and number >= 0 and time.monotonic_ns() - since_ns > _STUCK_S * 1e9
    if is_stuck:
        process.process.kill()
        process.process.join()
    if has_ended or is_stuck:
        code = process.process.exitcode
        if code != 0:
            trial = maker.trial(number)
            what = f"stuck: {trial.target}" if is_stuck else f"crash of {trial.target}: signal {-code}"
            _note(tally, maker, number, Finding(what, f"exit code {code}"), out)
        process.next = number + process.step
        process.start(maker)


def _note(tally: Tally, maker: Maker, number: int, finding: Finding, out: Path) -> None:
    """Count a finding; keep the files of the first one of its cause, as small as they get."""
    tally.found[finding.key] += 1
    if finding.key in tally.first:
        return
    trial = maker.trial(number)
    again = judged_apart(trial)
    if again is not None and again.key == finding.key:
        trial = smallest(trial, finding)
    folder = out / "findings" / f"{len(tally.first):03d}"
    shutil.rmtree(folder, ignore_errors=True)
    trial.write(folder)
    (folder / "finding.txt").write_text(
        f"{finding.key}\n{trial.target}\n{number}\n{finding.message}\n", "utf-8", "replace"
    )
    tally.first[finding.key] = {
        "target": trial.target,
        "number": number,
        "message": finding.message[:500],
        "again": again is not None,
        "folder": folder.as_posix(),
    }
    print(f"found {finding.key} ({trial.target}, number {number})", flush=True)


def _write(out: Path, report: Mapping[str, Any]) -> None:
    text = json.dumps(report, indent=1, ensure_ascii=False)
    (out / "report.json").write_text(text + "\n", "utf-8", "replace")


def main() -> int:
    """Read the options and run; 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="how long")
    parser.add_argument("--seed", type=int, default=0, help="other files by another seed")
    parser.add_argument("--first", type=int, default=0, help="number of the first file")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument(
        "--only", action="append", metavar="TARGET", choices=list(TARGETS), help="such as circuit"
    )
    parser.add_argument("--cases", metavar="DIR", help="spoil the YAML files of this folder, too")
    parser.add_argument("--output", default="out/fuzz")
    report = campaign(parser.parse_args())
    print(f"{report['files']} files, {len(report['findings'])} findings; {parser.prog}: see the report")
    return 1 if report["findings"] else 0


if __name__ == "__main__":
    sys.exit(main())
