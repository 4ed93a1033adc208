"""Scenarios of Python objects, the same as those of files to the bit; controllers, references, plug-ins."""

from __future__ import annotations

import textwrap

import numpy as np
import pytest
from small_robots import CART, CART_FILE, Told, robot_file, run, small_robot

from circuitkit import load_circuit, parse_circuit
from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.base.units import parse_unit
from circuitkit.control import CircuitController, Controller, PlannedChannel, load_controller
from circuitkit.robots import load_robot
from circuitkit.simulation import (
    Moment,
    Motion,
    Reference,
    Scenario,
    compare,
    load_scenario,
    make_plan,
    simulate,
)
from circuitkit.simulation.disturbance import DISTURBANCES
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.references.hold import Hold
from circuitkit.simulation.references.key import Key

KEYS = ", ".join(sorted(Scenario.model_fields))
CIRCUIT = """\
circuit: catcher
control_step: 10 ms
timing: ordered
parameters: {gain: {value: 2 /rad}}
inputs: {lean: {unit: rad, range: [-2 rad, 2 rad]}}
neurons:
  right: {model: sigmoid, role: excitatory, slope: 4, shift: 0}
  left: {model: sigmoid, role: inhibitory, slope: 4, shift: 0}
synapses: [{from: lean, to: right, weight: gain}, {from: lean, to: left, weight: -gain}]
outputs: {motor_force: {unit: N, readout: {right: 5 N, left: -5 N}}}
"""
FILE = """\
scenario: caught
robot: robot.yaml
reference: {hold: {hinge: 20 deg}}
circuit: catcher.yaml
connect: {inputs: {lean: angle}, outputs: {motor_force: force}}
duration: 0.8 s
disturbances:
  - jitter: {start: 20 ms, joints: 2 deg}
  - push: {body: pole, force: 2 N, direction: forward, duration: 0.1 s, start: 0.2 s, at: [0 m, 0 m, -10 cm]}
  - noise: {channel: angle, std: 0.5 deg}
until: abs(place) > 40 cm
measures: {way: max(abs(place)), survived: not ended}
seed: 5
"""


@pytest.fixture
def files(tmp_path):
    robot_file(tmp_path, CART, **CART_FILE)
    (tmp_path / "catcher.yaml").write_text(CIRCUIT, encoding="utf-8")
    (tmp_path / "caught.yaml").write_text(FILE, encoding="utf-8")
    return tmp_path


def objects(its_robot, **changes):
    """The same scenario as in the file, of objects."""
    fields = {
        "robot": its_robot,
        "reference": Hold({"hinge": "20 deg"}),
        "controller": CircuitController(
            parse_circuit(CIRCUIT), connect={"inputs": {"lean": "angle"}, "outputs": {"motor_force": "force"}}
        ),
        "duration": 0.8,
        "disturbances": [
            Jitter(start=0.02, joints=np.radians(2)),
            Push(body="pole", force=2.0, direction="forward", duration=0.1, start=0.2, at=(0.0, 0.0, -0.1)),
            Noise(channel="angle", std="0.5 deg"),
        ],
        "control_step": 0.01,
        "until": "abs(place) > 40 cm",
        "measures": {"way": "max(abs(place))", "survived": "not ended"},
        "seed": 5,
    }
    return Scenario(**fields | changes)


def same_bits(one, other):
    for name in ("readings", "qpos", "observations", "commands", "trace"):
        np.testing.assert_array_equal(
            getattr(one, name).view(np.int64), getattr(other, name).view(np.int64), err_msg=name
        )


# --- as in a file -------------------------------------------------------------------------------------------


def test_a_scenario_of_objects_is_that_of_the_file_to_the_bit(files, tmp_path):
    from_file = simulate(files / "caught.yaml")
    from_objects = simulate(objects(small_robot(tmp_path, CART, **CART_FILE)))
    same_bits(from_file.recording, from_objects.recording)
    assert from_file.measures == from_objects.measures
    assert from_file.recording.trace_names == ("right", "left")
    assert np.ptp(from_file.recording.commands) > 1


