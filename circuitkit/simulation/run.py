"""`simulate` and `compare`: a scenario in, recordings, pictures and measures out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from circuitkit.base.errors import InputError, MissingDependencyError, Problem
from circuitkit.base.output_folder import one_run
from circuitkit.base.progress import progress_bar
from circuitkit.base.source import describe
from circuitkit.circuit import CircuitGraph
from circuitkit.control import Controller
from circuitkit.robots import Robot, load_robot
from circuitkit.robots.validity import invalidates
from circuitkit.simulation.disturbance import RunSpec
from circuitkit.simulation.loop import Setup, run_loop
from circuitkit.simulation.plan import CIRCUIT, OPEN_LOOP, Plan, make_plan
from circuitkit.simulation.recording import Recording
from circuitkit.simulation.renderer import RendererError
from circuitkit.simulation.result import Result
from circuitkit.simulation.scenario import Scenario, load_scenario, misfit, parse_push, with_push
from circuitkit.simulation.viewer import DisplayError, watch


def simulate(
    scenario: Scenario | str | Path,
    *,
    robot: Robot | str | Path | None = None,
    controller: Controller | str | Path | None = None,
    circuit: CircuitGraph | str | Path | None = None,
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
        robot: A robot to use instead of the scenario's.
        controller: `open_loop`, `circuit`, a controller file, or an object; the scenario's own by default.
        circuit: A circuit to use instead of the scenario's.
        settings: Values of the circuit that take the place of its file's, such as `{"w": "2 deg"}`.
        backend: What runs the circuit; see `compile_circuit`.
        push: `20N,200ms,inward` instead of the scenario's pushes; starts where the first of them does.
        seed: Of noise and jitter; the scenario's by default.
        output: Folder for the recording and the pictures.
        video: Also film the robot.
        view: Watch in a window.
        progress: Show a bar on a terminal.

    Raises:
        InputError: A file is wrong, or names what is not there.
        OutputError: A file cannot be written.
    """
    _require_arguments(scenario, robot, circuit, settings, push, seed)
    loaded = _loaded(scenario, robot)
    plan = make_plan(loaded, circuit, settings, backend)
    given = controller if controller is not None or circuit is None else CIRCUIT
    folder = None if output is None else Path(output)
    with one_run(folder):
        result = _run(plan, plan.controller(given), push, seed, folder, progress=progress)
        if video and folder is not None:
            result = _with_film([result], folder / "video.mp4", progress=progress)
    return _shown(result) if view and not result.interrupted else result


def compare(
    scenario: Scenario | str | Path,
    controllers: Sequence[Controller | str | Path],
    *,
    robot: Robot | str | Path | None = None,
    circuit: CircuitGraph | str | Path | None = None,
    settings: Mapping[str, str] | None = None,
    backend: str = "auto",
    push: str | None = None,
    seed: int | None = None,
    output: str | Path | None = None,
    video: bool = False,
    progress: bool = False,
) -> list[Result]:
    """Run the same scenario under several controllers: same robot, reference, disturbances and seed.

    Args:
        scenario: A scenario, its path, or the name of a shipped one.
        controllers: Names, such as `open_loop` and `circuit`, controller files, or objects.
        robot: A robot to use instead of the scenario's.
        circuit: A circuit to use instead of the scenario's.
        settings: Values of the circuit that take the place of its file's, such as `{"w": "2 deg"}`.
        backend: What runs the circuit; see `compile_circuit`.
        push: `20N,200ms,inward` instead of the scenario's pushes.
        seed: Of noise and jitter.
        output: Folder; each controller gets one in it.
        video: Also film the robots, side by side.
        progress: Show a bar on a terminal.

    Raises:
        InputError: A file is wrong, or names what is not there.
        OutputError: A file cannot be written.
    """
    _require_arguments(scenario, robot, circuit, settings, push, seed)
    if isinstance(controllers, str | Path) or not isinstance(controllers, Iterable):
        message = f"found {describe(controllers)}; allowed: a list, such as ['{OPEN_LOOP}', '{CIRCUIT}']"
        raise InputError(Problem("", 0, 0, "controllers", message))
    loaded = _loaded(scenario, robot)
    plan = make_plan(loaded, circuit, settings, backend)
    bound = [plan.controller(each) for each in controllers]
    names = _names(controllers, bound)
    called = [each.name for each in bound]
    folder = None if output is None else Path(output)
    results = []
    with one_run(folder):
        for each, name in zip(bound, names, strict=True):
            own = None if folder is None else folder / name
            shown = name if called.count(each.name) > 1 else each.name
            results.append(_run(plan, each, push, seed, own, shown, progress=progress))
            if results[-1].recording.interrupted:
                break
        if folder is not None:
            from circuitkit.simulation.plots import draw_comparison  # 0.1 s, for networkx

            with np.errstate(all="ignore"):  # as in `_run`
                draw_comparison(results, folder)
            if video:
                results[-1] = _with_film(results, folder / "video.mp4", progress=progress)
    return results


