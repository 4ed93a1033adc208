"""The identity of runs: whatever determines them changes it and is named, and nothing else does."""

from __future__ import annotations

import copy
import hashlib
import json
import os
import pickle
import shutil
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel
from small_robots import CART_FILE, robot_file
from small_tuning import written

from circuitkit.base.errors import CircuitkitError, InputError
from circuitkit.base.units import parse_quantity
from circuitkit.circuit import parse_circuit
from circuitkit.robots import load_robot
from circuitkit.robots.mjcf import compile_mjcf, read_mjcf
from circuitkit.robots.mjcf_identity import compiled_sum, mjcf_files
from circuitkit.study import cases, make_study, open_workers, read_results, sweep
from circuitkit.study.cases import plan_of
from circuitkit.study.identity import Identity, Part, _version, identity_of, robot_parts, unpacked, versions
from circuitkit.study.plain import _SI, differences, digest, plain
from circuitkit.study.scheduler import CasesByCell
from circuitkit.study.tuning import run as tuning_run
from circuitkit.study.tuning.spec import TRAIN, load_tuning
from circuitkit.study.workers import Job, WorkerError, run_job

INCLUDING = """<mujoco><!-- a cart --><compiler meshdir="meshes"/><include file="parts.xml"/>
<asset><mesh name="box" file="box.obj"/></asset><extension/>
<worldbody><body name="cart" pos="0 0 1"><joint name="slide" type="slide" axis="1 0 0"/>
<geom type="mesh" mesh="box" contype="0"/></body></worldbody>
<actuator><motor name="motor" joint="slide" ctrlrange="-20 20"/></actuator></mujoco>"""
PARTS = """<mujoco><worldbody><body name="tool"><geom name="tip" size=".1" pos="0 0 3"/></body></worldbody>
</mujoco>"""
BOX = "v 0 0 0\nv {0} 0 0\nv 0 {0} 0\nv 0 0 {0}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
FILE = {
    "channels": {"place": {"unit": "m", "is": "joint(slide)"}},
    "commands": CART_FILE["commands"],
}
SCENARIO = {
    "scenario": "glides",
    "robot": "robot/robot.yaml",
    "control_step": "10 ms",
    "duration": "200 ms",
    "disturbances": [
        {
            "push": {
                "body": "cart",
                "force": "2 N",
                "duration": "50 ms",
                "direction": "forward",
                "start": "50 ms",
            }
        },
        {"noise": {"channel": "place", "std": "1 mm"}},
    ],
    "measures": {"furthest": "max(abs(place))"},
}


@pytest.fixture
def lab(tmp_path):
    """A folder with a robot whose MJCF includes and loads, a scenario, and a study of two seeds."""
    path = robot_file(tmp_path / "robot", INCLUDING, **FILE)
    (path.parent / "parts.xml").write_text(PARTS)
    (path.parent / "meshes").mkdir()
    (path.parent / "meshes" / "box.obj").write_text(BOX.format(0.1))
    write(tmp_path / "glides.yaml", SCENARIO)
    return tmp_path


def write(path: Path, data: object) -> None:
    path.write_text(yaml.safe_dump(data, sort_keys=False))


def study_of(lab: Path, **keys: object):
    data = {"study": "small", "scenario": str(lab / "glides.yaml"), "seeds": {"count": 2}}
    return make_study(data | keys)


def identity(lab: Path, **keys: object) -> Identity:
    return CasesByCell(study_of(lab, **keys)).identity()


def edited(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


# --- plain data ---------------------------------------------------------------------------------------------

leaves = st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-9, 9) | st.text("abc", max_size=3)
trees = st.recursive(
    leaves,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("pqr"), inner),
    max_leaves=9,
)


def places(data, at=()):
    """The places of all leaves."""
    if isinstance(data, dict):
        return [place for key, each in data.items() for place in places(each, (*at, key))]
    if isinstance(data, list):
        return [place for i, each in enumerate(data) for place in places(each, (*at, i))]
    return [at]


def put(data, place, value):
    if not place:
        return value
    changed = copy.deepcopy(data)
    inner = changed
    for part in place[:-1]:
        inner = inner[part]
    inner[place[-1]] = value
    return changed


def text_of(place) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).removeprefix(".")


