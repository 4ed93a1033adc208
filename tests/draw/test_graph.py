"""The network's picture in every format."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import matplotlib as mpl
import pytest

from circuitkit.base.errors import InputError
from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.draw import draw_circuit
from circuitkit.draw.style import EXCITATORY, INHIBITORY, ROLE_FILL, SENSORIAL

FORMATS = (".png", ".svg", ".pdf", ".dot", ".html")
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def binn():
    return load_circuit("binn_lateral")


@pytest.fixture(scope="module")
def pictures(binn, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures") / "not" / "there" / "yet"
    for suffix in FORMATS:
        draw_circuit(binn, folder / f"binn{suffix}")
    return folder


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_same_circuit_is_the_same_file(binn, pictures, tmp_path, suffix):
    again = tmp_path / f"again{suffix}"
    draw_circuit(binn, str(again))
    assert again.read_bytes() == (pictures / f"binn{suffix}").read_bytes()


def test_the_files_are_what_their_suffix_says(pictures):
    starts = {
        ".png": b"\x89PNG",
        ".pdf": b"%PDF",
        ".svg": b"<?xml",
        ".dot": b"digraph",
        ".html": b"<!DOCTYPE html>",
    }
    for suffix, start in starts.items():
        assert (pictures / f"binn{suffix}").read_bytes().startswith(start)


def test_another_suffix_is_refused_with_those_there_are(binn, tmp_path):
    for name, found in (("a.jpg", "the suffix '.jpg'"), ("a", "no suffix")):
        with pytest.raises(InputError) as error:
            draw_circuit(binn, tmp_path / name)
        expected = f"{tmp_path / name}: found {found}; allowed: .png, .svg, .pdf, .dot, .html"
        assert str(error.value).startswith(expected)
    assert not list(tmp_path.iterdir())


def test_every_node_and_line_of_the_svg_tells_its_details(binn, pictures):
    root = ET.parse(pictures / "binn.svg").getroot()
    titles = {
        group.get("id"): group.find(f"{SVG}title") for group in root.iter(f"{SVG}g") if group.get("data-ends")
    }
    texts = {key: title.text for key, title in titles.items() if title is not None}
    assert len(texts) == 2 + 11 + 1 + 3 * (len(binn.synapses) + 2)  # a line has a stroke, a rim and a head
    assert texts["node-q1"].splitlines()[0] == "q1: excitatory, sigmoid"
    assert "shift 79.9 mm" in texts["node-q1"]
    assert texts["line-lf-q1"] == "lf to q1: inhibitory, weight \N{MINUS SIGN}1 m"
    assert "goes back in a cycle" in texts["line-p1-h1"]


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.loaded: list[str] = []

    def handle_starttag(self, tag, attrs):
        wanted = {"src", "href", "xlink:href"}
        self.loaded += [value for key, value in attrs if key in wanted and not (value or "").startswith("#")]
        self.loaded += [tag] if tag in {"link", "img", "iframe"} else []


def test_the_page_loads_nothing(pictures):
    text = (pictures / "binn.html").read_text(encoding="utf-8")
    parser = _Links()
    parser.feed(text)
    assert parser.loaded == []
    assert "@import" not in text
    assert "<svg" in text


def test_text_of_a_file_is_only_text_in_the_page(tmp_path):
    graph = parse_circuit(
        "circuit: c\ndescription: '<script>alert(1)</script> $x^2 {y}'\n"
        "control_step: 10 ms\ntiming: ordered\n"
        "inputs: {u: {unit: '1', range: [0, 1], description: 'a < b & \"c\"'}}\n"
        "neurons: {n: {model: sigmoid, role: excitatory, slope: 1, shift: 0, description: '$\\alpha'}}\n"
        "synapses: [{from: u, to: n, weight: 1}]\noutputs: {y: {unit: '1', readout: {n: 1}}}\n"
    )
    for suffix in FORMATS:
        draw_circuit(graph, tmp_path / f"c{suffix}")
    page = (tmp_path / "c.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; $x^2 {y}" in page
    ET.parse(tmp_path / "c.svg")


def test_the_dot_file_has_every_node_and_synapse(binn, pictures):
    text = (pictures / "binn.dot").read_text(encoding="utf-8")
    edges = re.findall(r'^  "(\w+)" -> "(\w+)" \[(.*)\];$', text, flags=re.MULTILINE)
    assert len(edges) == len(binn.synapses) + 2
    kinds = {(source, target): attributes for source, target, attributes in edges}
    assert 'arrowhead="tee"' in kinds["lf", "q1"]
    assert 'arrowhead="normal"' in kinds["q1", "p1"]
    assert 'constraint="false"' in kinds["p1", "h1"]
    assert text.count("{") == text.count("}")


def test_kinds_differ_in_lightness_too():
    def lightness(colour):
        red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
        return 0.299 * red + 0.587 * green + 0.114 * blue

    shades = sorted(lightness(colour) for colour in (EXCITATORY, INHIBITORY))
    assert shades[1] - shades[0] > 0.15
    assert lightness(SENSORIAL) - shades[0] > 0.15
    assert lightness(ROLE_FILL["excitatory"]) - lightness(ROLE_FILL["inhibitory"]) > 0.08


def test_drawing_leaves_the_settings_of_matplotlib_alone(binn, tmp_path):
    before = dict(mpl.rcParams)
    draw_circuit(binn, tmp_path / "binn.svg")
    assert dict(mpl.rcParams) == before


def test_drawing_does_not_use_pyplot(tmp_path):
    code = (
        "import sys; from circuitkit.circuit import load_circuit; "
        "from circuitkit.draw import draw_circuit; "
        f"draw_circuit(load_circuit('binn_lateral'), {str(tmp_path / 'a.png')!r}); "
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
