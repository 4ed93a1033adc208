"""Files that once were answered badly, as small as they get; `make fuzz` finds such.

A file or folder of files lies in `corpus/TARGET/`. What is right is the first word of its name: `refused`,
with a place in a file, or `read`.
"""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from fuzz.findings import Trial, judged
from fuzz.mutation import Mutator
from fuzz.seeds import all_seeds
from fuzz.targets import TARGETS, tried

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*/*"))


def trial_of(item: Path) -> Trial:
    """The files of an item of the corpus; a lone file has the name that the target reads."""
    if item.is_file():
        return Trial(item.parent.name, {f"spoilt{item.suffix}": item.read_bytes()}, f"spoilt{item.suffix}")
    files = {
        path.relative_to(item).as_posix(): path.read_bytes() for path in item.rglob("*") if path.is_file()
    }
    spoilt = min(files, key=lambda name: not name.startswith(("spoilt.", "m.", "part.")))
    return Trial(item.parent.name, files, spoilt)


@pytest.mark.parametrize("item", CORPUS, ids=lambda item: f"{item.parent.name}/{item.name}")
def test_what_was_answered_badly_once(item, tmp_path):
    trial = trial_of(item)
    assert judged(trial, tmp_path / "judged") is None
    problems = tried(TARGETS[trial.target], trial.write(tmp_path / "tried"))
    assert bool(problems) == item.name.startswith("refused"), problems


def test_every_seed_is_read_by_its_target(tmp_path):
    """What is spoilt is sound before, or else nothing deep would ever be reached."""
    unsound = []
    seeds = all_seeds()
    for name, target in TARGETS.items():
        if target.share < 1:  # built, planned and run: slow, and read above
            continue
        for number, seed in enumerate(seeds[target.kind]):
            folder = tmp_path / name / str(number)
            problems = (
                [] if seed.is_case else tried(target, Trial(name, seed.files, seed.spoilt).write(folder))
            )
            unsound += [f"{name} {seed.name}: {each}" for each in problems if "unused" not in each.message]
    assert unsound == []


def test_a_number_makes_the_same_file_again():
    seeds = all_seeds()["scenario"]
    mutator = Mutator(seeds)
    for number in range(50):
        first, second = (mutator.spoil(seeds[0], Random(f"7/{number}")) for _ in range(2))
        assert first == second
