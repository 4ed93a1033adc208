"""The folder of a sweep: what lies in it, how it is read back, and what is said of one that is no use."""

from __future__ import annotations

import json
import re

import pyarrow as pa
import pyarrow.parquet
import pytest

from circuitkit.base.errors import CircuitkitError
from circuitkit.study import make_study
from circuitkit.study.identity import identity_of
from circuitkit.study.results import Results
from circuitkit.study.store import OtherStudyError, Store

STUDY = make_study(
    {
        "study": "small",
        "scenario": "nao_stands",
        "seeds": {"first": 0, "count": 2},
        "axes": {"push.direction": ["left", "back"]},
    }
)
IDENTITY = identity_of({"a": 1}, {"tune": {"a": 1}}, [])


def row(direction: str, seed: int) -> dict:
    return {"push.direction": direction, "seed": seed, "survived": True, "key": f"{direction}-{seed}"}


@pytest.fixture
def store(tmp_path):
    """Three runs in two batches, of which one came twice."""
    made = Store(tmp_path)
    assert made.begin(STUDY, IDENTITY, resume=False) == {}
    made.add(STUDY, [row("back", 0), row("left", 1)])
    made.add(STUDY, [row("left", 0)])
    made.add(STUDY, [row("left", 1), row("back", 0)])
    return made


def told(call) -> str:
    with pytest.raises(CircuitkitError) as caught:
        call()
    return str(caught.value)


def test_each_batch_is_a_file_and_each_run_is_there_once(store):
    files = sorted(path.name for path in (store.folder / "parts").iterdir())
    assert len(files) == 2
    assert all(re.fullmatch(r"part-[0-9a-f]{16}\.parquet", name) for name in files)
    assert store.count() == 3
    assert store.names == ("results.parquet", "study.json", "parts")


def test_rows_are_read_in_the_order_of_the_study(store):
    results = store.results()
    assert [each["key"] for each in results.rows] == ["left-0", "left-1", "back-0"]
    assert not results.complete
    store.finish(Results(STUDY, results.rows))
    assert sorted(path.name for path in store.folder.iterdir()) == ["results.parquet", "study.json"]
    assert store.results().complete
    assert store.results().rows == results.rows


def test_what_was_asked_lies_there_as_a_text(store):
    text = (store.folder / "study.json").read_text(encoding="utf-8")
    manifest = {"format": 2, "study": STUDY.document.data, "identity": IDENTITY.as_json()}
    assert text == json.dumps(manifest, indent=2) + "\n"


def test_a_sweep_goes_on_with_what_is_there_only_when_it_is_told_to(store):
    assert sorted(store.begin(STUDY, IDENTITY, resume=True)) == ["back-0", "left-0", "left-1"]
    assert told(lambda: store.begin(STUDY, IDENTITY, resume=False)) == (
        f"'{store.folder}' has 3 runs of the study 'small'; go on with them by --resume (resume=True), or "
        "name another folder"
    )
    other = identity_of({"a": 2}, {"tune": {"a": 2}}, [])
    assert told(lambda: store.begin(STUDY, other, resume=True)) == (
        f"cannot go on in '{store.folder}', for its runs are others: tune: a was 1, is 2; undo that, or name "
        "another folder"
    )


@pytest.mark.parametrize("name", ["results.parquet", "parts"])
def test_results_of_nobody_knows_what_are_not_gone_on_with(store, name):
    (store.folder / "study.json").unlink()
    if name == "results.parquet":
        (store.folder / "parts").rename(store.folder / name)
    assert told(lambda: store.begin(STUDY, IDENTITY, resume=True)) == (
        f"'{store.folder}' has results, but no study.json that says of what; name another folder"
    )


def test_a_sweep_that_was_stopped_before_its_first_batch_begins_anew(tmp_path):
    store = Store(tmp_path)
    for _ in range(2):
        assert store.begin(STUDY, IDENTITY, resume=False) == {}
    other = identity_of({"a": 2}, {"tune": {"a": 2}}, [])
    assert "has 0 runs of the study 'small'" in told(lambda: store.begin(STUDY, other, resume=False))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "there are no results of a sweep in '{0}'; allowed: the folder that a sweep wrote"),
        ("[]", "'{0}/study.json' has the format None, of another version; allowed: 2"),
        ('{"format": 2}', "'{0}/study.json' has the format 2, of another version; allowed: 2"),
        ('{"format": 3, "study": {}}', "'{0}/study.json' has the format 3, of another version; allowed: 2"),
    ],
)
def test_a_folder_of_another_kind_is_told(store, text, said):
    (store.folder / "study.json").write_text(text, encoding="utf-8")
    assert told(store.results) == said.format(store.folder)


def test_a_study_that_is_none_is_told_with_the_file(store):
    (store.folder / "study.json").write_text('{"format": 2, "study": {"study": "s"}}', encoding="utf-8")
    with pytest.raises(OtherStudyError) as caught:
        store.results()
    said = str(caught.value)
    assert said.startswith(f"{store.folder / 'study.json'}:1:1: study: is damaged: missing key 'scenario'; ")
    assert said.endswith("; name another folder")


def test_rows_of_another_study_are_told_with_the_folder(store):
    path = store.folder / "study.json"
    path.write_text(path.read_text(encoding="utf-8").replace('"back"', '"forward"'), encoding="utf-8")
    assert told(store.results) == (
        f"{store.folder}:1:1: its rows do not fit the study in 'study.json'; name another folder"
    )


def test_a_sealed_file_that_is_no_table_is_told(store):
    file = store.folder / "parts" / "part-0.parquet"
    Store._write(file, pa.table({"key": ["a"]}))
    content = file.read_bytes()
    file.write_bytes(content[:-8])
    remedy = "take it away, and --resume runs what it held again"
    assert told(store.results) == (
        f"'{file}' is damaged: its bytes are not those that were written; {remedy}"
    )
    file.unlink()
    file.mkdir()
    said = told(store.results)
    assert said.startswith(f"cannot read '{file}': {file}:1:1: found a folder; allowed: ")
    assert said.endswith(f"; {remedy}")


def test_files_say_their_checksum_and_are_compressed(store):
    file = next((store.folder / "parts").iterdir())
    found = pyarrow.parquet.read_metadata(file)
    assert found.metadata[b"checksum"].startswith(b"circuitkit-seal:")
    assert found.row_group(0).column(0).compression == "ZSTD"
