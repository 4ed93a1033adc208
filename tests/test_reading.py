"""The one way in: what is no regular file, too large, not printable or too large for a number is refused with a place."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import errno
import os
import socket
import time
from pathlib import Path

import numpy as np
import pytest

from circuitkit.base.errors import CircuitkitError, InputError, Problem
from circuitkit.base.files import OutputError, make_folder, write_text
from circuitkit.base.output_folder import one_run
from circuitkit.base.reading import (
    MIB,
    checksum_of,
    environment,
    not_a_name,
    not_a_text,
    read_bytes,
    read_text,
    resolved,
)
from circuitkit.base.source import scan_text
from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.circuit.load import check
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.input_table import read_inputs
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation import Scenario
from circuitkit.simulation.plan import make_plan
from circuitkit.simulation.scenario import load_scenario
from circuitkit.study import read_study
from circuitkit.study.spec import make_study

CIRCUIT = """\
circuit: c
control_step: 10 ms
timing: ordered
inputs: {x: {unit: "1", range: [0, 1]}}
neurons: {a: {model: sigmoid, role: excitatory, slope: 5, shift: 0.5}}
synapses: [{from: x, to: a, weight: 1}]
outputs: {y: {unit: "1", readout: {a: 1}}}
"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def odd_file(kind: str) -> str:
    name = "odd.yaml"
    match kind:
        case "a named pipe":
            os.mkfifo(name)
        case "a device":
            return "/dev/zero"
        case "a folder":
            Path(name).mkdir()
        case "a circle of links":
            Path(name).symlink_to("other.yaml")
            Path("other.yaml").symlink_to(name)
        case "a name that is too long":
            return f"{'n' * 300}.yaml"
        case "a socket":
            with socket.socket(socket.AF_UNIX) as made:
                made.bind(name)
        case "nothing":
            pass
    return name


ODD = (
    "a named pipe", "a device", "a folder", "a circle of links", "a name that is too long", "a socket", "nothing"
)  # fmt: skip


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize(
    "read",
    [
        load_circuit,
        load_scenario,
        load_robot,
        read_study,
        lambda name: read_inputs(load_circuit("binn_lateral"), Path(name)),
        lambda name: read_text(name, "a text"),
    ],
    ids=["circuit", "scenario", "robot", "study", "inputs", "text"],
)
def test_what_is_no_regular_file_is_refused_at_once(kind, read):
    begin = time.perf_counter()
    name = odd_file(kind)
    with pytest.raises(InputError) as caught:
        read(name)
    assert caught.value.problems[0].file
    assert time.perf_counter() - begin < 5


@pytest.mark.parametrize("kind", ODD)
def test_an_included_file_is_complained_about_where_it_is_named(kind):
    name = odd_file(kind)
    Path("c.yaml").write_text(f"include: [{name}]\n{CIRCUIT}", encoding="utf-8")
    (error,) = check("c.yaml")[0]
    assert (error.file, error.line, error.column, error.where) == ("c.yaml", 1, 11, "include[0]")


@pytest.mark.parametrize("key", ["robot", "circuit", "controller", "reference: {gait"])
@pytest.mark.parametrize("kind", ODD)
def test_a_file_that_a_scenario_names_is_complained_about_there(key, kind):
    lines = {"robot": "nao"} | {key: odd_file(kind) + ("}" if "{" in key else "")}
    Path("s.yaml").write_text(
        "\n".join(
            ["scenario: s", "duration: 1 s", "control_step: 10 ms", *(f"{k}: {v}" for k, v in lines.items())]
        ),
        encoding="utf-8",
    )
    with pytest.raises(InputError) as caught:
        make_plan(load_scenario("s.yaml")).controller()
    assert {(each.file, each.line) for each in caught.value.problems} == {
        ("s.yaml", 4 if key == "robot" else 5)
    }


