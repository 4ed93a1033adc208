"""What is done with spoilt files of each kind: all are read, checked and resolved; some are run as well."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import read_yaml
from circuitkit.biped.gait import load_gait
from circuitkit.circuit import check, load_circuit
from circuitkit.circuit.authoring.explanation import explain
from circuitkit.circuit.authoring.flat import flat_yaml
from circuitkit.circuit.authoring.formatting import format_file
from circuitkit.circuit.models import read_neuron_model, read_synapse_model
from circuitkit.control.spec import load_controller
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.input_table import read_inputs
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation import load_scenario, make_plan, simulate
from circuitkit.study import CaseBuilder, read_results, read_study
from circuitkit.study.tuning.spec import load_tuning

_TICKS = 2
_MOST_SUBSTEPS = 1000
_DRIVEN = load_circuit("binn_lateral")


@dataclass(frozen=True)
class Target:
    """Something that reads a file.

    Attributes:
        kind: The kind of seeds that it takes.
        read: Takes the path of the entry; returns complaints, which may also be raised.
        entry: Name of the file that is read; the spoilt one if empty, the folder if it is a dot.
        share: How often, compared with others.
        may_fail: Whether it also runs what it reads, and a run may fail without a line of a file at fault.
    """

    kind: str
    read: Callable[[Path], Iterable[Problem] | None]
    entry: str = ""
    share: float = 1.0
    may_fail: bool = False


def _circuit(path: Path) -> Iterable[Problem]:
    errors, doubts = check(path)
    return (*errors, *doubts)


def _model(path: Path) -> None:
    document = read_yaml(path)
    kind = document.data if isinstance(document.data, dict) else {}
    (read_synapse_model if "drive" in kind or "weight" in kind else read_neuron_model)(document)


def _author(path: Path) -> None:
    format_file(path)
    graph = load_circuit(path)
    flat_yaml(graph)
    for name in [each.name for each in graph.neurons[:1]]:
        explain(graph, name)


def _run(path: Path) -> None:
    graph = load_circuit(path)
    if graph.substeps > _MOST_SUBSTEPS:  # who asks for so many waits for them
        return
    program = compile_circuit(graph, backend="numpy")
    run(program, np.zeros((3, 1, len(program.input_names))))


def _plan(path: Path) -> None:
    make_plan(load_scenario(path), backend="numpy")


def _simulate(path: Path) -> None:
    scenario = load_scenario(path)
    duration = min(scenario.duration, _TICKS * (scenario.control_step or 0.01))
    befalling = [
        each
        for each in scenario.disturbances
        if isinstance(each.disturbance.begins, float) and each.disturbance.begins < duration
    ]
    simulate(
        scenario.model_copy(update={"duration": duration, "disturbances": tuple(befalling)}), backend="numpy"
    )


def _study(path: Path) -> None:
    study = read_study(path)
    builder = CaseBuilder(study)
    for cell in study.cells[:1]:
        builder.of_cell(cell)


TARGETS: Mapping[str, Target] = {
    "circuit": Target("circuit", _circuit, share=6.0),
    "include": Target("include", _circuit, "main.yaml", share=2.0),
    "model": Target("model", _model, share=2.0),
    "matrix": Target("matrix", _circuit, "main.yaml", share=2.0),
    "scenario": Target("scenario", lambda path: load_scenario(path) and None, share=6.0),
    "robot": Target("robot", lambda path: load_robot(path) and None, share=4.0),
    "gait": Target("gait", lambda path: load_gait(path) and None, share=2.0),
    "controller": Target("controller", lambda path: load_controller(path) and None, share=2.0),
    "study": Target("study", lambda path: read_study(path) and None, share=4.0),
    "tuning": Target("tuning", lambda path: load_tuning(path) and None, share=2.0),
    "inputs": Target("inputs", lambda path: read_inputs(_DRIVEN, path) and None, share=2.0),
    "results": Target("results", lambda path: read_results(path) and None, ".", share=1.0),
    "mjcf": Target("mjcf", lambda path: build_model(load_robot(path)) and None, "robot.yaml", share=0.5),
    "robot_built": Target("robot", lambda path: build_model(load_robot(path)) and None, share=0.2),
    "circuit_written": Target("circuit", _author, share=0.3, may_fail=True),
    "circuit_run": Target("circuit", _run, share=0.2, may_fail=True),
    "study_first_case": Target("study", _study, share=0.2),
    "scenario_planned": Target("scenario", _plan, share=0.05),
    "scenario_simulated": Target("scenario", _simulate, share=0.04, may_fail=True),
}


def tried(target: Target, path: Path) -> list[Problem]:
    """Read a file; return what is wrong with it by its own account.

    Raises:
        Exception: Anything but an `InputError`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what Python warns of reaches a terminal as well
        try:
            return list(target.read(path) or ())
        except InputError as error:
            return list(error.problems)
