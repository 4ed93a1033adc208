"""Study files: what they may say, what is found wrong with them and where, and which points they mean."""

from __future__ import annotations

import itertools
import math
import pickle

import pytest

from circuitkit.base.errors import CircuitkitError, InputError
from circuitkit.base.source import find_data_file, read_yaml, shipped_names
from circuitkit.biped.gait.schedule import FOLDER as GAIT_FOLDER
from circuitkit.control import load_controller
from circuitkit.simulation import load_scenario
from circuitkit.study import Case, CaseBuilder, Study, load_study, make_study
from circuitkit.study.cases import Outcome
from circuitkit.study.spec import FOLDER

SMALL = {"study": "small", "scenario": "nao_push", "seeds": {"count": 2}}


def study(**changes) -> Study:
    return make_study(SMALL | changes)


def case(settings=None, **changes) -> Case:
    """A case of a small study."""
    return CaseBuilder(study(**changes)).case(settings)


def written(tmp_path, *lines):
    path = tmp_path / "mine.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


def complaints(path) -> list[str]:
    with pytest.raises(InputError) as caught:
        load_study(path)
    return [str(problem).removeprefix(f"{path}:") for problem in caught.value.problems]


HEAD = ("study: mine", "scenario: nao_push", "seeds: {count: 2}")


def sweeps(name: str) -> bool:
    """Whether a shipped study is none that tunes."""
    return "tune" not in read_yaml(find_data_file(name, FOLDER)).data


@pytest.mark.parametrize("name", [name for name in shipped_names(FOLDER) if sweeps(name)])
def test_every_shipped_study_fits(name):
    found = load_study(name)
    assert found.name == name
    assert len(found.cells) == math.prod(len(values) for values in found.axes.values())


# --- cells --------------------------------------------------------------------------------------------------


def test_cells_are_all_combinations_and_the_last_axis_varies_first():
    found = study(axes={"push.direction": ["inward", "outward"], "push.duration": ["0.1 s", "200 ms"]})
    expected = list(itertools.product(["inward", "outward"], [0.1, 0.2]))
    assert [tuple(cell.labels.values()) for cell in found.cells] == expected
    assert found.cells[1].texts == {"push.direction": "inward", "push.duration": "200 ms"}


def test_a_study_without_axes_has_one_cell():
    assert [cell.labels for cell in study().cells] == [{}]


def test_labels_are_numbers_only_where_all_values_are_of_one_dimension():
    assert [cell.labels["x"] for cell in study(axes={"x": ["1 cm", "2 m"]}).cells] == [0.01, 2.0]
    assert [cell.labels["x"] for cell in study(axes={"x": ["15 deg", "inward"]}).cells] == [
        "15 deg",
        "inward",
    ]
    assert [cell.labels["x"] for cell in study(axes={"x": [True, False]}).cells] == [True, False]


def test_a_search_counts_its_grid_in_decimals():
    """0.1 + 0.2 is not 0.3 in binary; as it is written it is."""
    search = study(search={"field": "x", "low": "0.1 s", "high": "400 ms", "step": "0.1 s"}).search
    assert [search.value(i) for i in range(search.count)] == ["0.1 s", "0.2 s", "0.3 s", "0.4 s"]


# --- smaller copies -----------------------------------------------------------------------------------------


def test_a_copy_changes_what_is_named_and_nothing_else():
    whole = load_study("push_limits")
    small = whole.with_(
        {
            "seeds": {"count": 2},
            "search": {"step": "6 N"},
            "set": {"circuit.leak": "5 %"},
            "axes": {"contender": ["open loop"], "push.duration": ["0.3 s"], "reference.gait": None},
        }
    )
    assert (len(small.seeds), small.search.step, small.search.high) == (2, "6 N", "60 N")
    assert small.file.set == {"push.start.step": 4, "circuit.leak": "5 %"}
    assert [cell.labels for cell in small.cells] == [
        {"contender": "open loop", "push.direction": way, "push.duration": 0.3}
        for way in ("outward", "inward")
    ]
    assert len(whole.cells) == 48
    assert small.with_({"search": None}).search is None


def test_a_copy_with_an_unknown_name_says_which_there_are():
    with pytest.raises(
        InputError, match=r"axes\.contender: unknown value 'open lop'.*did you mean 'open loop'"
    ):
        load_study("push_limits").with_({"axes": {"contender": ["open lop"]}})


