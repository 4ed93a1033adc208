"""`circuitkit draw`."""

from __future__ import annotations

from pathlib import Path

import pytest

from circuitkit.cli.draw import What

BEGINNINGS = {
    "png": b"\x89PNG",
    "svg": b"<?xml",
    "pdf": b"%PDF",
    "dot": b"digraph",
    "html": b"<!DOCTYPE html>",
}


@pytest.mark.parametrize("suffix", BEGINNINGS)
def test_the_suffix_chooses_the_format(circuitkit, suffix):
    outcome = circuitkit("draw", "binn_lateral", "-o", f"new/out.{suffix}")
    assert (outcome.code, outcome.out, outcome.err) == (0, "", f"wrote new/out.{suffix}\n")
    assert Path(f"new/out.{suffix}").read_bytes().startswith(BEGINNINGS[suffix])
    assert [path.name for path in Path("new").iterdir()] == [f"out.{suffix}"]


def test_other_formats_are_refused_with_those_there_are(circuitkit):
    outcome = circuitkit("draw", "binn_lateral", "-o", "out.sgv")
    assert outcome.code == 1
    assert outcome.err == (
        "out.sgv: found the suffix '.sgv'; allowed: .png, .svg, .pdf, .dot, .html; did you mean '.svg'?\n"
    )


def test_where_to_draw_must_be_said(circuitkit):
    outcome = circuitkit("draw", "binn_lateral")
    assert outcome.code == 2
    assert "Error: Missing option '--output' / '-o'." in outcome.err


def test_what_to_draw_is_one_of_those_there_are(circuitkit):
    outcome = circuitkit("draw", "binn_lateral", "--what", "graphs", "-o", "out.svg")
    assert outcome.code == 2
    assert f"'graphs' is not one of {', '.join(repr(what.value) for what in What)}" in outcome.err


@pytest.mark.parametrize("what", What)
def test_every_drawing_is_made(circuitkit, what):
    outcome = circuitkit("draw", "binn_lateral", "--what", what.value, "-o", f"{what.value}.svg")
    assert (outcome.code, outcome.err) == (0, f"wrote {what.value}.svg\n")
    assert Path(f"{what.value}.svg").read_bytes().startswith(BEGINNINGS["svg"])


def test_an_invalid_circuit_leaves_no_file(circuitkit):
    Path("bad.yaml").write_text("circuit: bad\n", encoding="utf-8")
    outcome = circuitkit("draw", "bad.yaml", "-o", "out.svg")
    assert outcome.code == 1
    assert outcome.err.startswith("bad.yaml:1:")
    assert not Path("out.svg").exists()


def test_values_of_the_circuit_can_be_set(circuitkit):
    outcome = circuitkit("draw", "binn_lateral", "--set", "w=2deg", "-o", "out.dot")
    assert outcome.code == 0
    assert 'label="2 deg"' in Path("out.dot").read_text(encoding="utf-8")
    assert circuitkit("draw", "binn_lateral", "--set", "w=2mm", "-o", "no.dot").code == 1
    assert not Path("no.dot").exists()