_PUSH = "a text, such as '20N,200ms,left'; a Push goes into the disturbances of a Scenario"
_ARGUMENTS: Mapping[str, tuple[tuple[type, ...], str]] = {
    "scenario": ((str, Path, Scenario), "the name of a scenario, a path, or a Scenario"),
    "settings": ((Mapping, type(None)), "values by name, such as {'w': '2 deg'}"),
    "push": ((str, type(None)), _PUSH),
    "seed": ((int, np.integer, type(None)), "a whole number"),
}


def _require_arguments(
    scenario: object, robot: object, circuit: object, settings: object, push: object, seed: object
) -> None:
    """Refuse objects in the place of others.

    Raises:
        InputError: With everything that is wrong.
    """
    given = {"scenario": scenario, "settings": settings, "push": push, "seed": seed}
    wrong = {
        key: f"found {describe(value)}; allowed: {_ARGUMENTS[key][1]}"
        for key, value in given.items()
        if not isinstance(value, _ARGUMENTS[key][0])
    }
    for key, value in (("robot", robot), ("circuit", circuit)):
        if value is not None and (complaint := misfit(key, value)):
            wrong[key] = complaint
    if wrong:
        raise InputError(*(Problem("", 0, 0, key, message) for key, message in wrong.items()))


def _loaded(scenario: Scenario | str | Path, robot: Robot | str | Path | None) -> Scenario:
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    if robot is None:
        return loaded
    given = robot if isinstance(robot, Robot) else load_robot(robot)
    return loaded.model_copy(update={"robot": given})


def _names(given: Sequence[Controller | str | Path], bound: Sequence[Controller]) -> list[str]:
    """A name for each controller, for its folder, that no other has, whatever the letters' case.

    It is a file's own name, as much of the folders before it as tells it from others of that name, or the
    name of the object; and a number behind, where that tells nothing, as of one controller that runs twice.
    """
    paths = [
        Path(each) if isinstance(each, str | Path) else Path(_word(one.name))
        for each, one in zip(given, bound, strict=True)
    ]
    stems = [_word(path.stem) for path in paths]
    found: list[str] = []
    for path, stem in zip(paths, stems, strict=True):
        same = [i for i, its in enumerate(stems) if its.casefold() == stem.casefold()]
        others = [paths[i] for i in same if paths[i] != path and not _is_bare(paths[i])]
        name = stem if _is_bare(path) or len(same) == 1 else _told_apart(path, others)
        number, unique = 1, name
        while unique.casefold() in (each.casefold() for each in found):
            number += 1
            unique = f"{name}_{number}"
        found.append(unique)
    return found


def _is_bare(path: Path) -> bool:
    """Whether it is a name, of what ships or is built in, and no path."""
    return len(path.parts) == 1 and not path.suffix


