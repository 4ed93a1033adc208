"""What is spoilt: the shipped files, those of the tests and of the documents, and some that are made here."""

from __future__ import annotations

import io
import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import small_robots
import small_tuning
import yaml

TESTS = Path(__file__).parents[1]
TOP = TESTS.parent

# A circuit around a matrix file, and one around an included circuit.
AROUND_A_MATRIX = """\
circuit: around
control_step: 1 ms
timing: ordered
inputs:
  drive: {unit: "1", range: [0, 1]}
populations:
  ring: {size: 3, model: leaky_linear, role: excitatory, tau: 10 ms}
projections:
  - {from: drive, to: ring, connect: all_to_all, weight: 1}
  - {from: ring, to: ring, connect: {matrix: FILE}, weight: 0.1}
outputs:
  out: {unit: "1", readout: {"ring[0]": 1}}
"""
INCLUDING = """\
circuit: around
control_step: 10 ms
timing: ordered
include: [part.yaml]
"""
# The circuit of tables of inputs.
DRIVEN = "binn_lateral"


@dataclass(frozen=True)
class Seed:
    """A valid set of files.

    Attributes:
        name: Where it is from.
        files: The files by name.
        spoilt: Name of the one that is spoilt.
        is_case: Whether it is wrong already, and was answered badly once.
    """

    name: str
    files: Mapping[str, bytes]
    spoilt: str
    is_case: bool = False

    @property
    def is_yaml(self) -> bool:
        """Whether what is spoilt is YAML."""
        return self.spoilt.endswith(".yaml")


def all_seeds(cases: str | None = None) -> dict[str, list[Seed]]:
    """The seeds by kind of file, with those of a folder of files that failed once."""
    found: dict[str, list[Seed]] = {
        "circuit": [_alone(path) for path in _circuits()],
        "include": [_included(path) for path in _circuits() if path.parent.name == "circuits"],
        "model": [_alone(path) for path in sorted(TOP.glob("circuitkit/circuit/models/*/*.yaml"))],
        "matrix": list(_matrices()),
        "scenario": [_alone(path) for path in sorted(TOP.glob("sims/*.yaml"))],
        "robot": [_robot(path, "robot.yaml") for path in sorted(TOP.glob("robots/*"))],
        "mjcf": [_robot(path, f"{path.name}.xml") for path in sorted(TOP.glob("robots/*"))],
        "gait": [_alone(path) for path in sorted(TOP.glob("sims/gaits/*.yaml"))],
        "controller": [_alone(path) for path in sorted(TOP.glob("sims/controllers/*.yaml"))],
        "study": [_alone(path) for path in sorted(TOP.glob("sims/studies/*.yaml")) if not _tunes(path)],
        "tuning": [_alone(path) for path in sorted(TOP.glob("sims/studies/*.yaml")) if _tunes(path)],
        "inputs": list(_tables()),
        "results": list(_results()),
    }
    file = yaml.safe_dump({"robot": "cart", "mjcf": "cart.xml", **small_robots.CART_FILE}, sort_keys=False)
    cart = {"robot.yaml": file.encode(), "cart.xml": small_robots.CART.encode()}
    found["robot"].append(Seed("small_robots", cart, "robot.yaml"))
    found["mjcf"].append(Seed("small_robots", cart, "cart.xml"))
    tuning = {"spoilt.yaml": small_tuning.SMALL.encode(), "base.yaml": small_tuning.BASE.encode()}
    found["tuning"].append(Seed("small_tuning", tuning, "spoilt.yaml"))
    for path in sorted(Path(cases).glob("*.yaml")) if cases else ():
        text = path.read_text("utf-8", "replace")
        kind = next(
            (kind for kind in ("circuit", "study", "scenario") if text.startswith(f"{kind}:")), "circuit"
        )
        found[kind].append(replace(_alone(path), is_case=True))
    return found


def _circuits() -> list[Path]:
    places = ("circuits/*.yaml", "docs/models/examples/*/*.yaml", "tests/mistakes/bases/*/circuit.yaml")
    return [path for place in places for path in sorted(TOP.glob(place))]