@pytest.mark.parametrize(
    "named", ['<include file="odd.xml"/>', '<asset><mesh name="m" file="odd.xml"/></asset>']
)
def test_what_an_mjcf_names_is_looked_at_before_mujoco_opens_it(named):
    os.mkfifo("odd.xml")
    Path("m.xml").write_text(f"<mujoco>\n {named}\n <worldbody/></mujoco>", encoding="utf-8")
    Path("robot.yaml").write_text("robot: r\nmjcf: m.xml\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"^m\.xml:2:\d+: file: found a named pipe; allowed: "):
        build_model(load_robot("robot.yaml"))


def test_a_file_that_is_too_large_is_not_read():
    with open("large.yaml", "wb") as file:  # noqa: PTH123 - sparse
        file.truncate(10**12)
    with pytest.raises(InputError, match=r"found a file of 9\.537e\+05 MiB; allowed: a text of up to 16 MiB"):
        read_bytes("large.yaml", "a text")
    (error,) = check("large.yaml")[0]
    assert "allowed: a YAML file of up to 16 MiB" in error.message


def test_links_in_a_circle_are_no_error_to_a_path():
    Path("a").symlink_to("b")
    Path("b").symlink_to("a")
    assert resolved(Path("a"))
    assert resolved(Path("a\0b")) == Path("a\0b")


def test_links_in_a_circle_are_no_folder_of_results():
    Path("a").symlink_to("b")
    Path("b").symlink_to("a")
    with pytest.raises(OutputError, match="cannot write to 'a'"), one_run(Path("a")):
        write_text(Path("a/x"), "")
    with pytest.raises(OutputError, match="cannot write to 'a': 'a' is no folder"):
        make_folder(Path("a"))


RAW = {"\\e": "\x1b"}  # an escape that Python has not
ESCAPES = [
    "\\e",
    "\\0",
    "\\a",
    "\\b",
    "\\x7f",
    "\\x9b",
    "\\u200b",
    "\\u202e",
    "\\u2066",
    "\\ue000",
    "\\ufeff",
    "\\ufffe",
]


@pytest.mark.parametrize("escape", ESCAPES)
@pytest.mark.parametrize(
    "text", ['a: "x{0}y"\n', '"x{0}y": 1\n', 'a: ["x{0}y"]\n', 'a: {{"x{0}": {{b: 1}}}}\n']
)
def test_what_is_not_printable_is_refused_as_an_escape_and_raw(escape, text):
    for written in (escape, RAW.get(escape) or escape.encode().decode("unicode_escape")):
        _, problems = scan_text(text.format(written), "f.yaml")
        assert problems
        assert all(each.line == 1 and "character U+" in each.message for each in problems)


@pytest.mark.parametrize("text", ["tab\tand\nbreak", "فارسی می\u200cشود", "👩\u200d🔬", "µm ° Ω"])
def test_what_languages_need_is_printable(text):
    assert not not_a_text(text)


@pytest.mark.parametrize("name", ["a\nb", "a\tb", "n" * 201, "a\u200db"])
def test_a_name_stands_on_one_line_and_is_not_long(name):
    assert not_a_name(name)


def test_no_message_writes_over_a_terminal_or_tells_a_password():
    assert str(Problem("a\x1b[2J", 1, 1, "", "b\x9bc")) == "a\\x1b[2J:1:1: b\\x9bc"
    for url in (
        "postgresql://me:secret@host/db",
        "postgresql:/me:secret@host/db",
        "me:secret@host",
        "tcp://secret@host:1",
        "mysql://h/d?user=u&password=secret",
        "mysql://h/d?passwd=secret",
        "mysql://me:a@b:secret/@host/db",
        f"mysql://me:secret{'x' * 300}@host/db",
    ):
        assert "secret" not in str(Problem("", 0, 0, "", f"cannot open '{url}'"))
        assert "secret" not in str(CircuitkitError(f"cannot open '{url}'"))
    for said in ("sqlite:////home/me@work/x.db", "http://host/a@b", "tcp://host:1, user@host"):
        assert str(Problem("", 0, 0, "", said)) == said


@pytest.mark.parametrize(
    "value",
    ["1 + 1e308 km", "1e308 km + 1 m", "2 * 1e9999 m", "1e400", "-1e400", "1e400 m", "1e308 km", "1e-400 m", "1e-400",
     "2^100000", "10^400", "exp(1e6)", "1e308 * 10", "9" * 400, "9" * 5000 + " m",
     "1 " + "*".join(["km^9"] * 12), "1 / 0", "-(1e308 km)", "max(1, 1e308 km)", "(" * 300 + "1" + ")" * 300],
)  # fmt: skip
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("inputs:", "parameters: {{p: {0}}}\ninputs:"),
        ("range: [0, 1]", "range: [0, '{0}']"),
        ("slope: 5", "slope: '{0}'"),
        ("weight: 1", "weight: '{0}'"),
        ("10 ms", "'{0}'"),
        ("readout: {a: 1}", "readout: {{a: '{0}'}}"),
        ("control_step", "seed: '{0}'\ncontrol_step"),
        ("weight: 1", "weight: 1, delay: '{0}'"),
    ],
)
def test_a_value_that_no_float_can_hold_is_an_error_with_its_place(value, old, new):
    Path("c.yaml").write_text(CIRCUIT.replace(old, new.format(value), 1), encoding="utf-8")
    errors, _ = check("c.yaml")
    assert errors
    assert all(each.file == "c.yaml" and each.line for each in errors)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("10 ms", "-0 ms", "2:15: control_step: found 0 ms; allowed: more than 0 s"),
        ("10 ms", "1e-300 s", "2:15: control_step: found 1e-300 s; allowed: 1 ns to 1 h"),
        ("weight: 1", "weight: 1, delay: 1e9 s", "6:47: synapses[0].delay: found 1e+09 s; allowed: up to 1 h"),
        ("control_step", "substeps: 1e300\ncontrol_step", "2:11: substeps: found 1e+300; allowed: a whole number from 1 to 1000000"),
        ("control_step", "seed: 9223372036854775808\ncontrol_step", "2:7: seed: found 9223372036854775808; allowed: whole numbers below 2^63; as a real number, with an exponent"),
        ("inputs", "populations: {p: {size: 1e308, model: identity, role: excitatory}}\ninputs", "4:25: populations.p.size: found 1e+308; allowed: a whole number from 1 to 2147483647"),
    ],
)  # fmt: skip
def test_counts_steps_and_delays_have_bounds(old, new, message):
    text = CIRCUIT.replace("weight: 1", "weight: 1, delay: 5 ms") if "-0" in new else CIRCUIT
    Path("c.yaml").write_text(text.replace(old, new, 1), encoding="utf-8")
    assert f"c.yaml:{message}" in [str(each) for each in check("c.yaml")[0]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"search": {"field": "push.force", "low": "0 N", "high": "1e40 N", "step": "1 N"}}, "allowed: up to 1000000 steps from low to high"),
        ({"seeds": {"first": 2**63 - 1, "count": 2}}, "seeds.first: found 9223372036854775807; allowed: at most"),
        ({"seeds": {"first": -1, "count": 2}}, "seeds.first: found -1; allowed: at least 0"),
        ({"seeds": {"count": 10**9}}, "seeds.count: found 1000000000; allowed: at most 1000000"),
        ({"axes": {f"a{i}": list(range(100)) for i in range(4)}}, "axes: found axes with 100000000 combinations; allowed: up to 1000000"),
    ],
)  # fmt: skip
def test_grids_and_seeds_have_bounds(change, message):
    with pytest.raises(InputError) as caught:
        make_study({"study": "s", "scenario": "nao_push", "seeds": {"count": 1}} | change)
    assert message in str(caught.value)