def test_a_field_takes_what_a_file_may_say(files):
    """Text with units, mappings and lists as YAML would give them."""
    fields = {
        "robot": str(files / "robot.yaml"), "reference": {"hold": {"hinge": "20 deg"}},
        "controller": None, "circuit": parse_circuit(CIRCUIT),
        "connect": {"inputs": {"lean": "angle"}, "outputs": {"motor_force": "force"}},
        "duration": 0.8, "until": "abs(place) > 40 cm",
        "disturbances": [
            {"jitter": {"start": 0.02, "joints": np.radians(2)}},
            {"push": {"body": "pole", "force": 2.0, "direction": "forward", "duration": 0.1, "start": 0.2,
                      "at": (0.0, 0.0, -0.1)}},
            {"noise": {"channel": "angle", "std": "0.5 deg"}},
        ],
        "seed": 5,
    }  # fmt: skip
    same_bits(simulate(Scenario(**fields)).recording, simulate(files / "caught.yaml").recording)


def test_a_plan_serves_a_batch_that_is_the_single_runs_to_the_bit(files):
    plan = make_plan(load_scenario(files / "caught.yaml"))
    controller = plan.controller()
    from circuitkit.simulation.loop import run_loop

    specs = [plan.own_spec(seed) for seed in (5, 7, 9)]
    batch = run_loop(plan.setup(controller, specs))
    for i, spec in enumerate(specs):
        alone = run_loop(plan.setup(controller, [spec]))
        ticks = alone.ticks
        np.testing.assert_array_equal(batch.qpos[:ticks, i], alone.qpos[:, 0])
        np.testing.assert_array_equal(batch.trace[:ticks, i], alone.trace[:, 0])
        assert batch.measures[i] == alone.measures[0]


def test_a_scenario_that_is_changed_forgets_nothing(files):
    loaded = load_scenario(files / "caught.yaml")
    assert len(loaded.befalling) == 3
    calm = loaded.model_copy(update={"disturbances": ()})
    assert calm.befalling == ()
    assert loaded.with_disturbances(loaded.befalling[:1]).befalling == loaded.befalling[:1]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"duration": -1.0}, "duration: found -1.0; allowed: more than 0"),
        ({"robot": 3}, "robot: found 3; allowed: the name of a robot, the path of a robot file, or a Robot"),
        ({"circuit": Key("home")}, "circuit: found an object of the class Key; allowed: the name of a "
            "circuit, a path, or a CircuitGraph"),
        ({"disturbances": [{"pusch": {}}]}, "disturbances[0].pusch: unknown key 'pusch'; allowed: "
            f"{', '.join(sorted(DISTURBANCES.kinds))}; did you mean 'push'?"),
        ({"disturbances": Jitter(joints=0.1)}, "disturbances: found an object of the class Jitter; allowed: "
            "a list"),
        ({"disturbances": [3]}, "disturbances[0]: found 3; allowed: a mapping"),
        ({"controller": 3}, "controller: found 3; allowed: a name, a path, or a Controller"),
        ({"reference": "home"}, "reference: found 'home'; allowed: a mapping"),
        ({"reference": Key}, "reference: found the class Key; allowed: a mapping"),
        ({"measures": ["max(place)"]}, "measures: found a list of 1; allowed: a mapping"),
        ({"controler": "open_loop"}, f"controler: unknown key 'controler'; allowed: {KEYS}; did you mean "
            "'controller'?"),
    ],
)  # fmt: skip
def test_a_wrong_field_is_refused(tmp_path, changes, said):
    with pytest.raises(InputError) as caught:
        objects(small_robot(tmp_path, CART, **CART_FILE), **changes)
    assert str(caught.value) == said


def test_a_kind_made_in_python_complains_as_its_file_does():
    with pytest.raises(InputError) as caught:
        Push(body=3, force="1 kg", direction="left", duration=0.1, start=0.0, colour="red")
    assert sorted(str(caught.value).splitlines()) == [
        "body: found 3; allowed: a text",
        "colour: unknown key 'colour'; allowed: at, body, direction, duration, force, height, start, torque",
        "force: found '1 kg', which is mass; allowed: a quantity such as '20 N'",
    ]


