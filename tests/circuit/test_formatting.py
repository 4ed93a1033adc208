"""The normal form of circuit files: what it looks like, that it is stable, and that nothing is lost."""

from __future__ import annotations

import json
import re
import stat
from dataclasses import replace
from random import Random

import pytest
import strategies
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circuitkit.base.errors import InputError
from circuitkit.base.source import data_folder, dump_yaml, parse_yaml, shipped_names
from circuitkit.base.source.commented import read_commented
from circuitkit.base.source.rewriting import write_commented
from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.circuit.authoring.difference import compare_circuits
from circuitkit.circuit.authoring.formatting import FormatError, format_file, format_text, normal_quantity

UNTIDY = """\
# yaml-language-server: $schema=circuit.schema.json
# About this file.

# Where the signal goes.
outputs: {y: {readout: {n: 1}, unit: "1"}}   # one
synapses:
- {weight: 1, from: u, to: n}  # in

timing: ordered
control_step: 10ms


circuit: c
inputs:
    u: {range: [-80mm, '80mm'], unit: mm}
    # no more
neurons:
    n:   # the neuron
      shift: 5mm
      model: sigmoid
      slope: 100/m


      role: excitatory
"""
TIDY = """\
# yaml-language-server: $schema=circuit.schema.json
# About this file.

circuit: c
control_step: 10 ms

timing: ordered

inputs:
  u: {unit: mm, range: [-80 mm, '80 mm']}
  # no more

neurons:
  n:  # the neuron
    model: sigmoid

    role: excitatory
    slope: 100 /m
    shift: 5 mm

synapses:
  - {from: u, to: n, weight: 1}  # in

# Where the signal goes.
outputs:  # one
  y: {unit: "1", readout: {n: 1}}
"""


def test_order_spacing_and_spelling():
    assert format_text(UNTIDY) == TIDY


def test_the_normal_form_stays_as_it_is():
    assert format_text(TIDY) == TIDY


@pytest.mark.parametrize("name", shipped_names("circuits"))
def test_shipped_circuits_are_in_their_normal_form(name):
    formatted = format_file(name)
    assert formatted.after == formatted.before, f"run `circuitkit format {name}`"


@pytest.mark.parametrize(
    ("written", "normal"),
    [
        ("-80mm", "-80 mm"),
        ("\N{MINUS SIGN}80  mm", "-80 mm"),
        ("100/m", "100 /m"),
        ("100 1/m", "100 /m"),
        ("1.63\N{DEGREE SIGN}", "1.63 deg"),
        ("5%", "5 %"),
        ("1e-3 N * m", "1e-3 N*m"),
        (".5 s", ".5 s"),
        ("0.50", "0.50"),
        ("edge - margin", "edge - margin"),
        ("all_to_all", "all_to_all"),
    ],
)
def test_the_spelling_of_quantities(written, normal):
    assert normal_quantity(written) == normal


