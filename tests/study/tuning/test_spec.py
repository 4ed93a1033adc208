"""The file of a tuning: what is read, and what is refused where."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from small_tuning import SMALL, written

from circuitkit.base.errors import InputError
from circuitkit.study import CaseBuilder
from circuitkit.study.tuning.run import check, start_of, tune
from circuitkit.study.tuning.spec import load_tuning


def checked(path: Path) -> None:
    tuning = load_tuning(path)
    check(tuning, tuning.runs("train"))


def refusal(folder: Path, *changes: tuple[str, str], text: str = SMALL) -> tuple[str, str]:
    """What is said of a file in which a ¦ stands where the complaint should point; and the place of the ¦."""
    path = written(folder, *changes, text=text)
    marked = path.read_text(encoding="utf-8")
    before = marked.partition("¦")[0]
    line, column = before.count("\n") + 1, len(before.rpartition("\n")[2]) + 1
    path.write_text(marked.replace("¦", ""), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        checked(path)
    return str(refused.value), f"{path}:{line}:{column}: "


def test_conditions_are_the_axes_times_the_scale(tmp_path):
    tuning = load_tuning(written(tmp_path))
    pushed, calm = tuning.runs("train")
    assert [case.settings["push.force"] for case in pushed.conditions] == ["6 N", "9 N", "12 N"]
    assert {case.cell_key for case in pushed.conditions} == {(("push.force", "10 N"),)}
    assert [case.factor for case in pushed.conditions] == [0.6, 0.9, 1.2]
    assert pushed.seeds == range(100, 101)
    assert [case.settings for case in calm.conditions] == [{}]
    case = CaseBuilder(calm.study).case(tuning.settings({"w": "-1 deg"}))
    assert case.scenario.pushes == ()
    assert case.scenario.duration == 3.0
    assert case.reference.name == "gait_march"
    assert case.circuits.used.parameters["w"].value_si == pytest.approx(-0.0174532925)


def test_seeds_of_the_test_that_are_trained_on_are_refused(tmp_path):
    told, place = refusal(
        tmp_path, ("test: {seeds: {first: 0, count: 1}", "test: {seeds: ¦{first: 95, count: 10}")
    )
    common = "seeds 95 to 104 of test and seed 100 of train both have seed 100; allowed: seeds of its own"
    assert told == f"{place}tune.test.seeds: {common}"


def test_seeds_of_the_confirmation_are_its_own_too(tmp_path):
    told, place = refusal(tmp_path, ("  test:", "  confirm: {seeds: ¦{first: 100, count: 3}}\n  test:"))
    assert told.startswith(f"{place}tune.confirm.seeds: ")


def test_directions_that_are_to_be_apart_may_not_occur_in_both(tmp_path):
    told, place = refusal(tmp_path, ("  generation: 2", "  apart: [¦push.direction]"))
    assert told == (
        f"{place}tune.apart[0]: 'push.direction' is outward in train and in the test; "
        "allowed: other values in the test, by test: {runs: ...}"
    )
    tested = "pushed: {set: {push.direction: inward}}, calm: {set: {push.direction: left}}"
    seeds = "seeds: {first: 0, count: 1}"
    apart = ("  generation: 2", "  apart: [push.direction]"), (seeds, f"{seeds}, runs: {{{tested}}}")
    tuning = load_tuning(written(tmp_path, *apart))
    assert tuning.runs("test")[0].study.file.set["push.direction"] == "inward"


def test_equal_quantities_are_equal_however_they_are_written(tmp_path):
    durations = "{axes: {push.duration: [100 ms, 0.2 s]}}"
    seeds = "seeds: {first: 0, count: 1}"
    told, place = refusal(
        tmp_path,
        ("  generation: 2", "  apart: [¦push.duration]"),
        ("{push.force: [10 N]}", "{push.force: [10 N], push.duration: [0.1 s]}"),
        (seeds, f"{seeds}, runs: {{pushed: {durations}}}"),
    )
    assert told.startswith(f"{place}tune.apart[0]: 'push.duration' is 0.1 s in train and in the test")


FORCE = "push.force"
MISTAKES = [
    (("    w: {", "    ¦ww: {"), "unknown name 'ww'; allowed: "),
    (("    leak: {", "    w2: ¦{from: 1 deg, to: 2 mm}\n    leak: {"), "allowed: one dimension"),
    (("w: {from: -2 deg, to: -0.1 deg", "w: ¦{from: -2 m, to: -1 m"), "found -2 m (length); allowed: angle"),
    (("{leak: 5 %}", "{leak: ¦50 %}"), "found 50 %; allowed: 1 % to 20 %"),
    (("{leak: 5 %}", "{¦lek: 5 %}"), "'lek' is not searched; allowed: w, leak; did you mean 'leak'?"),
    (("runs: pushed", "runs: ¦pused"), "unknown runs 'pused'; allowed: pushed, calm; did you mean 'pushed'?"),
    (("{figure: survived, runs: pushed", "¦{figure: survived"), "found several sets of runs"),
    (("survived, runs: pushed", "¦limit, runs: calm"), "found the figure limit of runs without a scale"),
    (
        (f"scale: {{{FORCE}: [60 %, 90 %, 120 %]}}", f"scale: ¦{{{FORCE}: [90 %, 60 %]}}"),
        "factors out of order",
    ),
    ((f"scale: {{{FORCE}", "scale: {¦push.durtion"), "nothing gives 'push.durtion' a value"),
    ((f"{FORCE}: [10 N]", f"{FORCE}: [¦10 mm]"), "found '6 mm', which is length"),
    ((f"axes: {{{FORCE}", f"axes: {{push.farce: [¦9 N], {FORCE}"), "unknown key 'farce'"),
    (("calm: {set: {push: []", "calm: {set: {push: ¦no"), "found 'no'; allowed: a mapping"),
    (("circuit: base.yaml", "circuit: ¦binn_lateral_tuend"), "did you mean 'binn_lateral_tuned'?"),
    (
        ("result: small_tuned", "result: ¦small tuned"),
        "found 'small tuned'; allowed: a name of letters, digits and _",
    ),
    (
        ("figure: rms_ankle_roll", "figure: ¦rms_ankle_rol"),
        "recovery_time_s, clamped_share, rms_ankle_roll; did you mean 'rms_ankle_roll'?",
    ),
    (("figure: survived", "figure: ¦seed"), "unknown figure 'seed'; allowed: limit, survived, "),
    (
        ("tune:\n  circuit: base.yaml", "tune:\n  ¦reference: {gait: gait_march}\n  circuit: base.yaml"),
        "one of",
    ),
    (("generation: 2", "generation: ¦1"), "found 1; allowed: at least 2"),
    (("generation: 2", "generation: ¦2"), "found a generation of 2 for cmaes; allowed: 4 or more"),
    (("tune:\n", "tune:\n  ¦seed: 0\n"), "choices for leak; allowed: ranges only, or the sampler tpe"),
    (("study: small", "study: small\n¦sampler: x"), "unknown key 'sampler'"),
]


@pytest.mark.parametrize(("change", "message"), MISTAKES, ids=[message for _, message in MISTAKES])
def test_mistakes_are_told_where_they_stand(tmp_path, change, message):
    text = SMALL.replace("tpe", "cmaes") if "cmaes" in message or "choices" in message else SMALL
    if "choices" in message:
        text = text.replace("{from: 1 %, to: 20 %}", "{choices: [1, 2]}").replace(
            "generation: 2", "spread: 0.2"
        )
    told, place = refusal(tmp_path, change, text=text)
    assert told.splitlines()[0].startswith(place), told
    assert message in told


def test_a_start_may_be_a_choice(tmp_path):
    timing = "timing: {choices: [ordered, synchronous]}"
    path = written(tmp_path, ("leak: {from: 1 %, to: 20 %}", timing), ("leak: 5 %", "timing: synchronous"))
    assert load_tuning(path).start == {"timing": "synchronous"}
    assert start_of(load_tuning(path)) == {"w": pytest.approx(0.5), "timing": "synchronous"}


def test_the_example_of_the_documentation_is_sound(tmp_path):
    page = (Path(__file__).parents[3] / "docs/tuning.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```yaml\n(study: .*?)```", page, re.DOTALL)
    checked(written(tmp_path, text=example))


def test_a_study_without_the_section_is_told_so(tmp_path):
    told, _ = refusal(tmp_path, text="¦study: small\nscenario: nao_push\nseeds: {count: 1}\n")
    assert "the study has no section 'tune'" in told


def test_the_definition_is_what_the_objective_depends_on(tmp_path):
    first = load_tuning(written(tmp_path)).definition()
    same = written(
        tmp_path, ("trials: 3", "trials: 9"), ("study: small", "study: small\ndescription: Words.")
    )
    assert load_tuning(same).definition() == first
    other = written(tmp_path, ("weight: -0.2", "weight: -0.3"))
    assert load_tuning(other).definition() != first
    assert "small_tuned" in SMALL
    assert "small_tuned" not in first


def test_a_figure_may_be_a_name_alone(tmp_path):
    terms = SMALL[SMALL.index("  maximise:") : SMALL.index("  runs:")]
    calm = "    calm: {set: {push: [], duration: 3 s}}\n"
    told, place = refusal(tmp_path, (terms, "  maximise: ¦rms_hip_roll\n"), (calm, ""))
    assert told.startswith(f"{place}tune.maximise[0].figure: unknown figure 'rms_hip_roll'; allowed: limit, ")


def test_the_figures_are_those_of_the_commands_of_the_controller(tmp_path):
    told, place = refusal(
        tmp_path,
        ("circuit: base.yaml", "controller: stepping"),
        ("w: {from: -2 deg, to: -0.1 deg, log: true}", "push_off: {from: 50 %, to: 100 %}"),
        ("    leak: {from: 1 %, to: 20 %}\n  start: {leak: 5 %}\n", ""),
        ("figure: rms_ankle_roll", "figure: ¦rms_left_foot"),
    )
    assert told.startswith(
        f"{place}tune.maximise[1].figure: unknown figure 'rms_left_foot'; allowed: limit, "
    )
    assert "rms_left_foot_y, rms_right_foot_y" in told


def test_several_common_seeds_are_all_named(tmp_path):
    told, _ = refusal(
        tmp_path,
        ("train: {seeds: {first: 100, count: 1}", "train: {seeds: {first: 100, count: 3}"),
        ("test: {seeds: {first: 0, count: 1}", "test: {seeds: ¦{first: 101, count: 9}"),
    )
    assert "seeds 101 to 109 of test and seeds 100 to 102 of train both have the seeds 101, 102; " in told


def test_an_unknown_circuit_is_told_where_the_study_names_it(tmp_path):
    path = written(tmp_path, ("circuit: base.yaml", "circuit: bse"))
    with pytest.raises(InputError) as refused:
        tune(path, tmp_path / "out")
    assert str(refused.value).startswith(f"{path}:6:12: tune.circuit: unknown name 'bse'; ")
    assert not (tmp_path / "out").exists()