ONE_OF = "allowed: the name of one of the shipped"
A_SCENARIO = "the name of a scenario, a path, or a Scenario"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: simulate(5), f"scenario: found 5; allowed: {A_SCENARIO}"),
        (lambda: simulate(None), f"scenario: found nothing; allowed: {A_SCENARIO}"),
        (
            lambda: simulate("cartpole_balances", robot=5, seed="3"),
            "seed: found '3'; allowed: a whole number\nrobot: found 5; allowed: the name of a robot, the "
            "path of a robot file, or a Robot",
        ),
        (
            lambda: simulate("cartpole_balances", circuit=Key("home")),
            "circuit: found an object of the class Key; allowed: the name of a circuit, a path, or a "
            "CircuitGraph",
        ),
        (
            lambda: simulate("cartpole_balances", settings=["w"]),
            "settings: found a list of 1; allowed: values by name, such as {'w': '2 deg'}",
        ),
        (
            lambda: compare("cartpole_balances", "open_loop"),
            "controllers: found 'open_loop'; allowed: a list, such as ['open_loop', 'circuit']",
        ),
        (lambda: compare("cartpole_balances", 5), "controllers: found 5; allowed: a list, such as "
            "['open_loop', 'circuit']"),
        (lambda: load_robot(None), f"found nothing; {ONE_OF} robots, or a path"),
        (lambda: load_circuit(5), f"found 5; {ONE_OF} circuits, or a path"),
        (lambda: load_scenario([]), f"found a list of 0; {ONE_OF} sims, or a path"),
        (
            lambda: load_controller(np.zeros(2)),
            f"found an array of shape (2,); {ONE_OF} controllers, or a path",
        ),
    ],
)  # fmt: skip
def test_an_object_in_the_place_of_another_is_refused_by_name(call, said):
    with pytest.raises(InputError) as caught:
        call()
    assert str(caught.value) == said


PROTOCOL = (
    "; a controller is an object with name, observations and commands (lists of names), reset(robots), and "
    "step(observation), which takes an array of shape (robots, observations) and returns one of shape "
    "(robots, commands)"
)
WITH_ALL = "allowed: the name of a controller, a path, or an object with all of these"
SHAPE = "an array of numbers of shape (1, 1), a row for each robot and a column for each command"


class Returning(Told):
    """A controller whose step returns what it was told, in the first tick and later."""

    def __init__(self, found):
        super().__init__(force=1.0)
        self.found = found

    def step(self, observation):  # noqa: ARG002 - of the protocol
        return self.found


def told(**changes):
    made = Told(force=1.0)
    for key, value in changes.items():
        setattr(made, key, value)
    return made


@pytest.mark.parametrize(
    ("controller", "said"),
    [
        (Key("home"), "controller: found an object of the class Key without observations, commands, reset, "
            f"step; {WITH_ALL}"),
        (Returning, "controller: found the class Returning; allowed: an object of it, such as Returning()"),
        (np.zeros(3), "controller: found an array of shape (3,) without name, observations, commands, reset, "
            f"step; {WITH_ALL}"),
        (told(observations="angle"), "controller.observations: found 'angle'; allowed: a tuple of names, "
            "such as ('angle',)"),
        (told(commands=["force", 3]), "controller.commands: found 3; allowed: a tuple of names, such as "
            "('yaw', 'speed')"),
        (told(commands=("force", "force")), "controller.commands: found a list of 2; "
            "allowed: each name once"),
        (told(trace_names="ab", store_trace=print), "controller.trace_names: found 'ab'; allowed: a tuple of "
            "names, such as ('ab',)"),
        (told(trace_names=("a", "a"), store_trace=print), "controller.trace_names: found a list of 2; "
            "allowed: each name once"),
        (told(trace_names=("a",)), "controller: found an object of the class Told without store_trace; "
            "allowed: with trace_names, also store_trace(row)"),
        (told(step=None), "controller.step: found nothing; allowed: a method"),
        (told(name=3), "controller.name: found 3; allowed: a text"),
        (Returning(None), f"controller.'told'.step: found nothing; allowed: {SHAPE}"),
        (Returning([[1.0]]), f"controller.'told'.step: found a list of 1; allowed: {SHAPE}"),
        (Returning(1.0), f"controller.'told'.step: found 1.0; allowed: {SHAPE}"),
        (Returning(np.zeros(1)), f"controller.'told'.step: found an array of shape (1,); allowed: {SHAPE}"),
        (Returning(np.zeros((2, 1))), "controller.'told'.step: found an array of shape (2, 1); "
            f"allowed: {SHAPE}"),
        (Returning(np.array([["a"]])), "controller.'told'.step: found an array of shape (1, 1) of str32; "
            f"allowed: {SHAPE}"),
    ],
)  # fmt: skip
def test_what_is_no_controller_is_told_what_one_is(cart, controller, said):
    scenario = Scenario(robot=cart, duration=0.1, control_step=0.01)
    with pytest.raises(InputError) as caught:
        simulate(scenario, controller=controller)
    assert str(caught.value) == said + PROTOCOL


