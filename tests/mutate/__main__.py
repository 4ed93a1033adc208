"""`make mutate`: changes the code in one place at a time, and counts how many changes the tests notice."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path
from random import Random

import pytest
from mutate.mutants import mutants_of
from mutate.session import Session, describe

TOP = Path(__file__).parents[2]
# What is changed, and the tests that should notice.
AREAS = {
    "checker": (
        ["circuitkit/circuit/resolving/*.py", "circuitkit/base/source/validation.py"],
        ["tests/circuit", "tests/mistakes", "tests/test_source.py"],
    ),
    "identity": (
        [
            "circuitkit/study/identity.py",
            "circuitkit/study/plain.py",
            "circuitkit/study/cases.py",
            "circuitkit/robots/mjcf_identity.py",
        ],
        [
            "tests/study/test_spec.py",
            "tests/study/test_sweep.py",
            "tests/study/test_common_starts.py",
            "tests/study/test_identity.py",
        ],
    ),
    "store": (["circuitkit/study/store.py"], ["tests/study/test_store.py", "tests/study/test_sweep.py"]),
    "reading": (
        ["circuitkit/base/reading.py", "circuitkit/base/archive.py", "circuitkit/robots/mjcf_files.py"],
        [
            "tests/test_reading.py",
            "tests/test_archive.py",
            "tests/torture/test_archives.py",
            "tests/circuit/test_matrix_files.py",
            "tests/robots/test_mjcf_files.py",
        ],
    ),
    "writing": (
        ["circuitkit/base/files.py", "circuitkit/base/output_folder.py", "circuitkit/base/tables.py"],
        ["tests/test_files.py", "tests/test_output_folder.py", "tests/test_tables.py"],
    ),
    "commands": (
        [
            "circuitkit/robots/limits.py",
            "circuitkit/simulation/fallback.py",
            "circuitkit/engine/dependence.py",
            "circuitkit/engine/state.py",
        ],
        [
            "tests/robots/test_limits.py",
            "tests/robots/test_commands.py",
            "tests/simulation/test_fallback.py",
            "tests/engine/test_state.py",
            "tests/engine/test_dependence.py",
        ],
    ),
    "physics": (
        ["circuitkit/robots/validity.py", "circuitkit/simulation/friction.py"],
        ["tests/simulation/test_validity.py", "tests/simulation/test_friction.py"],
    ),
    "processes": (
        ["circuitkit/study/processes.py", "circuitkit/study/batches.py", "circuitkit/base/signals.py"],
        ["tests/study/test_processes.py", "tests/study/test_batches.py", "tests/test_files.py"],
    ),
    "tuning": (
        [f"circuitkit/study/tuning/{each}.py" for each in ("samplers", "storage", "lock")],
        [f"tests/study/tuning/test_{each}.py" for each in ("samplers", "search", "storage")],
    ),
}


def main() -> int:
    """Read the options and run; 1 if fewer are noticed than should be."""
    parser = argparse.ArgumentParser(prog="mutate", description=__doc__)
    parser.add_argument("area", nargs="?", choices=list(AREAS), default=None, help="by default each of them")
    parser.add_argument(
        "--sample", type=int, default=300, metavar="N", help="so many changes, chosen by chance"
    )
    parser.add_argument("--seed", type=int, default=0, help="others by another seed")
    parser.add_argument("--least", type=float, default=0.85, help="share that should be noticed")
    parser.add_argument("--only", default="", metavar="TEXT", help="changes whose description has this")
    parser.add_argument("--output", default="out/mutate")
    options = parser.parse_args()
    shares = [_area(name, options) for name in ([options.area] if options.area else AREAS)]
    return 0 if min(shares) >= options.least else 1


def _area(name: str, options: argparse.Namespace) -> float:
    patterns, tests = AREAS[name]
    files = [path for pattern in patterns for path in sorted(TOP.glob(pattern))]
    mutants = [each for path in files for each in mutants_of(path) if options.only in describe(each)]
    Random(options.seed).shuffle(mutants)
    session = Session(mutants[: options.sample])
    words = [
        "-q",
        "-p",
        "no:cacheprovider",
        "--hypothesis-seed=0",
        *(str(TOP / each) for each in tests),
    ]
    pytest.main(words, plugins=[session])
    counts = Counter(session.outcomes.values())
    share = counts["killed"] / max(1, counts.total())
    print(f"{name}: {counts['killed']} of {counts.total()} changes noticed ({share:.1%}), of {len(mutants)}")
    out = Path(options.output)
    out.mkdir(parents=True, exist_ok=True)
    survivors = sorted(describe(each) for each, outcome in session.outcomes.items() if outcome != "killed")
    report = {"seed": options.seed, "changes": len(mutants), "tried": dict(counts), "survivors": survivors}
    (out / f"{name}.json").write_text(json.dumps(report, indent=1, ensure_ascii=False) + "\n", "utf-8")
    return share


if __name__ == "__main__":
    sys.exit(main())
