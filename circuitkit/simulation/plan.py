"""The plan: what all runs of a scenario share, made once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from circuitkit.base.errors import ExpressionError, InputError, Problem, UnknownNameError, warn_once
from circuitkit.base.reading import is_file
from circuitkit.base.units import Unit
from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.circuit.silencing import silence
from circuitkit.control import (
    CircuitController,
    Controller,
    Interface,
    OpenLoop,
    load_controller,
    require_controller,
    require_instance,
    shipped_controllers,
)
from circuitkit.robots import Robot, RobotModel, build_model, load_robot
from circuitkit.robots.worlds import substeps_of
from circuitkit.simulation.disturbance import Disturbance, RunSpec, draw_effects
from circuitkit.simulation.fallback import Fallback
from circuitkit.simulation.formula_parser import parse_measure
from circuitkit.simulation.formulas import Formula
from circuitkit.simulation.loop import Setup
from circuitkit.simulation.measures import COLUMNS, RMS, SURVIVED, Judge, located
from circuitkit.simulation.reference import Motion, Reference, beyond_ranges, require_motion
from circuitkit.simulation.scenario import Scenario

CIRCUIT, OPEN_LOOP = "circuit", "open_loop"
BUILT_IN = (OPEN_LOOP, CIRCUIT)


@dataclass(frozen=True)
class Circuits:
    """The circuit of a run, and what it came from.

    Attributes:
        used: The circuit that runs; None without one.
        whole: The same before anything was silenced.
        own: The circuit that the scenario's file names, if another one is used.
    """

    used: CircuitGraph | None = None
    whole: CircuitGraph | None = None
    own: CircuitGraph | None = None

    @property
    def candidates(self) -> tuple[CircuitGraph, ...]:
        """Where measures look for neurons, the first choice first."""
        return tuple(graph for graph in (self.whole, self.own) if graph is not None)


@dataclass(frozen=True, eq=False)
class Body:
    """The part of a plan that does not depend on who controls.

    Attributes:
        robot: The robot as it is known: what the reference is made for, and a controller may build on.
        plant: The robot as it is simulated.
        motion: What the reference wants.
        step_s: The control step.
        ticks: T.
    """

    robot: RobotModel
    plant: RobotModel
    motion: Motion
    step_s: float
    ticks: int


@dataclass(frozen=True, eq=False)
class Plan:
    """What all runs of a scenario share.

    Attributes:
        scenario: The scenario.
        reference: Its reference.
        body: Robot and motion.
        circuits: Its circuit.
        backend: What runs the circuit; see `compile_circuit`.
    """

    scenario: Scenario
    reference: Reference
    body: Body
    circuits: Circuits
    backend: str = "auto"

    @property
    def robot(self) -> RobotModel:
        """The robot as it is known."""
        return self.body.robot

    @property
    def ticks(self) -> int:
        """T."""
        return self.body.ticks

    @cached_property
    def interface(self) -> Interface:
        """What a controller may know beforehand."""
        body = self.body
        return Interface(
            body.robot.channel_units, body.robot.command_units, body.step_s, body.motion.planned,
            body.motion.knowledge,
        )  # fmt: skip

    def controller(self, given: Any = None) -> Controller:  # noqa: ANN401 - a name or an object
        """A controller, bound to the run.

        Args:
            given: `open_loop`, `circuit`, the name or path of a controller file, an object with `bind`, or a
                `Controller`; the scenario's own if None.

        Raises:
            UnknownNameError: There is none of this name.
            InputError: It does not fit the robot, or its file is wrong.
            MissingDependencyError: It needs a package that is an extra.
        """
        chosen = self.scenario.controller if given is None else given
        if chosen is None:
            chosen = CIRCUIT if self.circuits.used is not None else OPEN_LOOP
        if isinstance(chosen, str | Path):
            with self.scenario.located("controller") if given is None else nullcontext():
                chosen = self._named(str(chosen))
        require_instance(chosen)
        bind = getattr(chosen, "bind", None)
        with self.scenario.located(""):
            made = chosen if bind is None else bind(self.interface)
        return require_controller(made)

    def _named(self, name: str) -> Any:  # noqa: ANN401 - an object with `bind`
        if name == OPEN_LOOP:
            return OpenLoop()
        if name == CIRCUIT:
            if self.circuits.used is None:
                named = self.scenario.scenario
                message = f"the scenario '{named}' names no circuit; allowed: circuit: NAME in its file"
                raise InputError(Problem("", 0, 0, "controller", message))
            connect = self.scenario.connect.model_dump()
            return CircuitController(self.circuits.used, connect=connect, backend=self.backend)
        file = self.scenario.file(name)
        path = Path(file)
        bare = not path.suffix and len(path.parts) == 1 and not is_file(path)
        if bare and file not in shipped_controllers():
            kind = "controller"
            raise UnknownNameError(kind, name, (*BUILT_IN, *shipped_controllers()))
        return load_controller(file)

    @cached_property
    def judge(self) -> Judge:
        """The scenario's measures, bound to the robot.

        Raises:
            InputError: A measure has the name of another column of results, names what is not there, or joins
                units that do not fit.
        """
        for name in self.scenario.formulas:
            if name in COLUMNS or name.startswith(RMS):
                message = f"found a measure '{name}', which is a column of the results; allowed: another name"
                raise InputError(self.scenario.problem_in("measures", name, message, 0))
        with self.scenario.located("measures"):
            kinds = tuple(kind.bind(self) for kind in self.scenario.measure_kinds)
        channels = self.body.plant.channels
        ranges = {name: channel.range for name, channel in channels.items() if channel.range is not None}
        units = measurable(self.body.plant, self.body.motion)
        bounded = {*ranges, *(name for name in units if any(k.bounds_known(name) for k in kinds))}
        formulas = {
            name: _formula(self.scenario, ("measures", name), text, units, bounded)
            for name, text in self.scenario.formulas.items()
        }
        self._require_that_it_comes(formulas[SURVIVED])
        if not formulas["survived"].is_condition:
            text = self.scenario.formulas["survived"]
            message = f"found '{text}', a number; allowed: a condition, such as max(speed) < 2 m/s"
            raise InputError(self.scenario.problem_in("measures", "survived", message, 0))
        until, valid = (self._condition(key, units, bounded) for key in ("until", "valid"))
        return Judge(formulas, kinds, until, valid, ranges)

    def _condition(self, key: str, units: Mapping[str, Unit], bounded: set[str]) -> Formula | None:
        """The condition that the scenario has below a key, if it has one."""
        text = getattr(self.scenario, key)
        if text is None:
            return None
        found = _formula(self.scenario, (key, ""), text, units, bounded)
        if not found.is_condition:
            message = f"found '{text}'; allowed: a condition, such as height < 0.2 m"
            raise InputError(self.scenario.problem_in(key, "", message, 0))
        return found

    def _require_that_it_comes(self, survived: Formula) -> None:
        """Refuse to judge by a window in which the run has no tick: nobody would ever be said to survive."""
        body = self.body
        if (window := survived.window_that_never_comes(body.ticks, body.step_s)) is not None:
            message = (
                f"found '{window}', and the run of {body.ticks * body.step_s:g} s never comes to that; "
                "allowed: a window within the duration"
            )
            problem = self.scenario.problem_in("measures", SURVIVED, message, window.offset)
            raise InputError(problem)

    def setup(self, controller: Controller, specs: Sequence[RunSpec]) -> Setup:
        """A run of several robots under one controller.

        Args:
            controller: Bound to the run; see `controller`.
            specs: One for each robot.

        Raises:
            InputError: A disturbance names what is not there, or the robots differ in one that befalls all.
        """
        body = self.body
        with self.scenario.located("disturbances"):
            effects = draw_effects(
                specs, body.robot, self.reference, body.ticks, body.step_s,
                controller.observations, controller.commands,
            )  # fmt: skip
        plant = body.plant
        if _changing(specs[0].disturbances) != _changing(self.scenario.befalling):
            plant = _plant(self.scenario, body.robot, body.motion, specs[0].disturbances)
        return Setup(
            robot=plant, motion=body.motion, controller=controller, circuit=self.circuits.used,
            specs=tuple(specs), effects=effects, judge=self.judge, step_s=body.step_s, ticks=body.ticks,
            fallback=Fallback(self.scenario.fallback, self.scenario.fallback_after),
        )  # fmt: skip

    def own_spec(self, seed: int | None = None) -> RunSpec:
        """The run that the scenario's file describes."""
        return RunSpec(self.scenario.seed if seed is None else seed, self.scenario.befalling)