def test_what_bind_gives_is_checked_as_well(cart):
    class Binding:
        def bind(self, interface):  # noqa: ARG002 - of the protocol
            return None

    with pytest.raises(InputError, match="controller: found nothing without name, observations"):
        simulate(Scenario(robot=cart, duration=0.1, control_step=0.01), controller=Binding())


def test_commands_of_another_shape_in_a_later_tick(cart):
    class Shrinking(Told):
        def step(self, observation):
            found = super().step(observation)
            return found if self._tick < 20 else found[0]

    with pytest.raises(InputError) as caught:
        simulate(Scenario(robot=cart, duration=0.5, control_step=0.01), controller=Shrinking(force=1.0))
    said = f"controller.'told'.step: found an array of shape (1,); allowed: {SHAPE}"
    assert str(caught.value) == said + PROTOCOL


# --- controllers --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("cart"), CART, **CART_FILE)


class Spring:
    """Pulls the cart back: force = -k place."""

    name = "spring"
    observations = ("place",)
    commands = ("force",)
    trace_names = ("pulling",)

    def __init__(self, stiffness: float) -> None:
        self.stiffness, self.resets = stiffness, []

    def reset(self, batch):
        self.resets.append(batch)

    def step(self, observation):
        self._force = -self.stiffness * observation
        return self._force

    def store_trace(self, row):
        row[...] = self._force > 0


def test_any_object_with_the_protocol_is_a_controller(cart):
    """On a spring of 80 N/m a cart of 2 kg swings the faster for the pole of 0.5 kg that hangs from it.

    Linearised, M q'' + K q = 0 with M = [[m + p, p l / 2], [p l / 2, p l^2 / 3]] and K = diag(k, p g l / 2).
    """
    spring = Spring(80.0)
    assert isinstance(spring, Controller)
    result = simulate(
        Scenario(
            robot=cart, controller=spring, control_step=0.002, duration=2.0, reference=Hold({"slide": "5 mm"})
        )
    )
    place = result.recording.channel("place")[:, 0]
    crossings = np.flatnonzero(np.diff(np.signbit(place)))
    period = 2 * np.diff(crossings).mean() * 0.002
    mass = np.array([[2.5, -0.25], [-0.25, 0.5 / 3]])
    fastest = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, np.diag([80, 0.5 * 9.81 / 2])))).max()
    assert period == pytest.approx(2 * np.pi / fastest, rel=0.05)
    assert spring.resets == [1]
    recording = result.recording
    np.testing.assert_array_equal(recording.trace[..., 0], recording.commands[..., 0] > 0)
    assert recording.columns()["neuron_pulling"].max() == 1
    assert result.row()["controller"] == "spring"
    np.testing.assert_array_equal(recording.observations[1:, 0, 0], place[:-1])


def test_a_controller_object_stands_in_for_the_files(files):
    result = simulate(files / "caught.yaml", controller=Told(force=1.0))
    assert result.recording.controller == "told"
    assert (result.recording.commands == 1).all()


def test_controllers_are_compared_under_the_same_disturbances(files, tmp_path, monkeypatch):
    from circuitkit.simulation import plots

    monkeypatch.setattr(plots, "draw_result", lambda *_: None)
    monkeypatch.setattr(plots, "draw_comparison", lambda *_: None)
    results = compare(
        files / "caught.yaml",
        ["circuit", "open_loop", Told(force=0.5), Told(force=0.5)],
        output=tmp_path / "out",
    )
    assert [each.path.parent.name for each in results] == ["circuit", "open_loop", "told", "told_2"]
    np.testing.assert_array_equal(results[2].recording.qpos, results[3].recording.qpos)
    pushes = [each.recording.push_n[:30] for each in results]
    np.testing.assert_array_equal(pushes[0], pushes[1])


