"""`simulate` and `compare`: a scenario in, recordings, pictures and verdicts out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from circuitkit.base.errors import InputError, MissingDependencyError, Problem, UnknownNameError
from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.circuit.silencing import silence
from circuitkit.control import (
    Body,
    CircuitController,
    Controller,
    ControllerSpec,
    OpenLoop,
    WalkReference,
    load_controller,
    planned_channels,
    shipped_controllers,
    walk_reference,
)
from circuitkit.biped.gait import LEG_JOINTS, SIDES, GaitSpec, Walk, load_gait
from circuitkit.robots import (
    Plant,
    RobotModel,
    build_model,
    command_units,
    load_robot,
    plan_robot_walk,
    robot_channels,
)
from circuitkit.simulation.disturbance import Trial, delay_ticks, draw_fates, fault_values
from circuitkit.simulation.loop import Setup, run_loop
from circuitkit.simulation.recording import Recording
from circuitkit.simulation.scenario import Push, Scenario, load_scenario, parse_push
from circuitkit.biped.thresholds import Verdict, judge, threshold_lines


@dataclass(frozen=True)
class Plan:
    """What all runs of a scenario share: the robot, its walk and the circuit.

    Attributes:
        scenario: The scenario.
        robot: The robot as it is known: what the walk is planned for and a controller may build on.
        walk: The walk.
        targets: What its servos are sent; shape (T, n).
        circuit: The circuit.
        yardstick: The circuit whose thresholds count if this one has none: that of the scenario.
        backend: What runs the circuit; see `compile_circuit`.
        plant: The robot as it is simulated, if it differs.
    """

    scenario: Scenario
    robot: RobotModel
    walk: Walk
    targets: Any
    circuit: CircuitGraph
    yardstick: CircuitGraph | None = None
    backend: str = "auto"
    plant: RobotModel | None = None

    def controller(self, name: str | ControllerSpec) -> Controller:
        """A controller.

        Args:
            name: `open_loop`, `circuit`, the name or path of a controller file, or what was read from one.

        Raises:
            UnknownNameError: There is none of this name.
            InputError: The circuit does not fit the robot, or the controller file is wrong.
            MissingDependencyError: The controller needs a package that is an extra.
        """
        if not isinstance(name, str):
            return name.build(self.reference())
        if name in CONTROLLERS:
            return CONTROLLERS[name](self)
        file = self.scenario.file(name)
        if _is_bare(file) and file not in shipped_controllers():
            kind = "controller"
            raise UnknownNameError(kind, name, (*CONTROLLERS, *shipped_controllers()))
        return load_controller(file).build(self.reference())

    def reference(self) -> WalkReference:
        """What a controller may know of the walk and of the robot beforehand."""
        legs = self.robot.spec.legs.geometry()
        soles = [getattr(self.robot.spec.feet, side).sole for side in SIDES]
        extent = [[[sole.back, sole.front], [sole.right, sole.left]] for sole in soles]
        ankle = [LEG_JOINTS.index(f"left_ankle_{name}") for name in ("pitch", "roll")]
        servo = self.robot.leg_index[ankle]
        stiffness = self.robot.stiffness[servo]
        damping = -self.robot.model.actuator_biasprm[servo, 2]
        channels = {name: channel.unit for name, channel in robot_channels(self.robot).items()}
        body = Body(
            self.robot.mass_kg, legs, np.array(extent), stiffness, damping / stiffness,
            channels, command_units(self.robot),
        )  # fmt: skip
        return walk_reference(self.walk, body)

    def setup(self, controller: str | ControllerSpec, trials: Sequence[Trial]) -> Setup:
        """A run of several robots under one controller.

        Raises:
            InputError: A push or a fault names what is not there.
        """
        scenario = self.scenario
        adds = self.controller(controller)
        with scenario.located("pushes"):
            fates = draw_fates(trials, self.walk, self.robot, scenario.jitter, scenario.sensor_noise)
            factors = fault_values(scenario.faults, self.walk, self.robot)
        with scenario.located("sensor_delay"):
            delay = delay_ticks(scenario.sensor_delay, self.walk)
        return Setup(
            robot=self.plant or self.robot,
            walk=self.walk,
            targets=self.targets,
            controller=adds,
            circuit=self.circuit,
            trials=tuple(trials),
            fates=fates,
            cell_factors=factors,
            yardstick=self.yardstick,
            delay=delay,
        )


def _is_bare(name: str) -> bool:
    """Whether a name has no folder and no suffix, and is no file of the working folder."""
    path = Path(name)
    return not path.suffix and len(path.parts) == 1 and not path.is_file()


def _circuit_controller(plan: Plan) -> Controller:
    observations = {name: channel.unit for name, channel in robot_channels(plan.robot).items()}
    step_s = plan.walk.gait.control_step
    commands, planned = command_units(plan.robot), planned_channels(plan.reference())
    return CircuitController(plan.circuit, observations, commands, step_s, plan.backend, planned)


CONTROLLERS: dict[str, Callable[[Plan], Controller]] = {
    "open_loop": lambda _: OpenLoop(),
    "circuit": _circuit_controller,
}


@dataclass(frozen=True)
class Result:
    """One run.

    Attributes:
        scenario: The scenario.
        push: Its first push, if any.
        recording: Every tick.
        verdict: What became of the robot.
        path: Where the recording was written; None if nowhere.
        notes: What was asked for and could not be had, such as a film where nothing can draw one.
        backend: Which backend ran the circuit, and why that one; empty without a circuit.
    """

    scenario: Scenario
    push: Push | None
    recording: Recording
    verdict: Verdict
    path: Path | None
    notes: tuple[str, ...] = ()
    backend: str = ""

    def row(self) -> dict[str, Any]:
        """The result for a table or for JSON."""
        push = self.push
        return {
            "scenario": self.scenario.scenario,
            "controller": self.recording.controller,
            "seed": self.recording.trials[0].seed,
            "push": push
            and {"force_n": push.force, "duration_s": push.duration, "direction": push.direction},
            "survived": self.verdict.survived,
            "time_of_fall_s": self.verdict.time_of_fall_s,
            "max_zmp_excursion_m": self.verdict.max_zmp_excursion_m,
            "recovery_time_s": self.verdict.recovery_time_s,
            "interrupted": self.recording.interrupted,
            "notes": list(self.notes),
            "recording": None if self.path is None else str(self.path),
        }


def make_plan(
    scenario: Scenario,
    circuit: str | Path | None = None,
    settings: Mapping[str, str] | None = None,
    backend: str = "auto",
) -> Plan:
    """Load what a scenario names and plan its walk.

    Args:
        scenario: The scenario.
        circuit: A circuit to use instead of the scenario's.
        settings: Values of the circuit that take the place of its file's; see `load_circuit`.
        backend: What runs the circuit; see `compile_circuit`.

    Raises:
        InputError: A file is wrong or missing.
    """
    with scenario.located("gait"):
        gait = load_gait(scenario.file(scenario.gait))
    graph, yardstick = load_graphs(scenario, circuit, settings)
    body = prepare_walk(scenario, gait)
    return Plan(scenario, body.robot, body.walk, body.targets, graph, yardstick, backend, body.plant)


@dataclass(frozen=True)
class PreparedWalk:
    """The part of a plan that does not depend on who controls; see `Plan`."""

    robot: RobotModel
    plant: RobotModel | None
    walk: Walk
    targets: Any


def prepare_walk(scenario: Scenario, gait: GaitSpec) -> PreparedWalk:
    """Build the robot of a scenario and plan its walk; depends on robot, servos, plant and duration.

    Raises:
        InputError: A file is wrong or missing.
        SimulationError: A leg cannot reach its foot.
    """
    with scenario.located("robot"):
        spec = load_robot(scenario.file(scenario.robot))
    with scenario.located("servo_profile"):
        spec = spec.with_servos(scenario.servo_profile)
        robot = build_model(spec)
    with scenario.located("plant.payload.body"):
        plant = None if scenario.plant == Plant() else build_model(spec, scenario.plant)
    ticks = round(scenario.duration / gait.control_step)
    with scenario.located("duration"):
        if ticks == 0:
            step = f"a control step of {gait.control_step:g} s, or more"
            message = f"found {scenario.duration:g} s; allowed: {step}"
            raise InputError(Problem("", 0, 0, "duration", message))
    with scenario.located("gait"):
        walk, targets = plan_robot_walk(robot, gait, ticks)
    return PreparedWalk(robot, plant, walk, targets)


def load_graphs(
    scenario: Scenario, circuit: str | Path | None = None, settings: Mapping[str, str] | None = None
) -> tuple[CircuitGraph, CircuitGraph | None]:
    """The circuit of a scenario, or another one in its place, and the yardstick; see `Plan`.

    Raises:
        InputError: A file is wrong or missing.
    """
    with scenario.located("circuit"):
        name = scenario.file(scenario.circuit) if circuit is None else circuit
        graph = load_circuit(name, settings, option="--set")
        yardstick = None if circuit is None or _has_thresholds(graph, scenario) else _own_circuit(scenario)
        threshold_lines(yardstick or graph, scenario.thresholds)
    with scenario.located("silenced"):
        return _lesioned(graph, yardstick, scenario)


def _lesioned(
    graph: CircuitGraph, yardstick: CircuitGraph | None, scenario: Scenario
) -> tuple[CircuitGraph, CircuitGraph | None]:
    """The circuit without what is silenced, and what its thresholds then are judged by: the whole one."""
    return (
        (silence(graph, scenario.silenced), yardstick or graph) if scenario.silenced else (graph, yardstick)
    )


def _own_circuit(scenario: Scenario) -> CircuitGraph:
    return load_circuit(scenario.file(scenario.circuit))


def _has_thresholds(graph: CircuitGraph, scenario: Scenario) -> bool:
    """Whether a circuit has the neurons at the edges that the scenario names; one's own idea need not."""
    try:
        threshold_lines(graph, scenario.thresholds)
    except InputError:
        return False
    return True


