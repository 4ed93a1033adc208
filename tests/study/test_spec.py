"""Study files: what they may say, what is found wrong with them and where, and which points they mean."""

from __future__ import annotations

import itertools
import math
import pickle

import pytest

from circuitkit.base.errors import InputError
from circuitkit.base.source import find_data_file, read_yaml, shipped_names
from circuitkit.biped.gait.spec import FOLDER as GAIT_FOLDER
from circuitkit.simulation import load_scenario
from circuitkit.study import Study, load_study, make_study
from circuitkit.study.spec import FOLDER

SMALL = {"study": "small", "scenario": "nao_push", "seeds": {"count": 2}}


def study(**changes) -> Study:
    return make_study(SMALL | changes)


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
    found = study(
        axes={"pushes[0].direction": ["inward", "outward"], "pushes[0].duration": ["0.1 s", "200 ms"]}
    )
    expected = list(itertools.product(["inward", "outward"], [0.1, 0.2]))
    assert [tuple(cell.labels.values()) for cell in found.cells] == expected
    assert found.cells[1].texts == {"pushes[0].direction": "inward", "pushes[0].duration": "200 ms"}


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
            "axes": {"contender": ["open loop"], "pushes[0].duration": ["0.3 s"], "gait": None},
        }
    )
    assert (len(small.seeds), small.search.step, small.search.high) == (2, "6 N", "60 N")
    assert small.file.set == {"pushes[0].start.step": 4, "circuit.leak": "5 %"}
    assert [cell.labels for cell in small.cells] == [
        {"contender": "open loop", "pushes[0].direction": way, "pushes[0].duration": 0.3}
        for way in ("outward", "inward")
    ]
    assert len(whole.cells) == 48
    assert small.with_({"search": None}).search is None


def test_a_copy_with_an_unknown_name_says_which_there_are():
    with pytest.raises(
        InputError, match=r"axes\.contender: unknown value 'open lop'.*did you mean 'open loop'"
    ):
        load_study("push_limits").with_({"axes": {"contender": ["open lop"]}})


# --- points -------------------------------------------------------------------------------------------------


def test_a_point_is_the_scenario_with_its_changes():
    found = study(set={"pushes[0].force": "5 N"}).point(
        {
            "gait": "gait_march",
            "gait.step_length": "1 cm",
            "circuit.w": "1 deg",
            "pushes[0].direction": "forward",
            "plant.friction": 0.4,
        }
    )
    push = found.scenario.pushes[0]
    assert (push.force, push.direction, push.duration) == (5.0, "forward", 0.2)
    assert (found.gait.gait, found.gait.step_length) == ("gait_march", 0.01)
    assert found.circuit.parameters["w"].value_si == pytest.approx(math.radians(1))
    assert found.scenario.plant.friction == 0.4
    assert found.scenario.duration == load_scenario("nao_push").duration


def test_later_settings_win():
    assert (
        study(set={"pushes[0].force": "5 N"}).point({"pushes[0].force": "6 N"}).scenario.pushes[0].force == 6
    )


def test_fields_of_controller_files_are_fields_too():
    found = study(set={"controller": "dcm_ankle"}).point({"controller.description": "mine"})
    assert found.controller.description == "mine"


def test_a_point_can_be_sent_elsewhere():
    point = study().point({"controller": "dcm_ankle"})
    assert pickle.loads(pickle.dumps(point)).key == point.key


def test_runs_end_so_long_after_the_last_push():
    """Step 4 begins after 1 s and four steps of 0.55 s, its lift 50 ms later; 0.4 of 250 ms more: 3.35 s."""
    found = study(watch="2 s", set={"pushes[0].start.step": 4}).point()
    assert found.scenario.duration == pytest.approx(3.35 + 0.2 + 2.0, abs=1e-9)


def test_without_a_push_the_scenarios_duration_counts():
    assert study(watch="2 s").point({"pushes": []}).scenario.duration == 17.0