# --- cases --------------------------------------------------------------------------------------------------


def test_a_case_is_the_scenario_with_its_changes():
    found = case(
        {
            "reference.gait": "gait_march",
            "reference.step_length": "1 cm",
            "circuit.w": "1 deg",
            "push.direction": "forward",
            "body.friction": 0.4,
        },
        set={"push.force": "5 N"},
    )
    (push,) = found.scenario.pushes
    assert (push.force, push.direction, push.duration) == (5.0, "forward", 0.2)
    assert (found.reference.gait.gait, found.reference.gait.step_length) == ("gait_march", 0.01)
    assert found.circuits.used.parameters["w"].value_si == pytest.approx(math.radians(1))
    assert [each.friction for each in found.scenario.befalling if each.kind == "body"] == [0.4]
    assert found.scenario.duration == load_scenario("nao_push").duration


def test_later_settings_win():
    assert case({"push.force": "6 N"}, set={"push.force": "5 N"}).scenario.pushes[0].force == 6


def kinds(found: Case) -> list[str]:
    return [each.kind for each in found.scenario.befalling]


def test_a_disturbance_that_is_not_there_is_added_and_the_nth_is_found_by_its_number():
    found = case({"slope.left": "3 deg", "push.force": "3 N", "push[1]": {**PUSH, "force": "7 N"}})
    assert kinds(found) == ["jitter", "push", "noise", "slope", "push"]
    assert [push.force for push in found.scenario.pushes] == [3, 7]
    again = case({"push[1]": {**PUSH, "force": "7 N"}, "push[1].force": "8 N", "push[0].force": "4 N"})
    assert [push.force for push in again.scenario.pushes] == [4, 8]


PUSH = {"body": "torso", "force": "9 N", "direction": "left", "duration": "0.1 s", "start": "2 s"}


def test_a_list_takes_the_place_of_all_disturbances_of_its_kind():
    assert kinds(case({"push": []})) == ["jitter", "noise"]
    assert kinds(case({"noise.std": "1 N", "push": [PUSH, PUSH], "noise": []})) == ["jitter", "push", "push"]
    (push,) = case({"push": [PUSH]}).scenario.pushes
    assert (push.force, push.start) == (9.0, 2.0)


def test_the_whole_list_can_be_given_too():
    assert kinds(case({"disturbances": [{"push": PUSH}], "slope.left": "1 deg"})) == ["push", "slope"]


def test_measures_can_be_added():
    assert case({"measures.tilt": "max(abs(roll))"}).scenario.formulas["tilt"] == "max(abs(roll))"


def test_fields_of_controller_and_robot_files_are_fields_too():
    assert (
        case({"controller.description": "mine"}, set={"controller": "dcm_ankle"}).controller.description
        == "mine"
    )
    found = case({"controller.lateral.limit": "9 deg", "controller": "dcm_ankle"})
    assert found.controller == load_controller("dcm_ankle", {"lateral.limit": "9 deg"})
    softer = case({"robot.timestep": "1 ms"})
    assert softer.scenario.robot.timestep == 0.001
    assert softer.plan().robot.model.opt.timestep == 0.001
    assert softer.shared_key != case().shared_key


def test_another_kind_of_reference_brings_its_own_fields():
    found = case({"reference.stand": {}, "reference.knee": "20 deg", "push": []})
    assert found.reference.spec.knee == pytest.approx(math.radians(20))
    assert found.key != case({"reference.stand": {}, "push": []}).key


def test_a_case_can_be_sent_elsewhere():
    for settings in (
        {"controller": "dcm_ankle"},
        {"robot.timestep": "1 ms"},
        {"reference.stand": {}, "push": []},
    ):
        found = case(settings)
        sent = pickle.loads(pickle.dumps(found))
        assert (sent.key, sent.scenario) == (found.key, found.scenario)


def test_runs_end_so_long_after_the_last_push():
    """Step 4 begins after 1 s and four steps of 0.55 s, its lift 50 ms later; 0.4 of 250 ms more: 3.35 s."""
    found = case(watch="2 s", set={"push.start.step": 4})
    assert found.scenario.duration == pytest.approx(3.35 + 0.2 + 2.0, abs=1e-9)
    at_a_time = case(watch="2 s", set={"push.start": "5 s"})
    assert at_a_time.scenario.duration == pytest.approx(5 + 0.2 + 2.0, abs=1e-9)