def _formula(
    scenario: Scenario, place: tuple[str, str], text: str, units: Mapping[str, Unit], bounded: set[str]
) -> Formula:
    try:
        return parse_measure(text, units, bounded)
    except ExpressionError as error:
        raise located(error, lambda message, offset: scenario.problem_in(*place, message, offset)) from error


def measurable(robot: RobotModel, motion: Motion) -> dict[str, Unit]:
    """Everything that measures may name, with its unit."""
    planned = {name: channel.unit for name, channel in motion.planned.items()}
    return {**planned, **robot.command_units, **robot.channel_units}


def make_plan(
    scenario: Scenario,
    circuit: CircuitGraph | str | Path | None = None,
    settings: Mapping[str, str] | None = None,
    backend: str = "auto",
) -> Plan:
    """Load what a scenario names and plan its motion.

    Args:
        scenario: The scenario.
        circuit: A circuit to use instead of the scenario's.
        settings: Values of the circuit that take the place of its file's; see `load_circuit`.
        backend: What runs the circuit; see `compile_circuit`.

    Raises:
        InputError: A file is wrong or missing.
    """
    reference = scenario.made_reference()
    circuits = load_circuits(scenario, circuit, settings)
    return Plan(scenario, reference, make_body(scenario, reference, circuits.used), circuits, backend)