@given(trees, st.data())
@settings(max_examples=200, deadline=None)
def test_any_changed_leaf_changes_the_checksum_and_is_named(tree, data):
    found = places(tree)
    if not found:
        return
    place = data.draw(st.sampled_from(found))
    other = put(tree, place, "other")
    assert digest(other) != digest(tree)
    (said,) = differences(tree, other)
    assert said.startswith(f"{text_of(place)} was ".lstrip())
    assert said.endswith(', is "other"')
    assert not list(differences(tree, copy.deepcopy(tree)))


@given(trees)
def test_the_order_of_keys_does_not_count(tree):
    def turned(data):
        if isinstance(data, dict):
            return {key: turned(each) for key, each in reversed(data.items())}
        return [turned(each) for each in data] if isinstance(data, list) else data

    assert digest(turned(tree)) == digest(tree)


def test_what_is_new_gone_moved_or_long_is_said_so():
    named = [{"name": "a", "x": 1}, {"name": "b", "x": 2}]
    assert list(differences({"n": named}, {"n": named[::-1]})) == ["n has another order"]
    assert list(differences({"n": named}, {"n": [named[0], {"name": "b", "x": 3}]})) == ["n[b].x was 2, is 3"]
    assert list(differences({"a": 1}, {"b": 2})) == ["a is gone: it was 1", "b is new: 2"]
    first, second = "x" * 70 + "1", "x" * 70 + "2"
    assert list(differences({"a": first}, {"a": second})) == [f'a was "{first}", is "{second}"']
    (cut,) = differences({"a": first}, {"a": 1})
    assert cut == f'a was "{"x" * 59}…, is 1'
    assert list(differences([1], 2)) == ["was [1], is 2"]
    sums = [{"sha256": "1"}, {"sha256": "2"}]
    assert list(differences({"m": sums[0]}, {"m": sums[1]})) == ["m says something else"]
    assert list(differences({"m": sums[0]}, {"m": 1})) == ['m was {"sha256": "1"}, is 1']


def test_values_of_every_type_are_plain_data():
    long = np.arange(17.0)
    found = plain(
        {"f": np.float64(0.5), "i": np.int64(2), "nan": float("nan"), "few": np.eye(2), "s": {"b", "a"}}
    )
    assert found == {"f": 0.5, "i": 2, "nan": "nan", "few": [[1.0, 0.0], [0.0, 1.0]], "s": ["a", "b"]}
    assert plain(np.arange(16)) == list(range(16))
    assert plain(long)["array"] == "17 float64"
    assert plain(long) == plain(long.copy()) != plain(long + 1)
    assert plain(long) != plain(long.astype(np.float32))
    assert digest(plain(parse_quantity("200 ms"))) == digest(plain(parse_quantity("0.2 s")))
    assert digest(plain(parse_quantity("1 s"))) != digest(plain(parse_quantity("1 m")))
    assert plain(parse_quantity("200 ms"))["as"] == "200 ms"
    assert plain(Part("x", dict)) == {"class": "circuitkit.study.identity.Part"}


@dataclass(frozen=True)
class Thing:
    """Something with words, and with a place that does not count."""

    size: float
    description: str = "words"
    place: int = field(default=1, compare=False)


def test_words_and_places_are_left_out_and_names_that_only_look_like_words_are_not():
    assert plain([Thing(0.5)]) == [{"size": 0.5}]
    assert plain({"description": "a channel of this name"}) == {"description": "a channel of this name"}
    graph = parse_circuit(CIRCUIT)
    model = graph.neurons[0].model
    told = replace(graph.neurons[0], model=replace(model, description="Words.", source="A book."))
    assert plain(replace(graph, neurons=(told,))) == plain(graph)
    # Two models of one name stand for themselves.
    other = replace(graph.neurons[0], name="m", model=replace(model, increasing=("slope",)))
    both = plain(replace(graph, neurons=(*graph.neurons, other)))
    assert [each["model"] for each in both["neurons"]] == ["sigmoid", "sigmoid'"]
    assert both["models"]["sigmoid'"]["increasing"] == ["slope"]


def test_words_within_models_of_files_are_left_out(lab):
    path = lab / "robot" / "robot.yaml"
    before = plain(load_robot(path))
    edited(path, "is: joint(slide)", "is: joint(slide)\n    description: Where it is.")
    assert plain(load_robot(path)) == before
    assert "description" not in before["channels"]["place"]


class Piece(BaseModel):
    """A part of a file."""

    description: str = ""
    size: float = 1.0


class Whole(BaseModel):
    """A file with parts in a list and by name."""

    many: list[Piece] = []
    named: dict[str, Piece] = {}


