from __future__ import annotations

import base64
import re
from html.parser import HTMLParser

import pytest
from paper.reproduce.made_up import PIXEL, a_claim, a_finding, drawn

import circuitkit
from circuitkit.paper.reproduce.finding import Verdict
from circuitkit.paper.reproduce.report import Entry, as_html, as_markdown


def entry(figure="fig9", quick=False, version=circuitkit.__version__, **changes):
    return Entry(a_finding(figure, **changes), quick, version)


def headings(markdown):
    return re.findall(r"^#+ (.*)$", markdown, re.MULTILINE)


def test_the_table_of_claims_comes_first_then_each_figure_then_the_versions():
    text = as_markdown((entry("fig9"), entry("fig11")))
    assert headings(text) == [
        "The paper, figure by figure",
        "Claims",
        "Title of fig9",
        "Title of fig11",
        "Versions",
    ]
    assert f"circuitkit {circuitkit.__version__}, Python 3" in text


def test_every_claim_is_a_row_of_six_cells():
    claims = (a_claim(), a_claim(Verdict.PARTLY, why="The edge is near."), a_claim(Verdict.FAILS))
    text = as_markdown((entry(claims=claims),))
    assert "1 holds, 1 holds in part, 1 does not hold." in text
    rows = [line for line in text.splitlines() if line.startswith("| It stands")]
    assert len(rows) == 3
    assert rows[1] == "| It stands | section 5 | 22 N | 20 N | seeds 0 \\| 1 | holds in part |"
    assert "### Where ours differs, and why\n\n- **It stands.** The edge is near." in text


def test_each_figure_says_how_to_repeat_it():
    text = as_markdown((entry("fig9"), entry("polar", quick=True, version="0.0.1")))
    assert (
        "Repeat: `circuitkit reproduce fig9 -o DIR`. Study: `fig9`. Random numbers: seeds 0 to 19.\n" in text
    )
    assert "Repeat: `circuitkit reproduce polar -o DIR --quick`." in text
    assert "Made with circuitkit 0.0.1." in text
    assert "fewer seeds and coarser grids: polar." in text


def test_pictures_and_tables_stand_in_the_text():
    text = as_markdown((entry(),))
    assert "![What it shows.](fig9/fig9.png)\n\n*Caption.*\n" in text
    assert "**Numbers**\n\n| who | force [N] |\n|---|---:|\n| open loop | 4 |\n| BiNN | 20 |\n" in text


def test_a_report_of_nothing_is_a_report():
    text = as_markdown(())
    assert "No figure of this report claims anything." in text


class Resources(HTMLParser):
    """Collects what a browser would load, and tags that stay open."""

    def __init__(self):
        super().__init__()
        self.loaded, self.open, self.classes = [], [], []

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        self.loaded += [named[key] for key in ("src", "href", "srcset", "data", "action") if key in named]
        if tag == "td" and "class" in named:
            self.classes.append(named["class"])
        if tag not in {"meta", "img", "br", "hr", "link"}:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture
def page(tmp_path):
    drawn(tmp_path / "fig9")
    claims = tuple(a_claim(verdict) for verdict in Verdict)
    html = as_html(as_markdown((entry(claims=claims),)), tmp_path)
    resources = Resources()
    resources.feed(html)
    return html, resources


def test_the_page_carries_all_that_it_shows(page):
    html, resources = page
    assert resources.open == []
    assert len(resources.loaded) == 1
    kind, _, content = resources.loaded[0].partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(content) == PIXEL
    assert not re.search(r"https?:|//|url\(|@import|<script|<link", html.replace(content, ""))


def test_the_page_colours_verdicts_and_nothing_else(page):
    _, resources = page
    assert sorted(resources.classes) == ["fails", "holds", "partly"]


def test_captions_are_small_and_nothing_else_is(page):
    html, _ = page
    assert html.count('<p class="caption">') == 1
    assert '<p class="caption"><em>Caption.</em></p>' in html


def test_a_picture_that_is_not_there_stays_a_name(tmp_path):
    html = as_html(as_markdown((entry(),)), tmp_path)
    assert 'src="fig9.png"' in html


def test_what_a_text_says_is_not_taken_for_html(tmp_path):
    html = as_html(as_markdown((entry(text="if a < b & c > <script>alert()</script>"),)), tmp_path)
    assert "<script>" not in html
    assert "if a &lt; b &amp; c &gt;" in html