def simulate(
    scenario: Scenario | str | Path,
    *,
    controller: str | None = None,
    circuit: str | Path | None = None,
    settings: Mapping[str, str] | None = None,
    backend: str = "auto",
    push: str | None = None,
    seed: int | None = None,
    output: str | Path | None = None,
    video: bool = False,
    view: bool = False,
    progress: bool = False,
) -> Result:
    """Run a robot in closed loop with a controller.

    Args:
        scenario: A scenario, its path, or the name of a shipped one.
        controller: `open_loop`, `circuit`, or a controller file; the scenario's own by default.
        circuit: A circuit to use instead of the scenario's.
        settings: Values of the circuit that take the place of its file's, such as `{"w": "2 deg"}`.
        backend: What runs the circuit; see `compile_circuit`.
        push: `20N,200ms,inward` instead of the scenario's pushes; starts where the first of them does.
        seed: Of the noise and of the push's jitter; the scenario's by default.
        output: Folder for the recording and the pictures.
        video: Also film the robot.
        view: Watch in a window.
        progress: Show a bar on a terminal.

    Raises:
        InputError: A file is wrong, or names what is not there.
        OutputError: A file cannot be written.
    """
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    name = controller or ("circuit" if circuit is not None else loaded.controller)
    plan = make_plan(loaded, circuit, settings, backend)
    if controller is None:
        with loaded.located("controller"):
            plan.controller(name)
    result = _run(plan, name, push, seed, output, progress=progress)
    if video and output is not None:
        result = _with_film([result], Path(output) / "video.mp4", progress=progress)
    return _shown(result) if view else result