def load_circuits(
    scenario: Scenario,
    circuit: CircuitGraph | str | Path | None = None,
    settings: Mapping[str, str] | None = None,
) -> Circuits:
    """The circuit of a scenario, or another one in its place.

    Raises:
        InputError: A file is wrong or missing, or what is silenced is not there.
    """
    chosen = scenario.circuit if circuit is None else circuit
    if chosen is None:
        return Circuits()
    own_settings = {name: str(value) for name, value in scenario.settings.items()} if circuit is None else {}
    here = circuit is None and not settings
    with scenario.located("settings" if own_settings else "circuit") if here else nullcontext():
        whole = _graph(scenario, chosen, {**own_settings, **(settings or {})}, here=circuit is None)
        other = circuit is not None and scenario.circuit is not None
        own = _graph(scenario, scenario.circuit, None, here=True) if other else None
    with scenario.located("silenced"):
        return Circuits(silence(whole, scenario.silenced) if scenario.silenced else whole, whole, own)


def _graph(
    scenario: Scenario, given: CircuitGraph | str | Path, settings: Mapping[str, str] | None, *, here: bool
) -> CircuitGraph:
    if isinstance(given, CircuitGraph):
        return given
    file = scenario.file(str(given)) if here else given
    return load_circuit(file, settings, option="settings" if settings else "")


def make_body(scenario: Scenario, reference: Reference, circuit: CircuitGraph | None) -> Body:
    """Build the robot of a scenario and plan its motion.

    It depends on robot, servos, duration and changed bodies.

    Raises:
        InputError: A file is wrong or missing.
        SimulationError: The robot cannot do what the reference wants.
    """
    with scenario.located("robot"):
        robot = build_model(robot_of(scenario))
    step_s = control_step(scenario, reference, circuit)
    ticks = round(scenario.duration / step_s)
    with scenario.located("duration"):
        if ticks == 0:
            message = f"found {scenario.duration:g} s; allowed: a control step of {step_s:g} s, or more"
            raise InputError(Problem("", 0, 0, "duration", message))
    with scenario.located("reference"):
        reference.require(robot)
    with scenario.located("control_step"):
        substeps_of(robot, step_s)
    with scenario.located("reference"):
        motion = reference.motion(robot, ticks, step_s)
        require_motion(motion, reference, robot, ticks)
    if beyond := beyond_ranges(motion, robot):
        warn_once(f"the reference '{reference.name}' asks {beyond}; it is cut to the range")
    return Body(robot, _plant(scenario, robot, motion, scenario.befalling), motion, step_s, ticks)


def robot_of(scenario: Scenario) -> Robot:
    """The robot file of a scenario, with the servos that it asks for.

    Raises:
        InputError: It is wrong or missing.
    """
    with scenario.located("robot"):
        given = scenario.robot
        found = given if isinstance(given, Robot) else load_robot(scenario.file(str(given)))
    with scenario.located("servo_profile"):
        return found.with_servos(scenario.servo_profile)


def _changing(disturbances: Sequence[Disturbance]) -> list[Disturbance]:
    """Those that change the model."""
    return [each for each in disturbances if each.changes_model]


def _plant(
    scenario: Scenario, robot: RobotModel, motion: Motion, disturbances: Sequence[Disturbance]
) -> RobotModel:
    """The robot as it is simulated: with changed bodies, and the sensors that measures ask for themselves."""
    units = measurable(robot, motion)
    calls: dict[str, Any] = {}
    for key, name, text in [
        ("until", "", scenario.until or ""),
        ("valid", "", scenario.valid or ""),
        *(("measures", *m) for m in scenario.formulas.items()),
    ]:
        if text:
            every = set(robot.channels) | set(units)
            formula = _formula(scenario, (key, name), text, units, every)
            complain = partial(scenario.problem_in, key, name)
            calls = {str(call): (call, complain) for call in formula.references} | calls
    if not _changing(disturbances) and not calls:
        return robot
    made = build_model(robot.robot, (), calls)
    for k, each in enumerate(disturbances):
        place = f"disturbances[{k}].{each.kind}"
        if each.changes_model:
            with scenario.located(place):
                _change(each, made, place)
    return made


def _change(disturbance: Disturbance, robot: RobotModel, place: str) -> None:
    """Change the model; complaints are about a place within that of the disturbance."""
    try:
        disturbance.change(robot)
    except InputError as error:
        within = (replace(p, where=f"{place}.{p.where}".rstrip(".")) for p in error.problems)
        raise InputError(*within) from error


def control_step(scenario: Scenario, reference: Reference, circuit: CircuitGraph | None) -> float:
    """The control step of a scenario: its own, else that of its reference, else that of its circuit; [s].

    Raises:
        InputError: None of them has one.
    """
    if scenario.control_step is not None:
        return scenario.control_step
    if reference.step_s is not None:
        return reference.step_s
    if circuit is not None:
        return circuit.step_s
    message = "missing key 'control_step'; required where neither a reference nor a circuit has one"
    with scenario.located("control_step"):
        raise InputError(Problem("", 0, 0, "control_step", message))
