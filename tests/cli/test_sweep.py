"""`circuitkit sweep`: what it prints, how it ends, and what it leaves when it is interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

STUDY = """\
study: two pushes
scenario: nao_push
set: {reference.gait: gait_march, controller: open_loop, push.start.step: 0}
watch: 1 s
axes:
  push.direction: [inward, outward]
seeds: {count: 2}
"""
SEARCH = "search: {field: push.force, low: 0 N, high: 45 N, step: 15 N, check_below: 0}\n"


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(STUDY)
    return str(path)


def test_shares_are_printed_with_their_interval(circuitkit, study):
    done = circuitkit("sweep", study, "-o", "out", "--workers", "1")
    assert done.code == 0
    lines = [line.split()[:8] for line in done.out.splitlines() if "ward" in line]
    # 20 N: 2 of 2 inward, none outward; z^2 = 3.84, so 2/(2 + 3.84) = 34 % and the rest to 66 %
    assert lines == [
        ["inward", "2", "of", "2", "34", "to", "100", "%"],
        ["outward", "0", "of", "2", "0", "to", "66", "%"],
    ]
    assert all(name in done.out for name in ("time_of_fall_s", "max_zmp_excursion_m", "recovery_time_s"))
    assert done.err == "wrote out/results.parquet: 4 runs\n"
    again = circuitkit("sweep", study, "-o", "out", "--workers", "1")
    assert again.code == 1
    assert "'out' has 4 runs of the study 'two pushes'; go on with them by --resume" in again.err
    printed = circuitkit("sweep", study, "-o", "out", "--resume", "--json", "--workers", "1")
    data = json.loads(printed.out)
    assert data["results"] == "out/results.parquet"
    inward, outward = (share["means"] for share in data["shares"])
    assert inward["time_of_fall_s"] is None  # nobody fell
    assert outward["time_of_fall_s"] < 2.35
    assert [(share["labels"], share["survived"]) for share in data["shares"]] == [
        ({"push.direction": "inward"}, 2),
        ({"push.direction": "outward"}, 0),
    ]


def test_limits_are_printed_in_the_unit_of_the_search(circuitkit, tmp_path):
    (tmp_path / "two.yaml").write_text(STUDY.replace(", outward", "") + SEARCH)
    done = circuitkit("sweep", "two.yaml", "-o", "out", "--workers", "1", "--seeds", "1")
    assert done.code == 0
    (line,) = (line for line in done.out.splitlines() if "inward" in line)
    assert line.split() == ["inward", "15", "N", "1", "of", "1", "21", "to", "100", "%", "30", "N"]
    data = json.loads(circuitkit("sweep", "two.yaml", "-o", "out2", "--workers", "1", "--json").out)
    assert (data["searched"], data["unit"]) == ("push.force", "N")
    assert (data["limits"][0]["largest"], data["limits"][0]["fails_at"]) == (15.0, 30.0)


def test_a_dry_run_counts_and_runs_nothing(circuitkit, study, tmp_path):
    done = circuitkit("sweep", study, "--dry-run", "--workers", "2")
    assert done.code == 0
    assert "2 cells, 2 seeds: 4 runs of 2.35 s each" in done.out
    data = json.loads(circuitkit("sweep", "push_limits", "--dry-run", "--json").out)
    assert (data["cells"], data["seeds"], data["most_runs"]) == (48, 20, 48 * 20 * 61)
    assert 48 * 20 < data["runs"] < data["most_runs"]
    assert [path.name for path in tmp_path.iterdir()] == ["two.yaml"]


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["two.yaml"], 2, "name a folder for the results: -o DIR"),
        (["tow", "-o", "out"], 1, "unknown name 'tow'; allowed: a path, or one of the shipped studies"),
        (["two.yaml", "-o", "out", "--workers", "0"], 2, "greater than or equal to 1"),
        (["two.yaml", "-o", "out", "--workers", "2", "--scheduler", "tcp://x:1"], 3, "not both"),
        (["two.yaml", "-o", "out", "--by", "contendr"], 1, "unknown axis 'contendr'"),
        (["two.yaml", "-o", "two.yaml", "--workers", "1"], 3, "'two.yaml' is no folder"),
    ],
)
@pytest.mark.usefixtures("study")
def test_wrong_usage_is_told(circuitkit, words, code, message):
    done = circuitkit("sweep", *words)
    assert done.code == code
    assert message in " ".join(done.err.split())


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(tmp_path):
    """A real process with two workers; all of them get the signal, as from a terminal."""
    (tmp_path / "two.yaml").write_text(STUDY.replace("count: 2", "count: 2000"))
    words = [sys.executable, "-m", "circuitkit", "sweep", "two.yaml", "-o", "out", "--batch", "2"]
    running = subprocess.Popen(
        [*words, "--workers", "2"], cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    parts = tmp_path / "out" / "parts"
    until = time.monotonic() + 60
    while not list(parts.glob("part-*.parquet")) and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=20)
    assert running.returncode == 130
    kept = 2 * len(list(parts.iterdir()))
    assert (
        said == f"{kept} runs are kept in 'out'; --resume (resume=True) goes on with the study\ninterrupted\n"
    )
    assert not list(parts.glob("*.part*"))