def test_python_gets_an_input_error_too():
    with pytest.raises(
        InputError, match="seed: found 9223372036854775808; allowed: less than 9223372036854775808"
    ):
        Scenario(robot="nao", duration=1.0, seed=2**63)


@pytest.mark.parametrize(
    ("load", "name", "message"),
    [
        (load_circuit, "sims/nao_push.yaml", "scenario: this is a scenario; allowed: a circuit"),
        (load_circuit, "robots/nao/robot.yaml", "robot: this is a robot; allowed: a circuit"),
        (load_scenario, "circuits/binn_lateral.yaml", "circuit: this is a circuit; allowed: a scenario"),
        (load_scenario, "sims/studies/polar.yaml", "study: this is a study; allowed: a scenario"),
        (load_robot, "sims/nao_push.yaml", "scenario: this is a scenario; allowed: a robot"),
        (read_study, "sims/nao_push.yaml", "scenario: this is a scenario; allowed: a study"),
    ],
)
def test_a_file_of_another_kind_is_told_once(load, name, message):
    with pytest.raises(InputError) as caught:
        load(Path(__file__).parents[1] / name)
    (problem,) = caught.value.problems
    assert f"{problem.where}: {problem.message}" == message


def test_an_included_file_that_is_no_circuit_is_not_told_line_by_line():
    Path("other.yaml").write_text("version: 3\nservices: {a: 1}\nvolumes: [x]\n", encoding="utf-8")
    Path("c.yaml").write_text(f"include: [other.yaml]\n{CIRCUIT}", encoding="utf-8")
    (error,) = check("c.yaml")[0]
    assert str(error).startswith(
        "other.yaml:1:1: version: unknown key 'version' and 2 more, so this is no circuit; allowed: "
    )