@pytest.mark.parametrize("whole", [lambda each: Whole(many=[each]), lambda each: Whole(named={"a": each})])
def test_words_of_parts_are_left_out_and_their_numbers_are_not(whole):
    assert plain(whole(Piece(description="thick"))) == plain(whole(Piece(description="thin")))
    assert plain(whole(Piece(size=2.0))) != plain(whole(Piece()))


def test_letters_of_all_languages_are_shown_as_they_are():
    assert list(differences({"name": "Käfer"}, {"name": "甲虫"})) == ['name was "Käfer", is "甲虫"']


def test_versions_are_those_that_are_installed():
    assert _version("numpy") == np.__version__
    assert _version("no such distribution") == "not installed"


def test_quantities_that_look_alike_are_told_apart_by_all_digits():
    first, second = (plain(parse_quantity(text)) for text in ("1 s", "1.0000000001 s"))
    assert list(differences({"t": first}, {"t": second})) == ["t was 1.0 s, is 1.0000000001 s"]


# --- circuits -----------------------------------------------------------------------------------------------

CIRCUIT = """\
circuit: one
description: words
control_step: 10 ms
timing: ordered
parameters: {w: 2 deg}
inputs: {x: {unit: mm, range: [-100 mm, 100 mm]}}
neurons:
  n: {model: sigmoid, slope: 30 /m, shift: 5 mm, role: excitatory}
synapses:
  - {from: x, to: n, weight: 1}
outputs:
  y: {unit: deg, readout: {n: w}, limits: [-10 deg, 10 deg]}
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("w: 2 deg", "w: 3 deg", "parameters.w was 2 deg, is 3 deg"),
        ("slope: 30 /m", "slope: 40 /m", "neurons[n].parameters.slope was 30.0, is 40.0"),
        ("weight: 1}", "weight: 2}", "synapses[x -> n].weight was 1.0, is 2.0"),
        ("[-10 deg", "[-20 deg", "outputs[y].low was "),
        ("timing: ordered", "timing: synchronous", 'timing was "ordered", is "synchronous"'),
        ("control_step: 10 ms", "control_step: 20 ms", "step_s was 0.01, is 0.02"),
    ],
)
def test_what_a_circuit_says_is_named(old, new, said):
    before, after = plain(parse_circuit(CIRCUIT)), plain(parse_circuit(CIRCUIT.replace(old, new)))
    assert digest(before) != digest(after)
    assert any(each.startswith(said) for each in differences(before, after))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("description: words", "description: other words"),
        ("control_step: 10 ms", "control_step: 0.01 s  # a comment"),
        ("shift: 5 mm, role: excitatory", "role: excitatory, shift: 0.5 cm"),
    ],
)
def test_words_comments_order_and_spelling_of_a_circuit_do_not_count(old, new):
    assert digest(plain(parse_circuit(CIRCUIT.replace(old, new)))) == digest(plain(parse_circuit(CIRCUIT)))


# --- scenarios, robots and studies --------------------------------------------------------------------------


def test_every_number_and_name_of_a_scenario_changes_the_identity_and_is_named(lab):
    first = identity(lab)
    changes = {
        "duration": (("duration",), "0.3 s", "the scenario: duration was 0.2 s, is 0.3 s"),
        "noise": (("disturbances", 1, "noise", "std"), "2 mm", "disturbances[1].noise.std was 1 mm, is 2 mm"),
        "force": (("disturbances", 0, "push", "force"), "3 N", "disturbances[0].push.force was 2 N, is 3 N"),
        "body": (("disturbances", 0, "push", "body"), "tool", 'push.body was "cart", is "tool"'),
        "start": (("disturbances", 0, "push", "start"), "60 ms", "push.start was 0.05, is 0.06"),
        "step": (("control_step",), "20 ms", "control_step was 0.01 s, is 0.02 s"),
        "measure": (
            ("measures", "furthest"),
            "max(place)",
            'measures.furthest was "max(abs(place))", is "max(place)"',
        ),
        "until": (("until",), "place > 1 m", 'until was null, is "place > 1 m"'),
        "fewer": (("disturbances",), SCENARIO["disturbances"][:1], "disturbances[1] is gone: it was "),
    }
    keys = {CasesByCell(study_of(lab))(0, 0).key}
    for place, value, said in changes.values():
        write(lab / "glides.yaml", put(SCENARIO, place, value))
        assert said in identity(lab).differences(first.as_json())
        keys.add(CasesByCell(study_of(lab))(0, 0).key)
    assert len(keys) == len(changes) + 1


def test_comments_order_spelling_words_and_paths_do_not_count(lab):
    first, key = identity(lab), CasesByCell(study_of(lab))(0, 0).key
    turned = dict(reversed(SCENARIO.items())) | {
        "description": "Words.",
        "scenario": "another",
        "duration": "0.2 s",
    }
    turned["disturbances"] = [
        {
            "push": {
                "start": "0.05 s",
                "direction": "forward",
                "duration": "0.05 s",
                "force": "0.002 kN",
                "body": "cart",
            }
        },
        {"noise": {"std": "0.001 m", "channel": "place"}},
    ]
    text = "# a comment\n" + yaml.safe_dump(turned, sort_keys=False)
    (lab / "glides.yaml").write_text(text)
    edited(lab / "robot" / "model.xml", "<!-- a cart -->", "\n   ")
    edited(lab / "robot" / "model.xml", 'pos="0 0 1"', 'pos="0  0.0 1."')
    edited(lab / "robot" / "robot.yaml", "robot: small", "# words\nrobot: small\ndescription: A cart.")
    assert identity(lab).digest == first.digest
    shutil.copytree(lab, lab / "copy", ignore=shutil.ignore_patterns("copy"))
    other = identity(lab / "copy", description="a study of words")
    assert other.differences(first.as_json()) == ""
    assert CasesByCell(study_of(lab / "copy"))(0, 0).key == key


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("parts.xml", 'size=".1"', 'size=".2"', "parts.xml, which model.xml includes: "
         "mujoco[0].worldbody[0].body[tool].geom[tip].size was \"0.1\", is \"0.2\""),
        ("meshes/box.obj", "v 0.1", "v 0.2", "meshes/box.obj, which model.xml loads says something else"),
        ("robot.yaml", "motor: 1", "motor: 2", "robot/robot.yaml: commands.force.to.motor was 1.0, is 2.0"),
        ("model.xml", "-20 20", "-10 20", "actuator[0].motor[motor].ctrlrange was"),
    ],
)  # fmt: skip
def test_what_the_robot_includes_and_loads_is_refused_and_named_by_resume(lab, file, old, new, said):
    out = lab / "out"
    first = sweep(study_of(lab), out, workers=1, progress=False)
    before = CasesByCell(study_of(lab))(0, 0).key
    path = lab / "robot" / file
    times = path.stat()
    edited(path, old, new)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    with pytest.raises(InputError) as caught:
        sweep(study_of(lab), out, workers=1, resume=True, progress=False)
    assert said in str(caught.value)
    assert "undo that, or name another folder" in str(caught.value)
    again = sweep(study_of(lab), lab / "again", workers=1, progress=False)  # in the same process
    assert not {row["key"] for row in first.rows} & {row["key"] for row in again.rows}
    assert before == first.rows[0]["key"].rpartition("-")[0]
    edited(path, new, old)
    assert sweep(study_of(lab), out, workers=1, resume=True, progress=False).rows == first.rows


def test_an_edited_mesh_is_compiled_anew_within_the_same_second(lab):
    path, mesh = lab / "robot" / "model.xml", lab / "robot" / "meshes" / "box.obj"
    masses = []
    for size in (0.1, 0.2):
        mesh.write_text(BOX.format(size))
        os.utime(mesh, (10**9, 10**9))
        masses.append(compile_mjcf(read_mjcf(path), path).body("cart").mass[0])
    assert masses[1] == pytest.approx(8 * masses[0])


def test_files_that_files_name_are_found_wherever_they_lie(tmp_path):
    (tmp_path / "sub" / "tex").mkdir(parents=True)
    (tmp_path / "plain").write_text("no suffix")
    (tmp_path / "bare.txt").write_text("in the same folder")
    for name in ("sub/inner.xml", "sub/tex/deep.bin", "sub/set.json", "side.png", "none.bin"):
        (tmp_path / name).write_text(name)
    (tmp_path / "sub/inner.xml").write_text(
        '<mujoco><compiler texturedir="tex"/><a file="deep.bin"/></mujoco>'
    )
    (tmp_path / "sub/broken.xml").write_text('<mujoco><b file="../side.png">')
    (tmp_path / "top.xml").write_text(
        '<mujoco><include file="sub/inner.xml"/><plugin><config key="k" value="sub/set.json"/></plugin>'
        '<model file="sub/broken.xml"/><c file="gone.bin"/><d file="sub/none.bin" fileup="plain"/>'
        '<e at="bare.txt"/></mujoco>'
    )
    assert list(mjcf_files(tmp_path / "top.xml")) == [
        "top.xml", "sub/inner.xml, which top.xml includes", "sub/set.json, which top.xml loads",
        "sub/broken.xml, which top.xml attaches", "none.bin, which top.xml loads",
        "plain, which top.xml loads", "bare.txt, which top.xml loads",
        "sub/tex/deep.bin, which inner.xml loads", "side.png, which broken.xml loads",
    ]  # fmt: skip


def test_a_robot_that_changes_under_way_is_told_not_run(lab):
    cases._body.cache_clear()  # else the robot of another test, which was the same, would do
    case = CasesByCell(study_of(lab))(0, 0)
    assert case.key  # it was read
    edited(lab / "robot" / "parts.xml", 'size=".1"', 'size=".3"')
    with pytest.raises(CircuitkitError, match=r"or what it loads, has changed while its runs are under way"):
        run_job(Job(case, (case.spec(0),)))
    edited(lab / "robot" / "parts.xml", 'size=".3"', 'size=".1"')
    edited(lab / "robot" / "robot.yaml", "motor: 1", "motor: 2")
    with pytest.raises(CircuitkitError, match=r"robot robot/robot\.yaml has changed while its runs"):
        plan_of(case)


def test_workers_get_checksums_only_and_the_same_keys(lab):
    case = CasesByCell(study_of(lab))(0, 0)
    sent = pickle.loads(pickle.dumps(case))
    assert (sent.key, sent.shared_key, sent.body_key) == (case.key, case.shared_key, case.body_key)
    assert sent.parts["MJCF"].data == {}
    assert len(pickle.dumps(case)) < 20_000


def test_a_sweep_that_was_stopped_does_not_go_on_with_another_noise_and_never_mixes(lab):
    out = lab / "out"

    def stop(done, _):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(study_of(lab), out, workers=1, batch=1, progress=stop)
    kept = read_results(out)
    edited(lab / "glides.yaml", "std: 1 mm", "std: 2 mm")
    with pytest.raises(
        InputError, match=r"the scenario: disturbances\[1\]\.noise\.std was 1 mm, is 2 mm; undo"
    ):
        sweep(study_of(lab), out, workers=1, resume=True, progress=False)
    assert read_results(out).rows == kept.rows
    edited(lab / "glides.yaml", "std: 2 mm", "std: 0.1 cm # the same")
    assert len(sweep(study_of(lab), out, workers=1, resume=True, progress=False).rows) == 2


def test_the_manifest_holds_backend_and_versions_and_other_ones_are_named(lab, monkeypatch):
    out = lab / "out"
    sweep(study_of(lab), out, workers=1, progress=False)
    said = json.loads((out / "study.json").read_text())
    assert said["identity"]["data"]["versions"] == versions()
    assert said["identity"]["data"]["backend"] == {}  # nothing runs a circuit
    monkeypatch.setattr("circuitkit.study.identity.np.__version__", "0.1")
    with pytest.raises(InputError, match=f'versions: numpy was "{np.__version__.replace("0.1", ".*")}'):
        sweep(study_of(lab), out, workers=1, resume=True, progress=False)


def test_a_compiler_that_is_gone_is_named(lab, monkeypatch):
    text = CIRCUIT.replace("x:", "place:").replace("from: x", "from: place")
    text = text.replace("y: {unit: deg", "force: {unit: N").replace("deg", "N")
    (lab / "cells.yaml").write_text(text)
    study = study_of(lab, set={"circuit": str(lab / "cells.yaml"), "controller": "circuit"})
    out = lab / "out"
    sweep(study, out, workers=1, progress=False)
    data = json.loads((out / "study.json").read_text())["identity"]["data"]
    assert data["backend"] == {"circuit": "compiled"}
    case = CasesByCell(study)(0, 0)
    assert case.key
    monkeypatch.setattr("circuitkit.engine.backends.compiled_backend.build_kernel", lambda *_: "no compiler")
    with pytest.raises(InputError, match='backend: circuit was "compiled", is "numpy"; undo'):
        sweep(study, out, workers=1, resume=True, progress=False)
    monkeypatch.undo()
    case = CasesByCell(study)(0, 0)
    assert case.parts["backend"].data == {"circuit": "compiled"}
    monkeypatch.setattr("circuitkit.engine.backends.compiled_backend.build_kernel", lambda *_: "no compiler")
    with (
        open_workers(1) as workers,
        pytest.raises(WorkerError, match="by the backend circuit numpy; allowed"),
    ):
        workers.outcome(workers.submit(Job(case, (case.spec(0),))), case)


@pytest.mark.parametrize("found", [1, 3, None, "x"])
def test_a_folder_of_another_version_is_refused(lab, found):
    out = lab / "out"
    sweep(study_of(lab), out, workers=1, progress=False)
    said = json.loads((out / "study.json").read_text())
    (out / "study.json").write_text(json.dumps({**said, "format": found}))
    message = f"has the format {found}, of another version; allowed: 2"
    with pytest.raises(InputError, match=message):
        read_results(out)
    with pytest.raises(InputError, match=message):
        sweep(study_of(lab), out, workers=1, resume=True, progress=False)


def test_labels_seeds_and_search_of_a_study_count(lab):
    axes = {"push.force": ["1 N", "2 N"]}
    first = identity(lab, axes=axes)
    assert identity(lab, axes=axes, description="words").digest == first.digest
    assert "axes.push.force[1] was 2 N, is 3 N" in identity(
        lab, axes={"push.force": ["1 N", "3 N"]}
    ).differences(first.as_json())
    assert "study: seeds.count was 2, is 3" in identity(lab, axes=axes, seeds={"count": 3}).differences(
        first.as_json()
    )
    assert 'study: study was "small", is "other"' in identity(lab, axes=axes, study="other").differences(
        first.as_json()
    )


# --- many cases ---------------------------------------------------------------------------------------------


def parts(**data):
    return {kind: Part(kind, lambda each=each: each) for kind, each in data.items()}


def test_the_identity_of_many_tells_what_only_some_have():
    old = identity_of({}, {}, [("a", parts(c={"w": 1})), ("b", parts(c={"w": 2}))])
    new = identity_of({}, {}, [("a", parts(c={"w": 1})), ("b", parts(c={"w": 3}))])
    assert new.differences(old.as_json()) == "c says something else in some of the runs"
    swapped = identity_of({}, {}, [("b", parts(c={"w": 1})), ("a", parts(c={"w": 2}))])
    assert swapped.differences(old.as_json()) == "some of the runs are others"
    assert old.differences(old.as_json()) == ""
    assert old.differences(None) == "what it was is not known in detail"
    fewer = identity_of({}, {}, [("a", parts(d={"w": 1}))])
    assert fewer.differences(old.as_json()) == "c is no longer used; d is new"


def test_equal_plain_data_have_the_checksum_of_their_shortest_json():
    """So a checksum of today is that of tomorrow: SHA-256 of a text, by any other program."""
    data = {"ä": [1, 2.5, None], "a": {_SI: [0.2, "s"], "as": "200 ms"}}
    text = '{"a":[0.2,"s"],"ä":[1,2.5,null]}'
    assert digest(data) == hashlib.sha256(text.encode()).hexdigest()[:32]


def test_what_has_only_a_source_or_a_target_is_no_synapse():
    for key in ("source", "target"):
        old, new = ([{"name": "a", key: "s", "x": n}] for n in (1, 2))
        assert list(differences({"n": old}, {"n": new})) == ["n[a].x was 1, is 2"]


def test_texts_that_look_alike_where_they_are_cut_are_told_apart_as_they_are():
    old, new = "é" * 70 + "1", "é" * 70 + "2"
    assert list(differences({"a": old}, {"a": new})) == [f'a was "{old}", is "{new}"']


def test_the_parts_of_a_robot_have_their_titles(lab):
    robot = load_robot(lab / "robot" / "robot.yaml")
    found = robot_parts(robot, "r/robot.yaml")
    assert {kind: part.title for kind, part in found.items()} == {
        "robot": "robot r/robot.yaml",
        "MJCF": f"files of r/{robot.mjcf_path.name}",
        "model": f"what MuJoCo compiles of r/{robot.mjcf_path.name}",
    }
    assert "mjcf" not in found["robot"].data
    assert list(found["model"].data) == ["sha256"]


def test_names_of_parts_are_a_part_of_what_mujoco_compiles(lab):
    """Names are not among a model's numbers, and a formula may use them."""
    robot = load_robot(lab / "robot" / "robot.yaml")
    before = compiled_sum(robot.mjcf_path)
    edited(lab / "robot" / "parts.xml", 'name="tip"', 'name="tap"')
    assert compiled_sum(robot.mjcf_path) != before