def test_without_a_push_the_scenarios_duration_counts():
    assert case({"push": []}, watch="2 s").scenario.duration == 17.0


def test_nothing_may_begin_after_the_end_of_the_runs():
    """The push ends at 3.55 s; with 2 s of watch, what begins at 9 s would never befall anybody."""
    late = {"push.start.step": 4, "actuator": {"strength": "0 %", "start": "9 s"}}
    assert case(late).scenario.befalling[-1].begins == 9.0
    with pytest.raises(InputError) as caught:
        case(late, watch="2 s")
    assert str(caught.value).endswith(
        "watch: disturbances[3].actuator starts at 9 s, after the end; allowed: before 5.55 s"
    )
    with pytest.raises(InputError, match=r"actuator.start: found 20 s, and the run ends at 17 s"):
        case({"actuator": {"strength": "0 %", "start": "20 s"}})
    with pytest.raises(InputError, match=r"found 17 s, and the run ends at 17 s"):
        case({"push.start": "17 s"})
    jittered = {"push.start": "1 s", "jitter.start": "5 s"}  # by how much pushes differ, not when it begins
    assert case(jittered, watch="1 s").scenario.duration == pytest.approx(2.2)


def test_a_measure_holds_if_it_is_true_or_false():
    found = Outcome(0, {"survived": True, "sway": 0.5, "reached": None}, None)
    assert found.survived
    assert found.holds("reached") is None
    with pytest.raises(CircuitkitError) as caught:
        found.holds("sway")
    assert str(caught.value) == (
        "found the measure 'sway', which is a number; allowed: one that is true or false"
    )


def test_keys_are_equal_for_equal_runs_only():
    base = case()
    assert case(watch="3 s").key != base.key
    assert case(description="other words").key == base.key
    assert case({"circuit": "binn_lateral_tuned"}).key == base.key
    for change in (
        {"push.force": "21 N"},
        {"circuit.w": "1 deg"},
        {"reference.knee": "34 deg"},
        {"slope.left": "1 deg"},
    ):
        assert case(change).key != base.key
    pushed = case({"push.force": "21 N"})
    assert pushed.shared_key == base.shared_key  # they can be stepped together
    assert case({"delay": {"channel": "*", "by": "20 ms"}}).shared_key != base.shared_key
    assert case({"measures.tilt": "max(abs(roll))"}).shared_key != base.shared_key


# --- complaints ---------------------------------------------------------------------------------------------