def test_a_controller_that_reads_what_there_is_not(cart):
    with pytest.raises(
        UnknownNameError,
        match="unknown channel 'plac'; allowed: place, speed, angle, twice, pull; did you mean 'place'",
    ):
        run(cart, Told(["plac"]))
    with pytest.raises(
        UnknownNameError, match="unknown command of the robot 'forc'; allowed: force; did you mean 'force'"
    ):
        run(cart, Told(forc=1.0))


def test_a_controller_is_asked_once_to_bind(cart):
    class Binding:
        def bind(self, interface):
            self.seen = interface
            return Told(force=interface.step_s)

    binding = Binding()
    recording = run(cart, binding, step_s=0.004)
    assert (recording.commands == 0.004).all()
    assert binding.seen.observations["angle"].symbol == "deg"
    assert binding.seen.commands["force"].symbol == "N"


# --- connect ------------------------------------------------------------------------------------------------


def complaint(files, old, new):
    assert old in FILE
    path = files / "caught.yaml"
    path.write_text(FILE.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        simulate(path)
    return str(caught.value).replace(str(files) + "/", "")


def test_without_connect_names_must_be_equal(files):
    said = complaint(
        files, "connect: {inputs: {lean: angle}, outputs: {motor_force: force}}\n", ""
    ).splitlines()
    assert said == [
        "catcher.yaml:5:10: inputs.lean: the robot has no channel 'lean'; allowed: place, speed, angle, "
        "twice, pull; "
        "connect: {inputs: {lean: NAME}} in the scenario joins another name",
        "catcher.yaml:10:11: outputs.motor_force: the robot has no command 'motor_force'; allowed: force; "
        "did you mean 'force'?",
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "lean: angle", "lean: angel",
            "caught.yaml:5:26: connect.inputs.lean: the robot has no channel 'angel'; "
            "allowed: place, speed, angle, twice, pull; did you mean 'angle'?",
        ),
        (
            "lean: angle", "lean: place",
            "caught.yaml:5:26: connect.inputs.lean: found the unit 'rad'; "
            "allowed: the robot's channel 'place' has 'm', or like it",
        ),
        (
            "lean: angle", "laen: angle",
            "caught.yaml:5:26: connect.inputs.laen: the circuit has no input 'laen'; allowed: lean; "
            "did you mean 'lean'?",
        ),
        (
            "motor_force: force", "motor_force: place",
            "caught.yaml:5:57: connect.outputs.motor_force: the robot has no command 'place'; allowed: force",
        ),
        (
            "duration: 0.8 s", "duration: 0.8 s\ncontrol_step: 20 ms",
            "catcher.yaml:1:1: control_step: found 10 ms; allowed: the control step of the run, 20 ms",
        ),
    ],
)  # fmt: skip
def test_a_wrong_connection_is_told_with_its_place(files, old, new, said):
    assert complaint(files, old, new).splitlines()[0] == said


def test_an_input_and_an_output_may_be_joined_to_the_same_names_as_another_circuits(cart):
    both = CircuitController(
        parse_circuit(CIRCUIT), connect={"inputs": {"lean": "angle"}, "outputs": {"motor_force": "force"}}
    )
    recording = run(cart, both, reference=Hold({"hinge": "10 deg"}))
    assert recording.observation_names == ("angle",)
    assert recording.command_names == ("force",)
    first = 5 * (1 / (1 + np.exp(-4 * 2 * np.radians(10))) - 1 / (1 + np.exp(4 * 2 * np.radians(10))))
    assert recording.commands[0, 0, 0] == pytest.approx(first)


# --- references ---------------------------------------------------------------------------------------------


def test_hold_starts_there(cart):
    recording = run(cart, reference=Hold({"hinge": "30 deg", "slide": "10 cm"}), duration_s=0.01)
    np.testing.assert_allclose(recording.qpos[0, 0], [0.1, np.radians(30)], atol=1e-2)