def test_long_and_many_unknown_names_are_told_soon():
    long = "n" * 6000
    text = CIRCUIT.replace("to: a", f"to: {long}b").replace("neurons: {", f"neurons: {{? {long}a : {{}}, ")
    many = "".join(f"  - {{from: new{i}, to: nex{i}, weight: par{i}}}\n" for i in range(1000))
    neurons = "".join(f"  neu{i}: {{model: identity, role: excitatory}}\n" for i in range(1000))
    other = CIRCUIT.replace("neurons: ", f"populations: {{}}\nneurons:\n{neurons}#").replace(
        "synapses: ", f"synapses:\n{many}#"
    )
    keys = CIRCUIT + "".join(f"key{i}: 1\n" for i in range(10_000))
    for each in (text, other, keys):
        Path("c.yaml").write_text(each, encoding="utf-8")
        begin = time.perf_counter()
        errors, _ = check("c.yaml")
        assert errors
        assert max(len(str(error)) for error in errors) < 2000
        assert time.perf_counter() - begin < 3


def test_nothing_is_suggested_that_was_written():
    text = CIRCUIT.replace(
        "inputs",
        "populations: {p: {size: 4, model: identity, role: excitatory}}\nprojections: [{from: 'p[0:2]', to: p, connect: all_to_all, weight: 1}]\ninputs",
    )
    Path("c.yaml").write_text(text, encoding="utf-8")
    (error,) = check("c.yaml")[0]
    assert error.hint == "a member is called by its number, such as p[0]"


@pytest.mark.parametrize(("value", "read"), [(" 4\n", "4"), ("", ""), ("/tmp/é\udcff", "/tmp/é\udcff")])
def test_variables_of_the_environment_are_without_spaces_around_them(monkeypatch, value, read):
    monkeypatch.setenv("CIRCUITKIT_CACHE", value)
    assert environment("CIRCUITKIT_CACHE") == read


@pytest.mark.parametrize("variable", ["CC", "CIRCUITKIT_CACHE", "CIRCUITKIT_CFLAGS", "CIRCUITKIT_THREADS"])
def test_variables_with_control_characters_are_refused_by_name(monkeypatch, variable):
    monkeypatch.setenv("CIRCUITKIT_CACHE", "cache")
    monkeypatch.setenv(variable, "a\x1b[2Jb")
    circuit = parse_circuit(CIRCUIT)
    with pytest.raises(InputError, match=rf"^\${variable}: found the control character U\+001B; allowed: "):
        run(compile_circuit(circuit, backend="compiled"), {"x": np.zeros(3)})


