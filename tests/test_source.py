"""The strict YAML reader: traps refused or mended, every complaint with its place, and data that reads back."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import time
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field

from circuitkit.base.errors import InputError
from circuitkit.base.reading import not_a_name, not_a_text
from circuitkit.base.source import (
    FileModel,
    Mark,
    dump_yaml,
    find_data_file,
    parse_yaml,
    read_yaml,
    scan_text,
    shipped_names,
    validate_model,
)
from circuitkit.base.source.fields import AnyQuantity


def complaints(text: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        parse_yaml(text, "f.yaml")
    return str(caught.value).splitlines()


def test_scalars_are_what_they_look_like():
    text = "a: no\nb: on\nc: 1e-3\nd: '010'\ne: 2001-01-01\nf: ~\ng: -5\nh: +.5\ni: 5.\nyes: off\nk: true\nl: True\nm: 1.5E3\nn:\n"
    assert parse_yaml(text).data == {
        "a": "no", "b": "on", "c": 0.001, "d": "010", "e": "2001-01-01", "f": None, "g": -5, "h": 0.5, "i": 5.0,
        "yes": "off", "k": True, "l": "True", "m": 1500.0, "n": None,
    }  # fmt: skip


def test_every_part_has_its_place():
    document = parse_yaml("a: 1\nb:\n  - x\n  - {c: é, d: 2}\n")
    assert document.marks == {
        (): Mark(1, 1, 1, 1),
        ("a",): Mark(1, 4, 1, 1),
        ("b",): Mark(3, 3, 2, 1),
        ("b", 0): Mark(3, 5, 3, 5),
        ("b", 1): Mark(4, 5, 4, 5),
        ("b", 1, "c"): Mark(4, 9, 4, 6),
        ("b", 1, "d"): Mark(4, 15, 4, 12),
    }
    assert str(document.problem(("b", 1, "d"), "bad", at_key=True)) == "<text>:4:12: b[1].d: bad"
    assert str(document.problem(("b", 1, "gone"), "bad")) == "<text>:4:5: b[1].gone: bad"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\na: 2\n", "2:1: a: duplicate key 'a', first on line 1; allowed: each key once"),
        ("x:\n  a: 1\n  b: 1\n  a: 2\n", "4:3: x.a: duplicate key 'a', first on line 2; allowed: each key once"),
        ("a: 010\n", "1:4: a: found 010; allowed: a number without leading zeros (some take these for octal), or quotes for a text"),
        ("a: 1_000\n", "1:4: a: found 1_000; allowed: a number without underscores, or quotes for a text"),
        ("a: 1:30\n", "1:4: a: found 1:30; allowed: a decimal number (some take colons for base 60), or quotes for a text"),
        ("a: 0x1F\n", "1:4: a: found 0x1F; allowed: a decimal number, or quotes for a text"),
        ("a: 0o17\n", "1:4: a: found 0o17; allowed: a decimal number, or quotes for a text"),
        ("a: [1, .nan]\n", "1:8: a[1]: found .nan; allowed: a finite number"),
        ("a: -.inf\n", "1:4: a: found -.inf; allowed: a finite number"),
        ("a: 1e999\n", "1:4: a: found 1e999; allowed: a finite number"),
        (f"a: {'9' * 400}\n", "1:4: a: found 99999999999999999999…; allowed: a finite number"),
        ("a: !!int 3\n", "1:4: a: found the tag 'tag:yaml.org,2002:int'; allowed: values without tags"),
        ("a: !!python/name:os.system x\n", "1:4: a: found the tag 'tag:yaml.org,2002:python/name:os.system'; allowed: values without tags"),
        ("a: {<<: {b: 1}}\n", "1:5: a: found the merge key '<<'; allowed: every entry written out"),
        ("a: *b\n", "1:4: a: unknown alias '*b'; allowed: an anchor above it"),
        ("b: &base 1\na: *bas\n", "2:4: a: unknown alias '*bas'; allowed: an anchor above it; did you mean 'base'?"),
        ("a: &a [*a]\n", "1:8: a[0]: found an alias inside what it stands for; allowed: aliases that end"),
        ("? [a]\n: 3\n", "1:3: found a key that is no text; allowed: a name as key"),
        ("a: 1\n---\nb: 1\n", "2:1: found a second document; allowed: one document a file"),
        ("", "1:1: the file is empty; allowed: a mapping of keys and values"),
        ("# only a comment\n", "2:1: the file is empty; allowed: a mapping of keys and values"),
        ("a\x07: 1\n", "1:2: found the control character U+0007; allowed: printable text"),
        ("a:\n\t- b\n", "2:1: this is not YAML: found character that cannot start any token while scanning for the next token; indent with spaces, not with tabs"),
        ("a: %x\n", "1:4: this is not YAML: found character that cannot start any token while scanning for the next token; put a text that starts with % in quotes"),
        ("a: b: c\n", "1:5: this is not YAML: mapping values are not allowed in this context"),
        ("a: 'b\nc: 1\n", "1:4: this is not YAML: found unexpected end of stream while scanning a quoted scalar"),
        ("b: 2\na:1\nc: 3\n", "2:1: this is not YAML: could not find expected ':' while scanning a simple key"),
        ("a:\n  b: 1\n c: 2\n", "3:2: this is not YAML: did not find expected key while parsing a block mapping"),
        ("a: [1\n", "1:4: this is not YAML: did not find expected ',' or ']' while parsing a flow sequence"),
        (f"a: {'[' * 60}", "1:53: found lists or mappings nested too deep; allowed: 50"),
    ],
)  # fmt: skip
def test_what_is_refused_is_named_with_its_place(text, message):
    assert complaints(text) == [f"f.yaml:{message}"]


def test_all_problems_of_a_text_are_listed():
    assert [line.split(":")[1] for line in complaints("a: 010\nb: .inf\nb: 2\nc: !x 1\n")] == [
        "1",
        "2",
        "3",
        "4",
    ]


def test_a_broken_text_still_gives_its_data():
    document, problems = scan_text("a: 010\nb: 1\nb: 2\n", "f.yaml")
    assert document is not None
    assert document.data == {"a": "010", "b": 1}
    assert len(problems) == 2


@pytest.mark.parametrize("text", ["- " * 100_000, "[" * 100_000, "{a: " * 100_000])
def test_deep_nesting_does_not_crash(text):
    assert "nested too deep" in complaints(text)[0]


def test_aliases_cannot_explode():
    """Nine levels of ten aliases: a thousand million values from 600 characters."""
    levels = [
        f"{c}: &{c} [{', '.join([f'*{p}'] * 10)}]\n" for p, c in zip("abcdefgh", "bcdefghi", strict=True)
    ]
    start = time.perf_counter()
    found = complaints(f"a: &a [{', '.join('x' * 10)}]\n{''.join(levels)}")
    assert time.perf_counter() - start < 1
    assert found == ["f.yaml:6:8: found aliases that bring more than 200000 values; allowed: fewer"]


def test_aliases_stand_for_their_data():
    document = parse_yaml("a: &a {x: 1}\nb: [*a, *a]\n")
    assert document.data == {"a": {"x": 1}, "b": [{"x": 1}, {"x": 1}]}
    assert str(document.problem(("b", 1, "x"), "bad")) == "<text>:2:9: b[1].x: bad"


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "circuit.yaml").write_text("a: 1\n")
    (tmp_path / "latin.yaml").write_bytes(b"a: 1\nb: caf\xe9\n")
    (tmp_path / "bom.yaml").write_bytes("\ufeffa: ü\n".encode())
    cases = {
        "circiut.yaml": "1:1: there is no such file; allowed: a YAML file; did you mean 'circuit.yaml'?",
        "latin.yaml": "2:7: found the byte 0xe9, which is no UTF-8; allowed: a text file in UTF-8",
        "": "1:1: found a folder; allowed: a YAML file",
    }
    for name, message in cases.items():
        with pytest.raises(InputError) as caught:
            read_yaml(tmp_path / name)
        assert str(caught.value) == f"{tmp_path / name}:{message}"
    assert read_yaml(tmp_path / "bom.yaml").data == {"a": "ü"}


def test_shipped_files_are_found_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "binn_lateral" in shipped_names("circuits")
    assert find_data_file("binn_lateral", "circuits").is_file()
    assert str(find_data_file("a/b.yaml", "circuits")) == "a/b.yaml"
    with pytest.raises(InputError) as caught:
        find_data_file("binn_latral", "circuits")
    names = shipped_names("circuits")
    assert str(caught.value) == (
        "binn_latral:1:1: unknown name 'binn_latral'; allowed: a path, or one of the shipped circuits: "
        f"{', '.join(names[:20])} and {len(names) - 20} more; did you mean 'binn_lateral'?"
    )
    (tmp_path / "mine").write_text("a: 1\n")
    assert str(find_data_file("mine", "circuits")) == "mine"


class Push(FileModel):
    kind: Literal["push"]
    force: float = Field(gt=0)


class File(FileModel):
    name: str
    count: int = Field(ge=1)
    on: bool = False
    mode: Literal["ordered", "printed"] = "ordered"
    pair: tuple[float, float] = (0, 1)
    pushes: dict[str, Push] = Field(default_factory=dict)
    either: tuple[Push | str, ...] = ()
    source: str = Field(alias="from", default="")


def test_models_take_lists_for_tuples_and_whole_numbers_for_numbers():
    file = validate_model(
        parse_yaml("name: no\ncount: 3\npair: [1, 2.5e-3]\nfrom: off\neither: [a, {kind: push, force: 2}]"),
        File,
    )
    assert file == File.model_validate(
        {
            "name": "no",
            "count": 3,
            "pair": (1, 0.0025),
            "from": "off",
            "either": ("a", Push(kind="push", force=2.0)),
        }
    )


def test_a_part_of_a_document_can_be_a_model():
    document = parse_yaml("pushes:\n  a: {kind: push, force: 1}\n  b: {kind: push}\n", "f.yaml")
    assert validate_model(document, Push, ("pushes", "a")) == Push(kind="push", force=1)
    with pytest.raises(InputError) as caught:
        validate_model(document, Push, ("pushes", "b"))
    assert str(caught.value) == "f.yaml:3:3: pushes.b: missing key 'force'; required: kind, force"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("name: 5", "1:7: name: found 5; allowed: a text"),
        ("name: true", "1:7: name: found true; allowed: a text"),
        ("name:", "1:6: name: found nothing; allowed: a text"),
        ("name: x\non: yes", "2:5: on: found 'yes'; allowed: true or false"),
        ("name: x\ncount: 0", "2:8: count: found 0; allowed: at least 1"),
        ("name: x\ncount: '3'", "2:8: count: found '3'; allowed: a whole number"),
        ("name: x\nmode: orderd", "2:7: mode: found 'orderd'; allowed: ordered, printed; did you mean 'ordered'?"),
        ("name: x\npair: [1, 2, 3]", "2:7: pair: found a list of 3; allowed: at most 2"),
        ("name: x\npair: [1, true]", "2:11: pair[1]: found true; allowed: a number"),
        ("name: x\npair: {a: 1}", "2:7: pair: found a mapping of 1; allowed: a list"),
        ("name: x\nnmae: y", "2:1: nmae: unknown key 'nmae'; allowed: count, either, from, mode, name, on, pair, pushes; did you mean 'name'?"),
        ("name: x\npushes: {a: {kind: push}}", "2:10: pushes.a: missing key 'force'; required: kind, force"),
        ("name: x\npushes: {a: {kind: push, force: 1, by hand}}", "2:36: pushes.a.by hand: unknown key 'by hand'; allowed: force, kind; inside braces, put a text that contains a comma in quotes"),
        ("name: x\npushes: {a: {kind: pusj, force: 1}}", "2:20: pushes.a.kind: found 'pusj'; allowed: push; did you mean 'push'?"),
        ("name: x\neither: [3]", "2:10: either[0]: found 3; allowed: a mapping or a text"),
        ("name: x\neither: [{kind: push, force: x}]", "2:30: either[0].force: found 'x'; allowed: a number"),
    ],
)  # fmt: skip
def test_models_complain_in_the_words_of_the_file(line, message):
    text = line if "count" in line else f"{line}\ncount: 1"
    with pytest.raises(InputError) as caught:
        validate_model(parse_yaml(text, "f.yaml"), File)
    assert str(caught.value) == f"f.yaml:{message}"


class Written(FileModel):
    value: AnyQuantity


@pytest.mark.parametrize("text", ["8 rad/s", "0.5", "-3", "20 %"])
def test_a_quantity_of_any_dimension_stays_as_it_was_written(text):
    assert validate_model(parse_yaml(f"value: {text}"), Written).value == text


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("true", "found true; allowed: a quantity such as '20 N' or 0.1"),
        ("[1]", "found a list of 1; allowed: a quantity such as '20 N' or 0.1"),
        ("fast", "found 'fast'; allowed: a number, with a unit if it has one, such as '-80 mm' or '0.1'"),
    ],
)
def test_what_is_no_quantity_of_any_dimension_is_named(text, found):
    with pytest.raises(InputError) as caught:
        validate_model(parse_yaml(f"value: {text}", "f.yaml"), Written)
    assert str(caught.value) == f"f.yaml:1:8: value: {found}"


def test_models_complain_about_everything_at_once_in_the_order_of_the_file():
    text = "from: 5\npair: 1\nmode: x\nextra: 1\n"
    with pytest.raises(InputError) as caught:
        validate_model(parse_yaml(text, "f.yaml"), File)
    assert str(caught.value).splitlines() == [
        "f.yaml:1:1: missing key 'name'; required: name, count",
        "f.yaml:1:1: missing key 'count'; required: name, count",
        "f.yaml:1:7: from: found 5; allowed: a text",
        "f.yaml:2:7: pair: found 1; allowed: a list",
        "f.yaml:3:7: mode: found 'x'; allowed: ordered, printed",
        "f.yaml:4:1: extra: unknown key 'extra'; allowed: count, either, from, mode, name, on, pair, pushes",
    ]


texts = st.text(st.characters(exclude_categories=("Cs",)), max_size=20) | st.sampled_from(
    [
        "010",
        "1e-3",
        "yes",
        "no",
        "null",
        "~",
        "<<",
        "1:30",
        ".inf",
        "-80 mm",
        "- a",
        "#c",
        "a: b",
        "",
        "'",
        '"',
        "[",
        "*a",
        "&a",
        "!x",
        "%",
        "\x85",
        "\n",
    ]
)
leaves = (
    st.none()
    | st.booleans()
    | st.integers(-(10**18), 10**18)
    | st.floats(allow_nan=False, allow_infinity=False)
    | texts
)
texts = texts.filter(lambda text: not not_a_text(text))
leaves = leaves.filter(lambda leaf: not isinstance(leaf, str) or not not_a_text(leaf))
keys = texts.filter(lambda text: text and not not_a_name(text))
data = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4)
)


@given(data)
@settings(deadline=None)
def test_what_is_written_reads_back(value):
    document, problems = scan_text(dump_yaml(value), "f.yaml")
    assert problems == []
    assert document is not None
    assert document.data == value


@given(st.text(alphabet=st.sampled_from("ab:-[]{},&*!|>'\"%@#? \n\t01._"), max_size=40))
@settings(deadline=None)
def test_any_text_is_read_or_complained_about(text):
    document, problems = scan_text(text, "f.yaml")
    assert document is not None or problems
    lines = text.count("\n") + 1
    assert all(1 <= problem.line <= lines + 1 and problem.column >= 1 for problem in problems)


def test_long_names_that_begin_alike_are_no_duplicates():
    text = "".join(f"{'n' * 300}{i}: 1\n" for i in range(3))
    with pytest.raises(InputError) as caught:
        parse_yaml(text)
    said = [problem.message for problem in caught.value.problems]
    assert said == ["found a name of 301 characters; allowed: up to 200"] * 3


class Made(FileModel):
    """A model that Python makes."""

    length: AnyQuantity
    count: int = 3


def test_a_model_made_in_python_has_its_values_or_complains():
    made = Made(length="3 mm", count=4)
    assert (made.length, made.count) == ("3 mm", 4)
    with pytest.raises(InputError, match="count: "):
        Made(length="3 mm", count="many")
