"""Draws the pictures of docs/circuits; docs/generate.py calls `write_circuit_pictures`."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from circuitkit import compile_circuit, load_circuit, run
from circuitkit.biped.gait.lipm import natural_frequency
from circuitkit.biped.sensing import BipedView
from circuitkit.draw.style import CYCLE, DASHES, GREY, SMALL, house_style, new_figure, save_figure, tidy
from circuitkit.simulation import simulate
from circuitkit.simulation.loop import run_loop
from circuitkit.simulation.plots import draw_paths
from circuitkit.study import CaseBuilder, load_study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from circuitkit import Program, Trace

Array = NDArray[np.float64]

IMAGES = Path(__file__).parent / "circuits" / "img"
TESTS = Path(__file__).parent.parent / "tests"  # where the theories stand that the pictures show
WIDTH_IN = 7.2
FEWEST_INTERVALS = 8  # for a coefficient of variation
MM = 1e3


def program_of(name: str, **changes: object) -> Program:
    """A shipped circuit, compiled."""
    return compile_circuit(load_circuit(name, {k: str(v) for k, v in changes.items()}))


def traced(program: Program, inputs: Mapping[str, Array]) -> tuple[Array, Trace]:
    """Time at the end of each step [s] and the trace of a run of one instance.

    Args:
        program: The circuit.
        inputs: A series for each input, [SI]; those that are not named are 0.
    """
    steps = len(next(iter(inputs.values())))
    table = np.zeros((steps, 1, len(program.input_names)))
    for name, series in inputs.items():
        table[:, 0, program.input_index[name]] = series
    return (np.arange(steps) + 1) * program.step_s, run(program, table)


def curve(axes: Axes, x: Array, y: Array, number: int, label: str) -> None:
    """A curve that stays apart from the others in grey, too."""
    axes.plot(x, y, color=CYCLE[number], linestyle=DASHES[number % len(DASHES)], linewidth=1.4, label=label)


def sheet(rows: int, columns: int, height_in: float, **shape: object) -> tuple[Figure, NDArray[np.object_]]:
    """A figure with tidy axes, shape (rows, columns)."""
    figure = new_figure(WIDTH_IN, height_in)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **shape)
    for each in axes.flat:
        tidy(each)
    return figure, axes


def binn_sagittal() -> Figure:
    """Left: what every neuron says where the ZMP is held. Right: the pitch while the ZMP swings once."""
    program = program_of("binn_sagittal")
    figure, ((left, right),) = sheet(1, 2, 2.9)
    zmp = np.linspace(-0.08, 0.12, 401)
    held = run(program, np.tile(zmp[:, np.newaxis], (20, 1, 1)))
    for number, name in enumerate(("q1", "p1", "q2", "p2")):
        curve(left, zmp * MM, held.output[-1, :, program.neuron_index[name]], number, name)
    for edge in ("back_edge", "front_edge"):
        left.axvline(load_circuit("binn_sagittal").parameters[edge].value_si * MM, color=GREY, linewidth=0.7)
    left.set(xlabel="ZMP, x [mm]", ylabel="output of the neuron")
    left.legend(frameon=False, loc="center")
    time_s = np.arange(150) * program.step_s
    swing = 0.02 + 0.075 * np.sin(2 * np.pi * np.minimum(time_s / 0.75, 1))
    time_s, trace = traced(program, {"zmp_x": swing})
    curve(right, time_s, swing * MM, 0, "ZMP, x [mm]")
    curve(right, time_s, np.degrees(trace.readout[:, 0, 0]), 1, "ankle pitch [°]")
    right.set(xlabel="time [s]")
    right.legend(frameon=False)
    return figure


def binn_sagittal_pushed() -> Figure:
    """A marching NAO pushed forward: no circuit, one that reads the ZMP, one that reads the capture point."""
    runs = {
        "no circuit, 13.5 N": ("open_loop", "binn_sagittal", "13.5 N"),
        "reads the ZMP, 6 N": ("circuit", "binn_sagittal", "6 N"),
        "reads the capture point, 13.5 N": ("circuit", "binn_sagittal_tuned", "13.5 N"),
    }
    figure, axes = sheet(2, 3, 3.9, sharex=True, sharey="row", height_ratios=[1.6, 1])
    for column, (title, (controller, circuit, force)) in zip(axes.T, runs.items(), strict=True):
        time_s, lines_mm, pitch_deg = _pushed_forward(controller, circuit, force)
        for number, (name, line) in enumerate(lines_mm.items()):
            curve(column[0], time_s, line, number, name)
        curve(column[1], time_s, pitch_deg, 4, "")
        column[0].axhline(99.4, color=GREY, linewidth=0.7)
        column[0].set_title(title, fontsize=SMALL + 0.5)
        for each in column:
            each.axvspan(0.0, 0.2, color="#f6c945", alpha=0.35, linewidth=0)
        column[1].set(xlabel="time from the push [s]", xlim=(-0.1, 0.9))
    axes[0, 0].set(ylabel="forward of the ankles [mm]", ylim=(-60, 160))
    axes[1, 0].set(ylabel="ankle pitch [°]", ylim=(-24, 24))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _pushed_forward(controller: str, circuit: str, force: str) -> tuple[Array, dict[str, Array], Array]:
    """Time [s], curves by name [mm] and pitch that the circuit adds [°], from 0.1 s before the push."""
    push = {"push.direction": "forward", "push.duration": "0.2 s", "push.force": force}
    who = {"controller": controller, "circuit": circuit}
    study = load_study("sagittal")
    case = CaseBuilder(study).case({"reference": {"gait": "gait_march"}, **push, **who})
    plan = case.plan()
    recording = run_loop(plan.setup(plan.controller(controller), [case.spec(0)]))
    view, step_s = BipedView(recording), recording.step_s
    first = round(float(recording.effects.windows_s[0, 0]) / step_s) - 10
    rows = slice(first, first + 100)
    com = view.com_m[rows, 0, 0]
    omega = natural_frequency(float(view.com_m[first, 0, 2]))
    lines = {
        "ZMP by the force cells": recording.channel("zmp_x")[rows, 0] * MM,
        "true centre of pressure": view.centre_of_pressure_m[rows, 0, 0] * MM,
        "capture point": (com + view.com_velocity[rows, 0, 0] / omega) * MM,
    }
    pitch = recording.commands[rows, 0, 0] if recording.command_names else np.zeros(len(com))
    return (np.arange(len(com)) - 10) * step_s, lines, np.degrees(pitch)


def _moved_deg(program: Program, zmp_m: Array, force: Array | float) -> Array:
    """Turn of the body to the front and to the left, 100 ms after the ZMP was moved; (n, 2) to (n, 2)."""
    inputs = program.pack_inputs({"zmp_x": zmp_m[:, 0], "zmp_y": zmp_m[:, 1], "force_difference": force})
    readout = np.degrees(run(program, np.broadcast_to(inputs, (10, *inputs.shape))).readout[-1])
    forward = -readout[:, program.output_index["ankle_pitch"]]
    return np.stack([forward, readout[:, program.output_index["ankle_roll"]]], axis=-1)


def _arrows(axes: Axes, places_m: Array, moved_deg: Array) -> None:
    """Arrows at places, forward is up, left is left."""
    axes.quiver(
        places_m[:, 1] * MM, places_m[:, 0] * MM, moved_deg[:, 1], moved_deg[:, 0], np.hypot(*moved_deg.T),
        angles="xy", scale_units="xy", scale=0.9, units="inches", width=0.014, cmap="viridis_r", clim=(0, 14),
    )  # fmt: skip
    axes.set(aspect="equal", xlabel="ZMP, y [mm]")
    axes.invert_xaxis()
    axes.grid(visible=False)


def _grid_m(x_mm: tuple[float, float], y_mm: tuple[float, float], step_mm: float) -> Array:
    """Places of a grid, shape (n, 2)."""
    x, y = (np.arange(low, high + step_mm / 2, step_mm) / MM for low, high in (x_mm, y_mm))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def binn_planar() -> Figure:
    """Where the body is moved for each place of the ZMP: one axes for who carries."""
    program = program_of("binn_planar")
    sides = {"right foot": (-1, -79.9, -26.9), "both feet": (0, -79.9, 79.9), "left foot": (1, 26.9, 79.9)}
    figure, (row,) = sheet(1, 3, 2.9, sharey=True, width_ratios=[113, 220, 113])
    for axes, (title, (force, right, left)) in zip(row[::-1], sides.items(), strict=True):
        places = _grid_m((-60, 100), (right - 30, left + 30), 10)
        _arrows(axes, places, _moved_deg(program, places, force))
        axes.plot(
            [right, right, left, left, right],
            [-29.65, 70.25, 70.25, -29.65, -29.65],
            color=GREY,
            linewidth=0.9,
        )
        axes.set_title(title)
    row[0].set_ylabel("ZMP, x [mm]")
    figure.colorbar(row[0].collections[0], ax=row, label="turn after 100 ms [°]", shrink=0.8)
    return figure


def binn_omnidirectional() -> Figure:
    """Left: where the body is moved for each place of the ZMP within the foot. Right: how far."""
    program = program_of("binn_omnidirectional")
    middle = np.array([0.02015, 0.0])
    figure, ((left, right),) = sheet(1, 2, 3.3, width_ratios=[1, 1.1])
    places = _grid_m((-35, 75), (-55, 55), 8)
    _arrows(left, places, _moved_deg(program, places, 0.0))
    corners = np.radians(np.arange(0, 361, 60))
    radius = 26.5 / np.cos(np.pi / 6)
    left.plot(radius * np.sin(corners), middle[0] * MM + radius * np.cos(corners), color=GREY, linewidth=0.9)
    left.set(xlabel="ZMP, y within the foot [mm]", ylabel="ZMP, x [mm]")
    figure.colorbar(left.collections[0], ax=left, label="turn after 100 ms [°]", location="left", shrink=0.8)
    angle = np.radians(np.arange(0, 361, 2))
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    for number, radius_mm in enumerate((20, 25, 30, 40)):
        moved = _moved_deg(program, middle + radius_mm / MM * around, 0.0)
        curve(right, np.degrees(angle), np.hypot(*moved.T), number, f"ZMP {radius_mm} mm from the middle")
    right.set(xlabel="direction of the ZMP, from the front to the left [°]", ylabel="turn after 100 ms [°]")
    right.set(xticks=range(0, 361, 60), ylim=(0, None))
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return figure


def _frequency_of(name: str, **changes: object) -> float:
    """Of the first output of an oscillator, between 10 and 20 s, [Hz]."""
    program = program_of(name, **changes)
    time_s, trace = traced(program, {program.input_names[0]: np.zeros(2000)})
    frequency = runpy.run_path(str(TESTS / "oscillators.py"))["frequency"]
    return float(frequency(time_s[1000:], trace.readout[1000:, 0, 0]))


def matsuoka_half_centre() -> Figure:
    """Left: outputs and angle. Right: frequency over inhibition, counted and published."""
    published = runpy.run_path(str(TESTS / "oscillators.py"))["published_frequency"]
    program = program_of("matsuoka_half_centre")
    figure, ((left, right),) = sheet(1, 2, 2.9)
    time_s, trace = traced(program, {"feedback": np.zeros(400)})
    for number, name in enumerate(("flexor", "extensor")):
        curve(left, time_s, trace.output[:, 0, program.neuron_index[name]], number, name)
    curve(left, time_s, trace.readout[:, 0, 0], 2, "joint angle [rad]")
    left.set(xlabel="time [s]", ylabel="output of the neuron")
    left.legend(frameon=False, loc="upper right", ncols=3)
    left.set_ylim(-0.25, 0.72)
    for number, tau_ms in enumerate((66, 132, 264)):
        first = 1 + tau_ms / 264
        a = np.linspace(first + 0.02, 3.3, 60)
        relation = np.array([published(x, tau=tau_ms / 1e3, adaptation=0.264, b=2.5) for x in a])
        curve(right, a, relation, number, f"τ/T = {tau_ms / 264:g}")
        counted = np.arange(np.ceil(5 * first + 0.2) / 5, 3.3, 0.2)
        found = [
            _frequency_of("matsuoka_half_centre", inhibition=f"{x:g}", tau=f"{tau_ms} ms") for x in counted
        ]
        right.plot(counted, found, "o", color=CYCLE[number], markersize=3.5)
    right.set(xlabel="mutual inhibition a", ylabel="frequency [Hz]", ylim=(0, None))
    right.legend(frameon=False)
    return figure


def taga_oscillator() -> Figure:
    """Left: the hips. Right: frequency over coupling, counted and published."""
    published = runpy.run_path(str(TESTS / "oscillators.py"))["published_frequency"]
    program = program_of("taga_oscillator")
    figure, ((left, right),) = sheet(1, 2, 2.9)
    time_s, trace = traced(program, {"feedback_left": np.zeros(600)})
    for number, side in enumerate(("left", "right")):
        angle = np.degrees(trace.readout[:, 0, program.output_index[f"{side}_hip"]])
        curve(left, time_s, angle, number, f"{side} hip")
    left.set(xlabel="time [s]", ylabel="angle [°]")
    left.legend(frameon=False, loc="upper right", ncols=2)
    left.set_ylim(-14, 17)
    coupling = np.linspace(0, 1.3, 60)
    relation = np.array([published(2 + x, tau=0.125, adaptation=0.156, b=2.5) for x in coupling])
    curve(right, coupling, relation, 0, "published relation")
    counted = np.arange(0, 1.31, 0.1)
    found = [_frequency_of("taga_oscillator", coupling=f"{x:g}") for x in counted]
    right.plot(counted, found, "o", color=CYCLE[1], markersize=3.5, label="counted")
    right.set(xlabel="coupling between the hips", ylabel="frequency [Hz]", ylim=(0, None))
    right.legend(frameon=False)
    return figure


def winner_take_all() -> Figure:
    """Eight outputs; one input rises twice, the second time beyond what holds the choice."""
    program = program_of("winner_take_all")
    names = program.input_names
    values = dict(zip(names, (0.3, 0.35, 0.42, 0.5, 0.2, 0.25, 0.45, 0.4), strict=True))
    series = {name: np.full(300, value) for name, value in values.items()}
    series["left"][100:] = 0.95 * 0.5
    series["left"][200:] = 1.25 * 0.5
    time_s, trace = traced(program, series)
    figure, ((axes,),) = sheet(1, 1, 2.8)
    first = program.neuron_index["choice[0]"]
    for i, name in enumerate(names):
        output = trace.output[:, 0, first + i]
        if name in {"back_left", "left"}:
            axes.plot(time_s, series[name], color=GREY, linestyle=":", linewidth=1)
            curve(axes, time_s, output, int(name == "left"), name)
        else:
            axes.plot(time_s, output, color=GREY, linewidth=0.8, label="all others" if i == 0 else None)
    axes.axhline(1.2 * 0.5, color=GREY, linewidth=0.7)
    axes.text(0.02, 0.605, "w times the input of the winner", fontsize=SMALL, va="bottom")
    axes.set(xlabel="time [s]", ylabel="output (dotted: its input)", xlim=(0, 3), ylim=(0, 0.7))
    axes.legend(frameon=False, loc="center right")
    return figure


def braitenberg_avoider() -> Figure:
    """Left: a path in the arena of the vehicle. Right: what the sensors see and how the wheels turn."""
    result = simulate("vehicle_avoids")
    recording = result.recording
    figure = new_figure(WIDTH_IN, 3.3)
    figure.set_layout_engine("constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.15, 1])
    axes = left.subplots()
    draw_paths(axes, [result])
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    tidy(axes, grid=False)
    above, below = right.subplots(2, 1, sharex=True)
    time_s = recording.time_s[:1000]
    for number, side in enumerate(("left", "right")):
        curve(above, time_s, 100 * recording.channel(f"distance_{side}")[:1000, 0], number, side)
        curve(below, time_s, recording.command(f"wheel_{side}")[:1000, 0], number, side)
    above.axhline(30, color=GREY, linewidth=0.7)
    above.set(ylabel="distance [cm]", ylim=(0, 105))
    below.set(xlabel="time [s]", ylabel="wheel [rad/s]")
    above.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.98))
    for each in (above, below):
        tidy(each)
    return figure


def spiking_reflex() -> Figure:
    """Left: spikes and ankle roll after a sudden lean. Right: rate over lean, counted and in closed form."""
    program = program_of("spiking_reflex", control_step="0.1 ms", substeps=1, leak="0.02 %")
    figure = new_figure(WIDTH_IN, 3.0)
    figure.set_layout_engine("constrained")
    left, right = figure.subfigures(1, 2)
    above, below = left.subplots(2, 1, sharex=True, height_ratios=[1, 1.6])
    lean = np.repeat([0.0, 0.15], [500, 2000])
    time_s, trace = traced(program, {"tilt_y": lean})
    names = ("motor_left", "sensory_left")
    spikes = [1e3 * time_s[trace.output[:, 0, program.neuron_index[name]] > 0] for name in names]
    above.eventplot(spikes, colors=[CYCLE[1], CYCLE[0]], linelengths=0.7)
    above.set(yticks=(0, 1), yticklabels=("motor", "sensory"))
    curve(below, 1e3 * time_s, np.degrees(trace.readout[:, 0, 0]), 1, "")
    below.set(xlabel="time [ms]", ylabel="ankle roll [°]")
    above.axvline(50, color=GREY, linewidth=0.7)
    below.axvline(50, color=GREY, linewidth=0.7)
    axes = right.subplots()
    lean = np.linspace(0.0751, 1, 400)
    rate = 1 / (0.004 + 0.02 * np.log(200 * lean / (200 * lean - 15)))
    curve(axes, lean, rate, 0, "closed form")
    held = np.linspace(0.05, 1, 20)
    counts = run(program, np.tile(held[:, np.newaxis], (10000, 1, 1))).output[
        ..., program.neuron_index[names[1]]
    ]
    axes.plot(held, counts.sum(axis=0), "o", color=CYCLE[1], markersize=3.5, label="counted in a second")
    axes.set(xlabel="lean, component of the up axis", ylabel="sensory spikes [1/s]", ylim=(0, None))
    axes.legend(frameon=False, loc="lower right")
    for each in (above, below, axes):
        tidy(each)
    return figure


def ring_attractor() -> Figure:
    """Left: activity of the ring while two cues come and go. Right: the bump that is held, and the theory."""
    program = program_of("ring_attractor")
    cues = {"cue_x": np.zeros(300), "cue_y": np.zeros(300)}
    for start, stop, degrees in ((20, 50, 60), (150, 190, -90)):
        cues["cue_x"][start:stop] = np.cos(np.radians(degrees))
        cues["cue_y"][start:stop] = np.sin(np.radians(degrees))
    time_s, trace = traced(program, cues)
    size = 64
    first = program.neuron_index["ring[0]"]
    ring = np.roll(trace.output[:, 0, first : first + size], size // 2, axis=1)
    angles = 360 * np.arange(-size // 2, size // 2) / size
    figure, ((left, right),) = sheet(1, 2, 3.0, width_ratios=[1.3, 1])
    image = left.pcolormesh(time_s, angles, ring.T, cmap="viridis", shading="nearest", rasterized=True)
    for start, stop, degrees in ((20, 50, 60), (150, 190, -90)):
        for colour, width in (("black", 4.5), ("white", 2.5)):
            left.plot([start / 100, stop / 100], [degrees] * 2, color=colour, linewidth=width)
    left.set(xlabel="time [s]", ylabel="direction of the member [°]", yticks=range(-180, 181, 90))
    figure.colorbar(image, ax=left, label="output")
    right.plot(angles, ring[149], "o", color=CYCLE[1], markersize=3, label="ring at 1.5 s")
    fine = np.linspace(-180, 180, 361)
    theory = np.pi / 2 * np.maximum(np.cos(np.radians(fine - 60)), 0)
    curve(right, fine, theory, 0, "π/2 · max(0, cos(θ − 60°))")
    right.set(
        xlabel="direction of the member [°]", ylabel="output", xticks=range(-180, 181, 90), ylim=(-0.05, 2.1)
    )
    right.legend(frameon=False, loc="upper left")
    return figure


def _small_balanced(steps: int, **changes: object) -> tuple[Array, float]:
    """Spikes of 5 000 neurons after 200 ms, (T, N), and the substep [s]; a control step is a substep."""
    small = {"excitatory.size": 4000, "inhibitory.size": 1000, "control_step": "0.5 ms", "substeps": 1}
    program = program_of("balanced_network", **small, **changes)
    return run(program, np.zeros((400 + steps, 1, 0))).output[400:, 0], program.step_s


def balanced_network() -> Figure:
    """Left: spikes. Middle: coefficients of variation. Right: rate over drive, counted and by the theory."""
    theory = runpy.run_path(str(TESTS / "mean_field.py"))["self_consistent"]
    spikes, step_s = _small_balanced(2000)
    figure, ((left, middle, right),) = sheet(1, 3, 2.8, width_ratios=[1.3, 1, 1])
    rows = np.r_[0:48, 4000:4012]
    times = [1e3 * step_s * np.flatnonzero(spikes[:600, row]) for row in rows]
    left.eventplot(times, colors=[CYCLE[0]] * 48 + [CYCLE[1]] * 12, linelengths=0.8, linewidths=1.0)
    left.set(xlabel="time [ms]", ylabel="neuron (on top: inhibitory)")
    intervals = [np.diff(np.flatnonzero(column)) for column in spikes.T]
    variation = [each.std() / each.mean() for each in intervals if len(each) >= FEWEST_INTERVALS]
    middle.hist(variation, bins=np.arange(0, 2.01, 0.1), color=CYCLE[0])
    middle.set(xlabel="coefficient of variation", ylabel="number of neurons")
    drive_na = np.linspace(2.2, 5, 15)
    curve(right, drive_na, np.array([theory(drive_mv=10 * each)[0] for each in drive_na]), 0, "theory")
    counted = (2.4, 3.0, 4.0, 5.0)
    rates = [_small_balanced(600, drive=f"{each} nA")[0].mean() / step_s for each in counted]
    right.plot(counted, rates, "o", color=CYCLE[1], markersize=4, label="counted")
    right.set(xlabel="drive [nA]", ylabel="firing rate [1/s]", ylim=(0, None))
    right.legend(frameon=False)
    return figure


def conditioned_reflex() -> Figure:
    """What is felt and heard, what the synapse learns from it, and what the joint does."""
    program = program_of("conditioned_reflex")
    touch, sound, awake = np.zeros(800), np.zeros(800), np.ones(800)
    touch[150:450] = 1
    for start, stop in ((50, 100), (150, 450), (500, 550), (600, 650), (700, 750)):
        sound[start:stop] = 1
    awake[575:675] = 0
    series = {"touch": touch, "sound": sound, "awake": awake}
    table = np.stack([series[name] for name in program.input_names], axis=-1)[:, np.newaxis]
    trace = run(program, table, states=True)
    time_s = (np.arange(len(touch)) + 1) * program.step_s
    figure, ((above,), (middle,), (below,)) = sheet(3, 1, 3.6, sharex=True, height_ratios=[1, 1, 0.8])
    for row, values in enumerate(series.values()):
        above.fill_between(time_s, -row, -row + 0.7 * values, step="pre", color=CYCLE[row], linewidth=0)
    above.set(yticks=[0.3, -0.7, -1.7], yticklabels=list(series))
    above.grid(visible=False)
    curve(middle, time_s, trace.states[:, 0, 0], 0, "")
    middle.axhline(0.5, color=GREY, linewidth=0.7)
    middle.set(ylabel="weight of the sound", ylim=(0, 1))
    curve(below, time_s, np.degrees(trace.readout[:, 0, 0]), 0, "")
    below.set(xlabel="time [s]", ylabel="joint [°]", ylim=(-2, 34), xlim=(0, 8))
    return figure


def hand_over() -> Figure:
    """Left: the loop of hysteresis. Right: a push to one side, and who acts."""
    program = program_of("hand_over")
    values = {name: value.value_si for name, value in load_circuit("hand_over").parameters.items()}
    limits = {"left_limit": 0.08, "right_limit": -0.06}
    figure, ((left, right),) = sheet(1, 2, 2.9)
    there = np.linspace(0.0, 0.09, 181)
    way = np.concatenate([there, there[::-1]])
    _, trace = traced(program, {"dcm_y": way, **{k: np.full(len(way), v) for k, v in limits.items()}})
    share = trace.readout[:, 0, program.output_index["step_share_left"]]
    half = len(there)
    curve(left, way[:half] * MM, share[:half], 1, "on the way out")
    curve(left, way[half:] * MM, share[half:], 0, "on the way back")
    for inside in (0.0, values["margin"], values["margin"] + values["hold"]):
        left.axvline((limits["left_limit"] - inside) * MM, color=GREY, linewidth=0.7)
    left.set(xlabel="DCM, to the left [mm]", ylabel="step to the left")
    left.legend(
        frameon=False, loc="center", bbox_to_anchor=(30, 0.5), bbox_transform=left.transData, handlelength=1.4
    )
    time_s = np.arange(120) * program.step_s
    dcm = (
        0.02 + 0.07 * np.exp(-(((time_s - 0.35) / 0.15) ** 2)) - 0.07 * np.exp(-(((time_s - 0.9) / 0.1) ** 2))
    )
    held = {name: np.full(len(dcm), value) for name, value in limits.items()}
    time_s, trace = traced(program, {"dcm_y": dcm, **held})
    curve(right, time_s, dcm * MM, 0, "DCM")
    for value in limits.values():
        right.axhline(
            value * MM, color=GREY, linewidth=0.7, label="what the ankles hold" if value > 0 else None
        )
    names = [("left", limits["left_limit"]), ("right", limits["right_limit"])]
    for number, (name, height) in enumerate(names, start=1):
        acts = trace.output[:, 0, program.neuron_index[name]] > 0
        right.fill_between(
            time_s, 0, height * MM, where=acts, step="pre", color=CYCLE[number], alpha=0.25,
            hatch=("//", "..")[number - 1], linewidth=0, label=f"a step against a fall to the {name}",
        )  # fmt: skip
    right.set(xlabel="time [s]", ylabel="to the left [mm]", xlim=(0, 1.2), ylim=(-80, 180))
    right.legend(frameon=False, loc="upper right")
    return figure


FIGURES = {
    "binn_sagittal": binn_sagittal,
    "binn_sagittal_pushed": binn_sagittal_pushed,
    "binn_planar": binn_planar,
    "binn_omnidirectional": binn_omnidirectional,
    "matsuoka_half_centre": matsuoka_half_centre,
    "taga_oscillator": taga_oscillator,
    "winner_take_all": winner_take_all,
    "braitenberg_avoider": braitenberg_avoider,
    "spiking_reflex": spiking_reflex,
    "ring_attractor": ring_attractor,
    "balanced_network": balanced_network,
    "hand_over": hand_over,
    "conditioned_reflex": conditioned_reflex,
}


def write_circuit_pictures(names: Iterable[str] = FIGURES) -> None:
    """The pictures of these circuits, all of them by default."""
    for name in names:
        with house_style():
            figure = FIGURES[name]()
        save_figure(figure, IMAGES / f"{name}.png")


if __name__ == "__main__":
    write_circuit_pictures(sys.argv[1:] or FIGURES)