def test_key_starts_there_and_holds_its_controls(cart):
    recording = run(cart, reference=Key("swung"), duration_s=0.1)
    assert recording.qpos[0, 0] == pytest.approx([0.3, 0.5], abs=1e-2)
    np.testing.assert_allclose(recording.channel("pull"), 1.5)
    more = run(cart, Told(force=2.0), reference=Key("swung"), duration_s=0.1)
    np.testing.assert_allclose(more.channel("pull"), 3.5)


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (Hold({"hing": "1 deg"}), "reference.hold.hing: the MJCF has no hinge or slide 'hing'; allowed: "
            "slide, hinge; "
         "did you mean 'hinge'?"),
        (Hold({"slide": "1 deg"}), "reference.hold.slide: found '1 deg', but slide is a slide; allowed: a "
            "quantity in m or like it"),
        (Key("swing"), "reference.key: the MJCF has no keyframe 'swing'; allowed: swung, home; did you mean "
            "'swung'?"),
    ],
)  # fmt: skip
def test_a_reference_that_does_not_fit_the_robot(cart, reference, said):
    with pytest.raises(InputError) as caught:
        run(cart, reference=reference)
    assert str(caught.value) == said


class Wave(Reference):
    """Pushes the cart to and fro; its moments are crests, and it plans what it wants."""

    name = "wave"
    step_s = 0.004

    def moment(self, where, duration_s):  # noqa: ARG002 - of the protocol
        return Moment(0.05 * where["crest"], {"along": np.array([1.0, 0.0, 0.0])})

    def motion(self, robot, ticks, step_s):
        wanted = np.sin(2 * np.pi * np.arange(ticks) * step_s)
        planned = {"wanted": PlannedChannel(parse_unit("N"), wanted)}
        return Motion(
            wanted[:, np.newaxis], robot.start_qpos, planned, {"beat": np.arange(ticks) % 20}, pace_s=1.0
        )


def test_a_reference_of_ones_own_brings_targets_moments_directions_and_channels(cart):
    push = Push(body="cart", force=4.0, direction="along", duration=0.05, start={"crest": 2})
    scenario = Scenario(robot=cart, reference=Wave(), duration=0.4, disturbances=[push],
                        measures={"most": "max(wanted)", "error": "rms(pull - wanted)"})  # fmt: skip
    plan = make_plan(scenario)
    assert plan.body.step_s == 0.004
    recording = run(
        cart, reference=Wave(), step_s=None, duration_s=0.4, disturbances=[push], measures=scenario.measures
    )
    assert recording.ticks == 100
    assert recording.effects.windows_s[0] == pytest.approx([0.1, 0.15])
    assert recording.measures[0]["most"] == pytest.approx(1.0, abs=1e-3)
    assert recording.measures[0]["error"] == pytest.approx(0, abs=1e-9)
    columns = recording.columns()
    np.testing.assert_array_equal(columns["beat"], np.arange(100) % 20)
    np.testing.assert_allclose(columns["wanted_n"], np.sin(2 * np.pi * np.arange(100) * 0.004))


def test_a_direction_that_the_reference_does_not_know(cart):
    push = Push(body="cart", force=4.0, direction="along", duration=0.05, start=0.1)
    with pytest.raises(InputError) as caught:
        run(cart, disturbances=[push])
    assert str(caught.value) == (
        "disturbances[0].push.direction: unknown direction 'along'; allowed: forward, backward, left, right, "
        "up, down, "
        "or an angle such as '15 deg'"
    )


# --- plug-ins -----------------------------------------------------------------------------------------------