@given(strategies.circuit_data(), st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_what_a_file_means_and_its_comments_stay_whatever_its_order(data, random):
    assume(r"\n" not in json.dumps(data))  # between the lines of a text there are no comments
    text = dump_yaml(data)
    sections = [block for block in _blocks(text) if block]
    random.shuffle(sections)
    lines = [line for section in sections for line in section]
    shuffled = []
    for number, line in enumerate(lines):
        if random.random() < 0.3:
            shuffled.append(f"{' ' * random.choice([0, 2, 4])}# above {number}")
        shuffled.append(f"{line}  # beside {number}" if random.random() < 0.3 else line)
        if random.random() < 0.1:
            shuffled.append("")
    before = "\n".join([*shuffled, "# the end", ""])
    after = format_text(before)
    assert format_text(after) == after
    assert _meaning(after) == _meaning(before)
    assert sorted(read_commented(after).comments) == sorted(read_commented(before).comments)


def _meaning(text):
    """The circuit of a text; parameters without the spelling of their units."""
    graph = parse_circuit(text)
    return replace(graph, parameters={name: each.value_si for name, each in graph.parameters.items()})


def _blocks(text):
    """The sections of a text that `dump_yaml` wrote."""
    blocks = []
    for line in text.splitlines():
        if line[:1] not in {" ", "-"}:
            blocks.append([])
        blocks[-1].append(line)
    return blocks


def test_comments_go_with_what_they_belong_to():
    text = """\
a: 1   # beside a
b:     # beside b
    # above x
    x: {p: 1,  # beside p
        # above q
        q: 2
        # below q
        }
    # below x
    # again
c:

# above the first item
- 1
-   # above the second item
    k: 2 # k
    l: 3
  # below the items
d: |  # a text
     # no comment
       in it
e: "# no comment"   # a comment
f: [1,
  2]  # beside f
g: {h: 1,   # beside h
    i: {j: 2, k: [3,  # beside 3
      4]}}   # beside 4
"""
    assert (
        write_commented(read_commented(text), 110)
        == """\
a: 1  # beside a
b:    # beside b
  # above x
  x:
    p: 1  # beside p
    # above q
    q: 2
    # below q
  # below x
  # again
c:
  # above the first item
  - 1
  # above the second item
  - k: 2  # k
    l: 3
  # below the items
d: |  # a text
  # no comment
    in it
e: "# no comment"  # a comment
f: [1, 2]          # beside f
g:
  h: 1  # beside h
  i:
    j: 2
    k:
      - 3  # beside 3
      - 4  # beside 4
"""
    )


@pytest.mark.parametrize("seed", range(8))
def test_comments_anywhere_in_shipped_circuits_survive(seed):
    random = Random(seed)
    for name in shipped_names("circuits"):
        text = "\n".join(_disturbed((data_folder("circuits") / f"{name}.yaml").read_text(), random))
        tree = read_commented(text)
        after = write_commented(tree, 110)
        assert sorted(read_commented(after).comments) == sorted(tree.comments)
        assert parse_yaml(after).data == parse_yaml(text).data
        assert write_commented(read_commented(after), 110) == after


def _disturbed(text, random):
    """The lines of a text, with comments between and behind them and inside braces."""
    for number, line in enumerate(text.splitlines()):
        if random.random() < 0.1 and re.match(r" *(- |\w+:)", line):
            yield f"{' ' * random.choice([0, 2, 3, 4, 6])}# above {number} {{a: 1}}"
        commas = [match.start() for match in re.finditer(", ", line)]
        if (
            "#" in line
            or '"' in line
            or line.lstrip()[:1] not in {"-", "q", "l", "p"}
            or not line.endswith("}")
        ):
            yield line
        elif commas and random.random() < 0.5:
            at = random.choice(commas) + 1
            yield f"{line[:at]}  # inside {number}"
            yield f"{' ' * 12}{line[at + 1 :]}"
        else:
            yield f"{line}  # beside {number}"


def test_long_entries_are_wrapped_inside_their_braces_or_become_blocks():
    words = " ".join(["word"] * 12)
    text = f"a: {{one: {words}, two: {words}}}\nb: {{one: {words} {words}}}\n"
    assert write_commented(read_commented(text), 80) == (
        f"a: {{one: {words},\n    two: {words}}}\n"
        f"b:\n  one: {words} word word\n    {' '.join(['word'] * 10)}\n"
    )


def test_empty_lines_inside_a_text_count():
    text = "a: |\n  one\n\n\n  two\nb: 'one\n\n\n  two'\n\n\nc: 1\n"
    after = write_commented(read_commented(text), 80)
    assert after == "a: |\n  one\n\n\n  two\nb: 'one\n\n\n  two'\n\nc: 1\n"


def test_aliases_stay_behind_their_anchors():
    text = (
        "circuit: c\nneurons:\n  n: &n {slope: 1, shift: 0, model: sigmoid, role: excitatory}\n  m: *n\n"
        "control_step: 10 ms\ntiming: ordered\noutputs:\n  y: {unit: '1', readout: {n: 1, m: 1}}\n"
    )
    after = format_text(text)
    assert after.splitlines()[3:5] == [
        "  n: &n {slope: 1, shift: 0, model: sigmoid, role: excitatory}",
        "  m: *n",
    ]
    assert parse_yaml(after).data == parse_yaml(text).data


def test_a_file_for_others_to_include_is_formatted_too():
    assert format_text("neurons: {n: {role: excitatory, model: identity}}\n") == (
        "neurons:\n  n: {model: identity, role: excitatory}\n"
    )


def test_line_breaks_of_other_systems_and_marks_at_the_start_go(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + TIDY.replace("\n", "\r\n").encode())
    format_file(path).write()
    assert path.read_bytes() == TIDY.encode()


def test_an_invalid_file_is_refused_with_its_errors():
    with pytest.raises(InputError) as error:
        format_text(TIDY.replace("sigmoid", "sigmoyd"), "c.yaml")
    assert [problem.where for problem in error.value.problems] == ["neurons.n.model"]


def test_what_would_mean_something_else_is_refused(monkeypatch):
    monkeypatch.setattr(
        "circuitkit.circuit.authoring.formatting.write_commented", lambda *_: TIDY.replace("5 mm", "6 mm")
    )
    with pytest.raises(FormatError) as error:
        format_text(TIDY, "c.yaml")
    assert str(error.value) == (
        "c.yaml: the normal form would not mean the same, so the file is left as it is; please report"
    )


def test_a_file_keeps_its_permissions(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text(UNTIDY, encoding="utf-8")
    path.chmod(0o640)
    format_file(path).write()
    assert path.read_text(encoding="utf-8") == TIDY
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_the_comments_of_the_binn_survive():
    path = data_folder("circuits") / "binn_lateral.yaml"
    text = path.read_text(encoding="utf-8")
    untidy = re.sub(r"(?<=\d) mm(?=[}\]])", "mm", text).replace("  - {", "- {").replace("\n\n", "\n\n\n")
    after = format_text(untidy, str(path))
    assert read_commented(after).comments == read_commented(text).comments
    changes = compare_circuits(load_circuit(path), parse_circuit(after, str(path)))
    assert {change.field for change in changes} <= {"description"}