def test_keys_are_equal_for_equal_runs_only():
    base = study().point()
    assert study(watch="3 s").point().key != base.key
    assert study(description="other words").point().key == base.key
    assert study().point({"circuit": "binn_lateral_tuned"}).key == base.key
    for change in ({"pushes[0].force": "21 N"}, {"circuit.w": "1 deg"}, {"gait.knee": "34 deg"}):
        assert study().point(change).key != base.key
    pushed = study().point({"pushes[0].force": "21 N"})
    assert pushed.shared_key == base.shared_key  # they can be stepped together
    assert study().point({"sensor_delay": "20 ms"}).shared_key != base.shared_key


# --- complaints ---------------------------------------------------------------------------------------------


def test_every_wrong_field_is_told_where_the_study_has_it(tmp_path):
    path = written(
        tmp_path,
        *HEAD,
        "set: {pushes[0].start.stp: 4}".replace("pushes[0].start.stp", '"pushes[0].start.stp"'),
        "axes:",
        "  contender:",
        "    a: {controller: open_lop}",
        "    b: {controller: circuit, circuit.q1.slpoe: 3 /m}",
        "    c: {circuit.w: 3 mm}",
        "  pushes[2].force: [3 N]",
        "  gait.step_lenght: [2 cm]",
        "  sensor_delay: [3 N]",
        'search: {field: "pushes[0].forc", low: 0 N, high: 6 N, step: 1 N}',
    )
    found = complaints(path)
    starts = [
        "4:7: pushes[0].start.stp: unknown key 'stp'; allowed: at, phase, step; did you mean 'step'?",
        "7:21: controller: unknown controller 'open_lop'; allowed: open_loop, circuit, ",
        "8:30: circuit.q1.slpoe: unknown name 'q1.slpoe'; allowed: ",
        "9:20: circuit.w: found 3 mm (length); allowed: angle",
        "10:3: pushes[2].force: pushes has 1 item; allowed: [0]",
        "11:3: gait.step_lenght: unknown key 'step_lenght'; allowed: ",
        "12:18: sensor_delay: found '3 N', which is force; allowed: a quantity such as '200 ms'",
        "13:17: pushes[0].forc: unknown key 'forc'; allowed: ",
    ]
    assert len(found) == len(starts)
    for text, start in zip(found, starts, strict=True):
        assert text.startswith(start)
    for i, meant in ((1, "open_loop"), (2, "q1.slope"), (5, "step_length"), (7, "force")):
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
        (["axes: {gait: []}"], "4:14: axes.gait: found no values; allowed: a list of values"),
        (["axes: {gait: [[gait_march]]}"], "4:15: axes.gait[0]: found a list of 1; allowed: a text"),
        (["axes: {seed: [1, 2]}"], "4:8: axes.seed: found 'seed', which is a column of the results"),
        (["axes: {gait: [gait_march, gait_march]}"], "4:27: axes.gait[1]: found 'gait_march', the same as"),
        (["set: {gait: gait_mrach}"], "4:13: gait: unknown name 'gait_mrach'"),
        (["set: {gait: gait_mrach, gait.knee: 3 deg}"], "4:13: gait: unknown name 'gait_mrach'"),
        (["set: {'pushes[0]force': 3 N}"], "4:7: pushes[0]force: found 'pushes[0]force'; allowed: the path"),
        (
            ["set: {controller.gain: 3, controller: circuit}"],
            "4:7: controller.gain: the controller 'circuit'",
        ),
        (["set: {pushes.force: 3 N}"], "4:7: pushes.force: pushes is a list; allowed: an item of it"),
        (["set: {duration.at: 3 N}"], "4:7: duration.at: duration has no fields"),
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
    path = written(tmp_path, *HEAD, "set: {watch: 3 s, pushes[0].force: 3 N}")
    (complaint,) = complaints(path)
    assert complaint.startswith("4:25: this is not YAML")
    assert complaint.endswith('put a name with brackets in quotes, such as "pushes[0].force"')


def test_files_beside_the_study_are_found_from_anywhere(tmp_path, monkeypatch):
    gait = find_data_file("gait_march", GAIT_FOLDER).read_text().replace("gait: gait_march", "gait: mine")
    (tmp_path / "my_gait.yaml").write_text(gait)
    path = written(tmp_path, *HEAD, "set: {gait: my_gait.yaml}")
    monkeypatch.chdir("/")
    assert load_study(path).point().gait.gait == "mine"