def test_checksums_are_of_regular_files():
    Path("a").write_bytes(b"abc")  # the sum is that of FIPS 180-2
    assert checksum_of("a", "a file") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    os.mkfifo("p")
    with pytest.raises(InputError, match="found a named pipe; allowed: a file"):
        checksum_of("p", "a file")


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("a named pipe", "odd.yaml:1:1: found a named pipe; allowed: a text"),
        ("a device", "/dev/zero:1:1: found a device; allowed: a text"),
        ("a folder", "odd.yaml:1:1: found a folder; allowed: a text"),
        ("a circle of links", f"odd.yaml:1:1: cannot be read: {os.strerror(errno.ELOOP)}; allowed: a text"),
        ("a socket", "odd.yaml:1:1: cannot be read: it is a socket or a device; allowed: a text"),
        ("nothing", "odd.yaml:1:1: there is no such file; allowed: a text"),
    ],
)
def test_what_cannot_be_read_is_said_word_for_word(kind, message):
    with pytest.raises(InputError) as caught:
        read_text(odd_file(kind), "a text")
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("name", "meant"),
    [("texx.yaml", "text.yaml"), ("texx.yml", "text.yaml"), ("text_yaml", "text.yaml"), ("texx.csv", "text.csv"), ("texx.xml", "")],
)  # fmt: skip
def test_a_file_that_is_not_there_may_be_one_beside_it_of_the_same_kind(name, meant):
    for other in ("text.yaml", "text.csv"):
        Path(other).write_text("")
    with pytest.raises(InputError) as caught:
        read_text(name, "a text")
    assert caught.value.problems[0].hint == (f"did you mean '{meant}'?" if meant else "")


def test_a_file_may_be_as_large_as_is_allowed_and_no_larger():
    Path("f").write_bytes(b"ab" * MIB)
    assert len(read_bytes("f", "a text", 2 * MIB)) == 2 * MIB
    with pytest.raises(InputError) as caught:
        read_bytes("f", "a text", 2 * MIB - 2**19)
    assert str(caught.value) == "f:1:1: found a file of 2 MiB; allowed: a text of up to 1.5 MiB"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs the files of proc(5)")
def test_a_file_that_says_it_is_empty_is_read_as_far_as_is_allowed():
    assert read_bytes("/proc/self/status", "a text").endswith(b"\n")
    whole = len(read_bytes("/proc/version", "a text"))
    assert len(read_bytes("/proc/version", "a text", whole)) == whole
    with pytest.raises(InputError, match=r"larger than it says; allowed: a text of up to [\de.-]+ MiB$"):
        read_bytes("/proc/version", "a text", whole - 1)
    with pytest.raises(InputError, match=r"^/proc/self/mem:1:1: cannot be read: .*; allowed: a text$"):
        read_bytes("/proc/self/mem", "a text")
    with pytest.raises(InputError, match=r"^/proc/self/mem:1:1: cannot be read: .*; allowed: a text$"):
        checksum_of("/proc/self/mem", "a text")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"ab\n\xffc", "2:1: found the byte 0xff, which is no UTF-8; allowed: a text file in UTF-8"),
        ("x".encode("utf-16"), "1:1: found the byte 0xff, which is no UTF-8; allowed: a text file in UTF-8; it may be UTF-16: save it as UTF-8"),
        (b"ab\nc\x1b", "2:2: found the control character U+001B; allowed: printable text"),
        (b"a\x7f", "1:2: found the control character U+007F; allowed: printable text"),
        ("a\x80".encode(), "1:2: found the control character U+0080; allowed: printable text"),
        ("a\x9f".encode(), "1:2: found the control character U+009F; allowed: printable text"),
        ("a\xad".encode(), "1:2: found the invisible character U+00AD; allowed: printable text"),
        ("\ufeffa\u200b".encode(), "1:2: found the invisible character U+200B; allowed: printable text"),
    ],
)  # fmt: skip
def test_what_is_no_text_is_told_with_its_place(content, message):
    Path("f").write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_text("f", "a text")
    assert str(caught.value) == f"f:{message}"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("n" * 200, ""),
        ("n" * 201, "found a name of 201 characters; allowed: up to 200"),
        ("a\tb", "found the control character U+0009 in a name; allowed: printable text on one line"),
        ("a\u2028b", "found the invisible character U+2028 in a name; allowed: printable text on one line"),
    ],
)
def test_what_is_wrong_with_a_name_is_said(name, message):
    assert not_a_name(name) == message