def test_every_wrong_field_is_told_where_the_study_has_it(tmp_path):
    path = written(
        tmp_path,
        *HEAD,
        "axes:",
        "  contender:",
        "    a: {controller: open_lop}",
        "    b: {controller: circuit, circuit.q1.slpoe: 3 /m}",
        "    c: {circuit.w: 3 mm}",
        '  "push[2].force": [3 N]',
        "  reference.step_lenght: [2 cm]",
        "  delay.by: [3 N]",
        "  psh.force: [3 N]",
        "search: {field: push.forc, low: 0 N, high: 6 N, step: 1 N}",
    )
    found = complaints(path)
    starts = [
        "6:21: controller: unknown controller 'open_lop'; allowed: open_loop, circuit, ",
        "7:30: circuit.q1.slpoe: unknown name 'q1.slpoe'; allowed: ",
        "8:20: circuit.w: found 3 mm (length); allowed: angle",
        "9:3: push[2].force: there is 1 push; allowed: push, or push[1] for a new one",
        "10:3: reference.step_lenght: unknown key 'step_lenght'; allowed: ",
        "11:14: delay.by: found '3 N', which is force; allowed: a quantity such as '200 ms'",
        "12:3: psh.force: unknown field 'psh'; allowed: ",
        "13:17: push.forc: unknown key 'forc'; allowed: ",
    ]
    assert len(found) == len(starts)
    for text, start in zip(found, starts, strict=True):
        assert text.startswith(start)
    for i, meant in ((0, "open_loop"), (1, "q1.slope"), (4, "step_length"), (6, "push"), (7, "force")):
        assert found[i].endswith(f"did you mean '{meant}'?")


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["scenari: nao_push"], "4:1: scenari: unknown key 'scenari'"),
        (
            ["search: {field: x, low: 0 N, high: 6 s, step: 1 N}"],
            "4:9: search: found 0 N and 6 s: low is force",
        ),
        (
            ["search: {field: x, low: 0 N, high: 7 N, step: 2 N}"],
            "4:9: search: found low 0 N, high 7 N, step 2 N",
        ),
        (["search: {field: x, low: 0 N, high: 7 Q, step: 2 N}"], "4:36: search.high: unknown unit 'Q'"),
        (
            ["axes: {reference.gait: []}"],
            "4:24: axes.reference.gait: found no values; allowed: a list of values",
        ),
        (
            ["axes: {reference.gait: [[gait_march]]}"],
            "4:25: axes.reference.gait[0]: found a list of 1; allowed: a text",
        ),
        (["axes: {seed: [1, 2]}"], "4:8: axes.seed: found 'seed', which is a column of the results"),
        (
            ["axes: {reference.gait: [gait_march, gait_march]}"],
            "4:37: axes.reference.gait[1]: found 'gait_march', the same as",
        ),
        (["set: {reference.gait: gait_mrach}"], "4:23: reference.gait: unknown name 'gait_mrach'"),
        (
            ["set: {reference.gait: gait_mrach, reference.knee: 3 deg}"],
            "4:23: reference.gait: unknown name 'gait_mrach'",
        ),
        (["set: {'push[0]force': 3 N}"], "4:7: push[0]force: found 'push[0]force'; allowed: the path"),
        (
            ["set: {controller.gain: 3, controller: circuit}"],
            "4:7: controller.gain: the controller 'circuit'",
        ),
        (["set: {pushes.force: 3 N}"], "4:7: pushes.force: unknown field 'pushes'; allowed: scenario, "),
        (
            ["set: {disturbances.force: 3 N}"],
            "4:7: disturbances.force: disturbances is a list; allowed: an item",
        ),
        (["set: {duration.at: 3 N}"], "4:7: duration.at: duration has no fields"),
        (
            ["set: {push.start.stp: 4}"],
            "4:23: push.start.stp: unknown key 'stp'; allowed: at, phase, step; did you mean 'step'?",
        ),
        (
            ["set: {push.start.step: 40}"],
            "4:24: push.start.step: found step 40, and the walk ends before that",
        ),
        (["watch: 5 m"], "4:8: watch: found '5 m', which is length"),
        (
            ["tune: {trials: 3}"],
            "4:1: tune: found a study that tunes; allowed: one that sweeps; circuitkit tune",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, lines, expected):
    (found,) = complaints(written(tmp_path, *HEAD, *lines))
    assert found.startswith(expected)


def test_an_unknown_scenario_is_told_where_the_study_names_it(tmp_path):
    path = written(tmp_path, "study: mine", "scenario: nao_psuh", "seeds: {count: 2}")
    (found,) = complaints(path)
    assert found.startswith("2:11: scenario: unknown name 'nao_psuh'")
    assert found.endswith("did you mean 'nao_push'?")


def test_a_circuit_as_a_whole_is_complained_about_in_its_own_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circuit.yaml").write_text("circuit: broken\ncontrol_step: 10 ms\n")
    written(tmp_path, *HEAD, "axes: {circuit: [circuit.yaml, nowhere.yaml]}")
    found = complaints("mine.yaml")
    assert [text for text in found if text.startswith("circuit.yaml:1:1: missing key 'timing'")]
    assert [
        text for text in found if text.startswith("4:32: circuit: there is no such file; allowed: a YAML")
    ]


def test_a_path_with_brackets_between_braces_is_told_to_need_quotes(tmp_path):
    path = written(tmp_path, *HEAD, "set: {watch: 3 s, push[0].force: 3 N}")
    (complaint,) = complaints(path)
    assert complaint.startswith("4:23: this is not YAML")
    assert complaint.endswith('put a name with brackets in quotes, such as "push[0].force"')


def test_files_beside_the_study_are_found_from_anywhere(tmp_path, monkeypatch):
    gait = find_data_file("gait_march", GAIT_FOLDER).read_text().replace("gait: gait_march", "gait: mine")
    (tmp_path / "my_gait.yaml").write_text(gait)
    path = written(tmp_path, *HEAD, "set: {reference.gait: my_gait.yaml}")
    monkeypatch.chdir("/")
    assert CaseBuilder(load_study(path)).case().reference.name == "mine"