def _tunes(path: Path) -> bool:
    return "\ntune:" in path.read_text("utf-8")


def _alone(path: Path) -> Seed:
    return Seed(path.name, {**_named_by(path), "spoilt.yaml": path.read_bytes()}, "spoilt.yaml")


def _included(path: Path) -> Seed:
    files = {**_named_by(path), "main.yaml": INCLUDING.encode(), "part.yaml": path.read_bytes()}
    return Seed(path.name, files, "part.yaml")


def _named_by(path: Path) -> dict[str, bytes]:
    """The files beside a circuit that it includes or loads, and those that these include."""
    found: dict[str, bytes] = {}
    waiting = [path]
    while waiting:
        text = re.sub("#.*", "", waiting.pop().read_text("utf-8", "replace"))
        for name in re.findall(r"[\w/]+\.(?:yaml|csv|npz|parquet)", text):
            other = path.parent / name
            if name not in found and other.is_file() and other != path:
                found[name] = other.read_bytes()
                waiting.append(other)
    return found


def _robot(folder: Path, spoilt: str) -> Seed:
    return Seed(folder.name, {path.name: path.read_bytes() for path in folder.iterdir()}, spoilt)


def _around(name: str, data: bytes, of: str) -> Seed:
    main = AROUND_A_MATRIX.replace("FILE", name)
    return Seed(of, {"main.yaml": main.encode(), name: data}, name)


def _matrices() -> Iterator[Seed]:
    from scipy import sparse

    table = np.array([[0.0, 0.5, 0.0], [0.25, 0.0, 1.0], [0.0, 0.0, 0.125]])
    rows = "\n".join(",".join(map(str, row)) for row in table)
    yield _around("m.csv", rows.encode(), "dense")
    yield _around("m.csv", b"source,target,weight\n0,1,0.5\n2,0,1\n", "edges")
    yield replace(_around("m.csv", b'"source","target"\n0,1\n2,0\n', "quoted"), is_case=True)
    for name, save in (("savez", np.savez), ("compressed", np.savez_compressed)):
        file = io.BytesIO()
        save(file, w=table)
        yield _around("m.npz", file.getvalue(), name)
    for form in ("csr", "csc", "coo", "bsr", "dia"):
        file = io.BytesIO()
        sparse.save_npz(file, getattr(sparse, f"{form}_matrix")(table), compressed=False)
        yield _around("m.npz", file.getvalue(), form)
    yield _around(
        "m.parquet", _parquet({"source": [0, 2], "target": [1, 0], "weight": [0.5, 1.0]}), "parquet"
    )


def _parquet(columns: Mapping[str, object]) -> bytes:
    import pyarrow
    import pyarrow.parquet

    file = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(columns), file)
    return file.getvalue()


def _tables() -> Iterator[Seed]:
    header = "time_s,zmp_y,force_difference\n"
    rows = "".join(f"{0.01 * n:g},{n} mm,{0.1 * n:g}\n" for n in range(5))
    yield Seed("table", {"t.csv": (header + rows).encode()}, "t.csv")
    yield Seed("quoted", {"t.csv": b'"zmp_y"\n"1 mm"\n"-2e-3 m"\n70\n'}, "t.csv")


def _results() -> Iterator[Seed]:
    """The folder of a sweep of two short runs, finished, and stopped after the first."""
    from circuitkit.study import make_study, sweep

    study = {
        "study": "short",
        "scenario": "vehicle_avoids",
        "set": {"duration": "50 ms"},
        "seeds": {"count": 2},
    }
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "out"
        sweep(make_study(study), folder, workers=1, progress=False, batch=1)
        files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.*")}
    yield Seed("manifest", files, "study.json")
    yield Seed("finished", files, "results.parquet")
    part = {"study.json": files["study.json"], "parts/part-0.parquet": files["results.parquet"]}
    yield Seed("stopped", part, "parts/part-0.parquet")