def test_the_version_of_python_counts_without_its_last_number():
    assert versions()["python"] == f"{sys.version_info.major}.{sys.version_info.minor}"


def test_what_differs_only_in_words_of_others_is_told_as_other_runs():
    old, new = identity_of({"a": 1}, {"tune": {}}, []), identity_of({"a": 2}, {"tune": {}}, [])
    assert new.differences(old.as_json()) == "some of the runs are others"
    assert new.differences({"digest": "0", "data": {}}) == "what it was is not known in detail"


def test_six_differences_are_shown_and_the_others_counted():
    old, new = ({f"k{i}": i + n for i in range(n, 9)} for n in (0, 1))
    said = identity_of({}, {}, [("a", parts(c=new))]).differences(
        identity_of({}, {}, [("a", parts(c=old))]).as_json()
    )
    assert said.startswith("c: k0 is gone: it was 0; k1 was 1, is 2; k2 was 2, is 3; ")
    assert said.count(";") == 6
    assert said.endswith("; and 3 more")


def test_what_follows_from_a_file_is_told_only_where_no_file_differs():
    def both(text, model):
        made = {
            "MJCF": Part("files", lambda: {"m.xml": text}, Path()),
            "model": Part("what MuJoCo compiles of m.xml", lambda: {"sha256": model}),
        }
        return identity_of({}, {}, [("a", made)])

    old = both("1", "1").as_json()
    assert both("2", "2").differences(old) == 'm.xml was "1", is "2"'
    assert both("1", "2").differences(old) == "what MuJoCo compiles of m.xml says something else"