def _told_apart(path: Path, others: Sequence[Path]) -> str:
    """The last parts of a path that no other one ends in, joined to one word."""
    parts = path.with_suffix("").absolute().parts[1:]
    its = [other.with_suffix("").absolute().parts for other in others]
    count = next((n for n in range(2, len(parts)) if all(o[-n:] != parts[-n:] for o in its)), len(parts))
    return "_".join(map(_word, parts[-count:]))


def _word(text: str) -> str:
    """A text as the name of a folder: neither empty, nor one with a meaning of its own."""
    word = re.sub(r"[/\\\x00-\x1f]", "_", text).strip(". ")
    return word or "controller"


def _run(
    plan: Plan,
    controller: Controller,
    push: str | None,
    seed: int | None,
    output: Path | None,
    name: str = "",
    *,
    progress: bool,
) -> Result:
    """Run a controller, which is then called `name`, if that is given."""
    scenario = plan.scenario
    spec = plan.own_spec(seed)
    if push is not None:
        spec = RunSpec(spec.seed, with_push(scenario, parse_push(push, scenario)))
    setup = _setup(plan, controller, spec, given=push is not None)
    with progress_bar(name or controller.name, plan.ticks, shown=progress) as advance:
        recording = replace(run_loop(setup, advance), controller=name or controller.name)
    if recording.ticks == 0:
        raise KeyboardInterrupt
    backend = getattr(controller, "backend", "")
    result = Result(
        scenario, recording, recording.measures[0], None, _of_the_physics(recording), backend
    )  # fmt: skip
    if output is None:
        return result
    from circuitkit.simulation.plots import draw_result  # 0.1 s, for networkx

    with np.errstate(all="ignore"):  # an exploded state is told of otherwise
        path = recording.save(output)
        draw_result(result, output)
    return replace(result, path=path)


def _setup(plan: Plan, controller: Controller, spec: RunSpec, *, given: bool) -> Setup:
    """What runs; a direction that nobody knows is one of `--push` if that was given."""
    try:
        return plan.setup(controller, [spec])
    except InputError as error:
        if not given or not all(each.where.endswith(".push.direction") for each in error.problems):
            raise
        problems = (
            Problem("", 0, 0, "--push: direction", each.message, each.hint) for each in error.problems
        )
        raise InputError(*problems) from error


def _of_the_physics(recording: Recording) -> tuple[str, ...]:
    """Notes of why the run is invalid if it is, and of what else MuJoCo warned of."""
    mild = {kind: count for kind, count in recording.warnings[0].items() if not invalidates(kind)}
    notes = [f"MuJoCo warned {count} times of {kind}" for kind, count in mild.items()]
    if (why := recording.invalid[0]) is not None:
        advice = "a smaller timestep, less stiff servos or more damping may help"
        notes.insert(0, f"invalid {why}; what is recorded ends there; {advice}")
    return tuple(notes)


def _with_film(results: Sequence[Result], path: Path, *, progress: bool) -> Result:
    """Film the runs side by side; the last result, with a note if there is no film.

    Nothing here may be able to make one; or Ctrl-C came, and then the recording and the plots are there.
    """
    from circuitkit.simulation.film import film  # 0.2 s, for matplotlib

    try:
        film(results, path, progress=progress)
    except (RendererError, MissingDependencyError) as error:
        return replace(results[-1], notes=(*results[-1].notes, f"no film: {error}"))
    except KeyboardInterrupt:
        note = f"no film: interrupted before '{path}' was whole; the recording and the plots are there"
        return replace(results[-1], notes=(*results[-1].notes, note), interrupted=True)
    return results[-1]


def _shown(result: Result) -> Result:
    """Show the run in a window; with a note if there is none."""
    try:
        watch(result)
    except DisplayError as error:
        return replace(result, notes=(*result.notes, f"no window: {error}"))
    return result
