from __future__ import annotations

import pytest
from paper.reproduce.made_up import made_up_figure

from circuitkit.base.errors import SimulationError, UnknownNameError
from circuitkit.paper.reproduce import FIGURES, Effort, run
from circuitkit.paper.reproduce.figure import select
from circuitkit.paper.reproduce.finding import FINDING_FILE


@pytest.fixture
def figures(monkeypatch):
    """Two made-up figures in the place of those there are."""
    made = {"fig11": made_up_figure(11), "fig9": made_up_figure(9)}
    monkeypatch.setattr(FIGURES, "kinds", made)
    return made


def times_made(figures):
    return [len(figures[name].jobs) for name in ("fig9", "fig11")]


def test_all_figures_are_made_in_order_with_a_report(figures, tmp_path):
    said = []
    made = run.reproduce([], tmp_path, log=said.append)
    assert [finding.figure for finding in made.findings] == ["fig9", "fig11"]
    assert made.markdown == tmp_path / "report.md"
    assert "Title of fig9" in made.markdown.read_text(encoding="utf-8")
    assert "data:image/png" in made.html.read_text(encoding="utf-8")
    assert said[0].startswith("fig9 (1 of 2), about ")
    assert said[1].startswith("fig11 (2 of 2), about ")
    job = figures["fig9"].jobs[0]
    assert (job.folder, job.quick, job.workers) == (tmp_path / "fig9", False, None)


def test_what_is_finished_is_not_made_again(figures, tmp_path):
    run.reproduce([], tmp_path)
    said = []
    made = run.reproduce([], tmp_path, log=said.append)
    assert times_made(figures) == [1, 1]
    assert said == ["fig9, fig11: done before; --again makes them anew"]
    assert len(made.findings) == 2


def test_again_forgets_the_runs_of_what_is_named_and_of_nothing_else(figures, tmp_path):
    run.reproduce([], tmp_path)
    for name in figures:
        (tmp_path / name / "full").mkdir()
    run.reproduce(["fig9"], tmp_path, again=True)
    assert times_made(figures) == [2, 1]
    assert not (tmp_path / "fig9" / "full").exists()
    assert (tmp_path / "fig11" / "full").exists()


@pytest.mark.usefixtures("figures")
def test_one_figure_joins_the_report_of_the_others(tmp_path):
    run.reproduce(["fig11"], tmp_path)
    made = run.reproduce(["fig9"], tmp_path)
    assert [finding.figure for finding in made.findings] == ["fig9"]
    text = made.markdown.read_text(encoding="utf-8")
    assert text.index("Title of fig9") < text.index("Title of fig11")


def test_a_coarse_figure_is_made_in_full_and_a_full_one_is_good_for_quick(figures, tmp_path):
    run.reproduce([], tmp_path, quick=True)
    run.reproduce([], tmp_path)
    assert [job.quick for job in figures["fig9"].jobs] == [True, False]
    run.reproduce([], tmp_path, quick=True)
    assert times_made(figures) == [2, 2]


def test_figures_are_made_anew_from_other_circuits(figures, tmp_path, monkeypatch):
    run.reproduce([], tmp_path)
    monkeypatch.setattr(run, "inputs_digest", lambda: "another")
    run.reproduce([], tmp_path)
    assert times_made(figures) == [2, 2]


def test_a_figure_that_fails_does_not_keep_the_others(figures, tmp_path):
    figures["fig9"].error = SimulationError("the robot vanished")
    with pytest.raises(run.FiguresFailedError, match=r"could not make fig9; .*\nfig9: the robot vanished"):
        run.reproduce([], tmp_path)
    assert times_made(figures) == [1, 1]
    assert "Title of fig11" in (tmp_path / "report.md").read_text(encoding="utf-8")
    figures["fig9"].error = None
    run.reproduce([], tmp_path)
    assert times_made(figures) == [2, 1]


def test_a_figure_that_is_made_again_and_fails_is_not_taken_for_finished(figures, tmp_path, monkeypatch):
    run.reproduce([], tmp_path)
    monkeypatch.setattr(run, "inputs_digest", lambda: "another")
    figures["fig9"].error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        run.reproduce([], tmp_path)
    assert not (tmp_path / "fig9" / FINDING_FILE).exists()
    assert "Title of fig11" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_an_unknown_figure_is_refused_with_those_there_are():
    with pytest.raises(UnknownNameError, match=r"unknown figure 'fig1'; allowed: fig5, fig6, .*did you mean"):
        select(["fig1"])


def test_figures_come_in_the_order_of_the_report():
    assert select(["stepping", "fig5", "fig11"]) == ("fig5", "fig11", "stepping")
    papers = [name for name in select() if name.startswith("fig")]
    assert papers == [f"fig{number}" for number in range(5, 12)]
    assert list(select())[: len(papers)] == papers  # what is beyond the paper comes after it


@pytest.mark.parametrize("name", select())
def test_every_figure_says_what_it_takes(name):
    figure = FIGURES[name]
    assert figure.title
    assert 0 < figure.effort.quick_s <= figure.effort.full_s
    assert callable(figure().run)


def test_no_two_figures_claim_the_same_place():
    orders = [figure.order for figure in FIGURES.kinds.values()]
    assert len(set(orders)) == len(orders)


def test_the_efforts_keep_to_ten_minutes_and_to_an_hour():
    efforts = [figure.effort for figure in FIGURES.kinds.values()]
    assert sum(effort.quick_s for effort in efforts) < 10 * 60
    assert sum(effort.full_s for effort in efforts) <= 60 * 60


def test_the_clock_learns_how_quick_the_machine_is():
    clock = run.Clock({"a": Effort(100, 10), "b": Effort(300, 30)}, quick=False, workers=4)
    assert clock.seconds == pytest.approx(200)  # the efforts are for two cores
    clock.record("a", 40.0)
    assert clock.seconds == pytest.approx(120)
    assert clock.left() == "about 2 min left"
    clock.record("b", 100.0)
    assert clock.seconds == 0.0


def test_the_digest_is_that_of_the_files_that_ship():
    first = run.inputs_digest()
    assert first == run.inputs_digest()
    assert len(first) == 16
