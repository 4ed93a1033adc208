"""What the environment of a user may be like: closed streams, locales, settings of libraries."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

_SHIPPED = Path(__file__).parent.parent / "circuits" / "binn_lateral.yaml"
CIRCUIT = _SHIPPED.read_text(encoding="utf-8").replace("description: ", "description: ξ → ψ, ", 1)
RUN = "run binn_lateral --input zmp_y=70mm --input force_difference=1 --steps 3"


def called(words, folder, redirected="", **environment):
    """A command in a shell."""
    command = f"{shlex.quote(sys.executable)} -m circuitkit {words} {redirected}"
    return subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_keep_nobody_from_writing_a_file(tmp_path, closed):
    done = called(f"{RUN} -o a.csv", tmp_path, closed)
    assert (done.returncode, done.stdout) == (0, b"")
    assert b"Traceback" not in done.stderr
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").count("\n") == 4


@pytest.mark.parametrize(
    ("words", "redirected", "code", "said"),
    [
        (RUN, ">&-", 0, b""),
        (RUN, ">/dev/full", 3, b"No space left on device\n"),
        (RUN.replace("3", "30000"), "| head -1; exit ${PIPESTATUS[0]}", 141, b""),
        ("show nothing", "2>/dev/full", 1, b""),
        ("show --nothing", "2>/dev/full", 2, b""),
        ("show nothing", "2>&-", 1, b""),
        (
            f"{RUN} -o /proc/nothing/a.csv",
            "",
            3,
            b"cannot write '/proc/nothing/a.csv': No such file or directory\n",
        ),
    ],
)
def test_streams_that_cannot_be_written_are_one_line_or_none(tmp_path, words, redirected, code, said):
    done = called(words, tmp_path, redirected)
    assert (done.returncode, done.stderr) == (code, said)


@pytest.mark.parametrize(
    "environment",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "latin-1"},
        {"PYTHONIOENCODING": "ascii:strict"},
    ],
)
def test_data_on_standard_output_is_utf_8_whatever_the_locale(tmp_path, environment):
    (tmp_path / "echo.yaml").write_text(CIRCUIT, encoding="utf-8")
    for words in ("show echo.yaml --resolved", "show echo.yaml --json", "show echo.yaml"):
        done = called(words, tmp_path, **environment)
        assert (done.returncode, done.stderr) == (0, b"")
        assert "ξ → ψ" in done.stdout.decode("utf-8")


@pytest.mark.parametrize("value", ["osmesa", "garbage"])
def test_a_run_without_a_film_needs_no_renderer(tmp_path, value):
    done = called("simulate arm_reflex", tmp_path, MUJOCO_GL=value)
    assert (done.returncode, done.stderr) == (0, b"")


def test_who_needs_a_renderer_names_the_variable(tmp_path):
    done = called("simulate arm_reflex -o out --video", tmp_path, MUJOCO_GL="garbage")
    assert b"no film: no off-screen renderer: MUJOCO_GL is 'garbage'" in done.stderr
    assert (tmp_path / "out" / "recording.nc").is_file()


@pytest.mark.parametrize(
    ("settings", "backend"),
    [
        (b"text.usetex: True\nlines.linewidth: 20\nsavefig.dpi: 7\nfont.size: 40\n", ""),
        (b"lines.linewidth: blurb\nno.such.key: 1\n", "module://nothing"),
        (b"\xff\xfe: x", ""),
    ],
)
def test_pictures_are_the_same_whatever_a_user_has_set_for_others(tmp_path, settings, backend):
    folder = tmp_path / "settings"
    folder.mkdir()
    (tmp_path / "echo.yaml").write_text(CIRCUIT, encoding="utf-8")
    assert called("draw echo.yaml -o wanted.png", tmp_path).returncode == 0
    (folder / "matplotlibrc").write_bytes(settings)
    done = called("draw echo.yaml -o out.png", tmp_path, MATPLOTLIBRC=str(folder), MPLBACKEND=backend)
    assert (done.returncode, done.stderr) == (0, b"wrote out.png\n")
    assert (tmp_path / "out.png").read_bytes() == (tmp_path / "wanted.png").read_bytes()
    (folder / "matplotlibrc").rename(tmp_path / "matplotlibrc")  # where matplotlib looks first
    done = called("draw echo.yaml -o here.png", tmp_path)
    assert (done.returncode, done.stderr) == (0, b"wrote here.png\n")
    assert (tmp_path / "here.png").read_bytes() == (tmp_path / "wanted.png").read_bytes()


def test_tex_in_the_settings_of_a_process_changes_no_picture(tmp_path):
    script = (
        "import matplotlib as mpl; mpl.rcParams.update({'text.usetex': True, 'lines.linewidth': 9})\n"
        "from circuitkit import draw_circuit, load_circuit\n"
        "draw_circuit(load_circuit('binn_lateral'), 'a.png')\n"
        "assert mpl.rcParams['text.usetex'] and mpl.rcParams['lines.linewidth'] == 9\n"
    )
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True)


def test_a_settings_folder_that_cannot_be_made_is_nothing_to_say(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = called("draw binn_lateral -o out.png", tmp_path, MPLCONFIGDIR=str(tmp_path / "file" / "x"))
    assert (done.returncode, done.stderr) == (0, b"wrote out.png\n")