def compare(
    scenario: Scenario | str | Path,
    controllers: Sequence[str],
    *,
    circuit: str | Path | None = None,
    settings: Mapping[str, str] | None = None,
    backend: str = "auto",
    push: str | None = None,
    seed: int | None = None,
    output: str | Path | None = None,
    video: bool = False,
    progress: bool = False,
) -> list[Result]:
    """Run the same scenario under several controllers: same robot, walk, push, noise and seed.

    Args:
        scenario: A scenario, its path, or the name of a shipped one.
        controllers: Names, such as `open_loop` and `circuit`, or controller files.
        circuit: A circuit to use instead of the scenario's.
        settings: Values of the circuit that take the place of its file's, such as `{"w": "2 deg"}`.
        backend: What runs the circuit; see `compile_circuit`.
        push: `20N,200ms,inward` instead of the scenario's pushes.
        seed: Of the noise and of the push's jitter.
        output: Folder; each controller gets one in it.
        video: Also film the robots, side by side.
        progress: Show a bar on a terminal.

    Raises:
        InputError: A file is wrong, or names what is not there.
        OutputError: A file cannot be written.
    """
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    plan = make_plan(loaded, circuit, settings, backend)
    for name in controllers:
        plan.controller(name)
    results = []
    for name in controllers:
        folder = None if output is None else Path(output) / Path(name).stem
        results.append(_run(plan, name, push, seed, folder, progress=progress))
        if results[-1].recording.interrupted:
            break
    if output is not None:
        from circuitkit.simulation.pictures import draw_comparison

        draw_comparison(results, Path(output))
    if video and output is not None:
        path = Path(output) / "video.mp4"
        results[-1] = _with_film(results, path, progress=progress)
    return results


def _run(
    plan: Plan,
    controller: str,
    push: str | None,
    seed: int | None,
    output: str | Path | None,
    *,
    progress: bool,
) -> Result:
    scenario = plan.scenario
    pushes = scenario.pushes if push is None else (parse_push(push, scenario),)
    trial = Trial(scenario.seed if seed is None else seed, pushes)
    setup = plan.setup(controller, [trial])
    from circuitkit.simulation.watch import progress_bar

    with progress_bar(plan.walk.ticks, controller, shown=progress) as advance:
        recording = run_loop(setup, advance)
    if recording.ticks == 0:
        raise KeyboardInterrupt
    path = None if output is None else recording.save(Path(output))
    verdict = judge(recording, scenario.thresholds)
    backend = getattr(setup.controller, "backend", "")
    result = Result(scenario, pushes[0] if pushes else None, recording, verdict, path, backend=backend)
    if output is not None:
        from circuitkit.simulation.pictures import draw_result

        draw_result(result, Path(output))
    return result


def _with_film(results: Sequence[Result], path: Path, *, progress: bool) -> Result:
    """Film the runs side by side; the last result, with a note if nothing here can make a film."""
    from circuitkit.simulation.screen import RendererError
    from circuitkit.simulation.video import film, film_side_by_side

    try:
        if len(results) == 1:
            film(results[0], path, progress=progress)
        else:
            film_side_by_side(results, path, progress=progress)
    except (RendererError, MissingDependencyError) as error:
        return replace(results[-1], notes=(*results[-1].notes, f"no film: {error}"))
    return results[-1]


def _shown(result: Result) -> Result:
    """Show the run in a window; with a note if there is none."""
    from circuitkit.simulation.watch import DisplayError, watch

    try:
        watch(result)
    except DisplayError as error:
        return replace(result, notes=(*result.notes, f"no window: {error}"))
    return result