def test_an_identity_is_packed_into_a_text_that_databases_take():
    small = identity_of({}, {"tune": {"a": 1}}, [])
    assert unpacked(small.packed()) == small.as_json()
    assert unpacked("no such text") is None
    assert unpacked(None) is None
    noise = np.random.default_rng(0).bytes(100_000).hex()
    large = replace(small, data={"tune": noise})
    assert len(large.packed()) <= 60_000
    kept = unpacked(large.packed())
    assert (kept["digest"], kept["data"]) == (large.digest, {})
    assert large.differences(kept) == ""


# --- tunings ------------------------------------------------------------------------------------------------


def tuning_identity(path):
    tuning = load_tuning(path)
    return tuning_run._identity(tuning, tuning.runs(TRAIN))


def test_a_tuning_is_known_by_all_of_its_runs(tmp_path):
    gait = tmp_path / "mine.yaml"
    two = (
        "axes: {push.force: [10 N]}",
        f"axes: {{push.force: [10 N], reference.gait: [gait_march, {gait}]}}",
    )
    shutil.copy(Path("sims/gaits/gait_march.yaml"), gait)
    path = written(tmp_path, two)
    first = tuning_identity(path)
    edited(gait, "single_support: ", "single_support: 0.51 s # ")
    said = tuning_identity(path).differences(first.as_json())
    assert said == f"reference {gait}: gait.single_support was 0.5 s, is 0.51 s"
    shutil.copy(Path("sims/gaits/gait_march.yaml"), gait)
    edited(tmp_path / "base.yaml", "w: -0.5 deg", "w: -0.6 deg")
    said = tuning_identity(path).differences(first.as_json())
    assert "base.yaml: parameters.w was -0.5 deg, is -0.6 deg" in said
    assert "tune" not in said


def test_spelling_and_what_comes_after_the_search_do_not_count_in_a_tuning(tmp_path):
    first = tuning_identity(written(tmp_path))
    same = [
        ("trials: 3", "trials: 7 # more"),
        ("result: small_tuned", "result: other"),
        ("watch: 1 s", "watch: 1000 ms"),
        ("test: {seeds: {first: 0, count: 1}}", "test: {seeds: {first: 0, count: 2}}"),
    ]
    assert tuning_identity(written(tmp_path, *same)).differences(first.as_json()) == ""
    other = tuning_identity(
        written(tmp_path, ("sampler: tpe", "sampler: cmaes"), ("generation: 2", "generation: 4"))
    )
    assert other.differences(first.as_json()) == 'tune: sampler was "tpe", is "cmaes"; generation was 2, is 4'
