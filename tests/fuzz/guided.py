"""`make fuzz GUIDED=KIND`: libFuzzer goes on with files that reach new code; needs `pip install atheris`."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
from pathlib import Path
from random import Random

_MODULES = ("circuit.resolving.projections", "simulation", "study", "biped.gait")


def main(kind: str, seconds: str) -> None:
    """Spoil files of a kind for some time; keep the first one of every finding in out/fuzz/guided."""
    try:
        atheris = importlib.import_module("atheris")
    except ImportError:
        sys.exit("fuzz: coverage comes from the package 'atheris'; install it with: pip install atheris")
    with atheris.instrument_imports(include=["circuitkit"]):
        for name in _MODULES:
            importlib.import_module(f"circuitkit.{name}")
        from fuzz.findings import Trial, judged  # after the line above, which prepares what they import
        from fuzz.mutation import Mutator
        from fuzz.seeds import Seed, all_seeds
        from fuzz.targets import TARGETS

    seeds = all_seeds()
    own = [seed for seed in seeds[TARGETS[kind].kind] if len(seed.files) == 1] or seeds[TARGETS[kind].kind]
    mutator = Mutator([each for found in seeds.values() for each in found])
    place = Path(tempfile.mkdtemp(prefix="fuzz-"))
    out, keys = Path("out/fuzz/guided"), set()

    def spoil(data: bytes, most: int, number: int) -> bytes:
        random = Random(number)
        if random.random() < 0.2:
            return atheris.Mutate(data, most)
        files = {**own[0].files, own[0].spoilt: data}
        return mutator.spoil(Seed("", files, own[0].spoilt), random)[:most]

    def judge(data: bytes) -> None:
        trial = Trial(kind, {**own[0].files, own[0].spoilt: data}, own[0].spoilt)
        found = judged(trial, place)
        if found is not None and found.key not in keys:
            keys.add(found.key)
            trial.write(out / f"{len(keys):03d}")
            sys.stderr.write(f"found {found.key}: {found.message}\n")

    corpus = out / "corpus" / kind
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(own):
        (corpus / str(number)).write_bytes(seed.files[seed.spoilt])
    words = [f"-max_total_time={seconds}", "-max_len=20000", "-rss_limit_mb=4096", "-timeout=20"]
    atheris.Setup(["fuzz", *words, os.fspath(corpus)], judge, custom_mutator=spoil)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