PLUGIN = '''
"""Kinds of a stranger."""

from typing import ClassVar

from pydantic import Field

from circuitkit.base.source.fields import Newtons
from circuitkit.base.units import parse_unit
from circuitkit.control import ControllerSpec
from circuitkit.simulation.disturbance import Disturbance
from circuitkit.simulation.effects import Hook
from circuitkit.simulation.measures import BoundMeasure, MeasureKind
from circuitkit.simulation.reference import Motion, Reference


class Kick(Disturbance):
    """A kick in the commands."""

    kind: ClassVar[str] = "kick"
    by: Newtons = Field(gt=0)

    def act(self, effects, robots, where):
        def add(_, commands):
            commands += self.by
        effects.on_commands.append(Hook(10, 20, add))


class Tilted(Reference):
    """Begins with a tilt."""

    kind: ClassVar[str] = "tilted"
    settings = float

    def __init__(self, angle):
        self.angle = angle

    @classmethod
    def read(cls, value, beside):
        return cls(value)

    def motion(self, robot, ticks, step_s):
        qpos = robot.start_qpos.copy()
        qpos[1] = self.angle
        return Motion(robot.held[None], qpos)


class _Bound(BoundMeasure):
    channels = ("place",)
    units = {"middle": parse_unit("m")}

    def measure(self, track):
        return {"middle": float(track.values("place")[track.ticks // 2])}


class Middle(MeasureKind):
    """Where the cart was half way."""

    kind: ClassVar[str] = "middle"

    def bind(self, plan):
        return _Bound()


class Pusher(ControllerSpec):
    """Pushes always as much."""

    kind: ClassVar[str] = "pusher"
    force: Newtons

    def bind(self, interface):
        from small_robots import Told
        return Told(force=self.force)
'''


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    """A distribution with kinds of its own, and one that cannot be imported."""
    import importlib.metadata

    from circuitkit.control.spec import KINDS
    from circuitkit.simulation.disturbance import DISTURBANCES, item_class
    from circuitkit.simulation.measures import MEASURES
    from circuitkit.simulation.reference import REFERENCES
    from circuitkit.simulation.scenario import measures_class, reference_class, scenario_class

    (tmp_path / "strangers_kinds.py").write_text(textwrap.dedent(PLUGIN), encoding="utf-8")
    (tmp_path / "strangers_broken.py").write_text("raise RuntimeError('not today')", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    real = importlib.metadata.entry_points

    def entry_points(group):
        own = [
            importlib.metadata.EntryPoint(name, module, group)
            for name, module in (("stranger", "strangers_kinds"), ("unlucky", "strangers_broken"))
        ]
        return [*real(group=group), *own]

    monkeypatch.setattr("circuitkit.base.registry.entry_points", entry_points)
    registries = (DISTURBANCES, REFERENCES, MEASURES, KINDS)

    def forget():
        for registry in registries:
            registry.__dict__.pop("kinds", None)
        for made in (item_class, reference_class, measures_class, scenario_class):
            made.cache_clear()

    forget()
    yield registries
    monkeypatch.undo()
    forget()


def test_kinds_of_others_are_words_of_a_scenario_like_our_own(plugged, files, caplog):
    (files / "pusher.yaml").write_text("controller: mine\nkind: pusher\nforce: 2 N\n", encoding="utf-8")
    path = files / "own.yaml"
    path.write_text(
        "scenario: own\nrobot: robot.yaml\nreference: {tilted: 0.25}\ncontroller: pusher.yaml\ncontrol_step: "
        "10 ms\n"
        "duration: 0.5 s\ndisturbances: [{kick: {by: 3 N}}]\nmeasures: {middle: {}, way: max(place)}\n",
        encoding="utf-8",
    )
    result = simulate(path)
    np.testing.assert_allclose(result.recording.channel("pull")[[5, 15, 25], 0], [2, 5, 2])
    assert result.recording.qpos[0, 0, 1] == pytest.approx(0.25, abs=0.01)
    assert result.measures["middle"] == result.recording.channel("place")[25, 0]
    named = [record.getMessage() for record in caplog.records]
    for registry in plugged:
        told = f"the plug-in 'unlucky' of circuitkit.{registry.word} is left out: RuntimeError: not today"
        assert named.count(told) == 1


def test_an_unknown_kind_lists_those_of_others_too(plugged, files):  # noqa: ARG001 - registers them
    said = complaint(files, "  - noise", "  - kik: {by: 1 N}\n  - noise")
    assert said.endswith(
        "allowed: actuator, body, current, delay, fault, jitter, kick, move, noise, push, slope; did you "
        "mean 'kick'?"
    )
    said = complaint(files, "{hold: {hinge: 20 deg}}", "{tiltd: 1}")
    assert "allowed: gait, hold, key, stand, tilted; did you mean 'tilted'?" in said


def test_what_is_wrong_in_a_strangers_settings_is_told_with_its_line(plugged, files):  # noqa: ARG001 - as above
    said = complaint(files, "  - noise", "  - kick: {by: -1 N}\n  - noise")
    assert said == "caught.yaml:10:16: disturbances[2].kick.by: found '-1 N'; allowed: more than 0 N"
