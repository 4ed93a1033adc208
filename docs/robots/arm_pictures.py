"""Draws the pictures of docs/robots/arm.md."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit import draw_circuit, load_circuit, load_scenario, simulate
from circuitkit.draw.style import CYCLE, DASHES, GREY, SMALL, house_style, new_figure, save_figure, tidy
from circuitkit.simulation import Scenario
from circuitkit.simulation.disturbances.body import Body
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.renderer import Screen

if TYPE_CHECKING:
    from circuitkit.simulation import Recording, Result

Array = NDArray[np.float64]

IMAGES = Path(__file__).parent / "img"
PAYLOADS_KG = (0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0)
SETTLED_S = 10.0
HELD_S = 3.5  # of the film still
FEEDBACK = ("feedback -> flexor", "feedback -> extensor")


def with_payload(kilograms: float, jitter_deg: float = 5.0, **fields: object) -> Scenario:
    """`arm_rhythm` with another payload."""
    loaded = load_scenario("arm_rhythm")
    item = type(loaded.disturbances[0])
    rest = [d for d in loaded.befalling if not isinstance(d, Body | Jitter)]
    payload = [Body(body="hand", payload=kilograms)] if kilograms else []
    changed = [*rest, *payload, Jitter(joints=math.radians(jitter_deg))]
    items = tuple(item(**{each.kind: each}) for each in changed)
    return load_scenario("arm_rhythm").model_copy(update={"disturbances": items, **fields})


def rises(time_s: Array, angle: Array) -> Array:
    """Moments at which the angle rises through 0, [s]."""
    found = np.flatnonzero((angle[:-1] < 0) & (angle[1:] >= 0))
    moments: Array = time_s[found] - angle[found] * np.diff(time_s)[found] / np.diff(angle)[found]
    return moments


def frequency(recording: Recording) -> float:
    """Of the elbow once it has settled, [Hz]."""
    late = recording.time_s > SETTLED_S
    moments = rises(recording.time_s[late], recording.channel("elbow")[late, 0])
    return float((len(moments) - 1) / (moments[-1] - moments[0]))


def own_frequency(kilograms: float) -> float:
    """Of the arm with its tone alone, by the half periods after it is released, [Hz]."""
    for seed in range(20):
        scenario = with_payload(kilograms, jitter_deg=15.0, duration=5.0)
        recording = simulate(scenario, controller="open_loop", seed=seed).recording
        angle = recording.channel("elbow")[:, 0]
        if abs(angle[0]) > math.radians(10):
            break
    ends = rises(recording.time_s, angle - angle[-1]), rises(recording.time_s, angle[-1] - angle)
    return float(0.5 / np.diff(np.sort(np.concatenate(ends))[:4]).mean())


def draw_results() -> None:
    """Left: the elbow under the load. Right: the frequency of the rhythm over that of the arm."""
    held = {
        "tone alone": simulate("arm_reflex", controller="open_loop"),
        "stretch reflex": simulate("arm_reflex"),
        "without the sense of speed": simulate("arm_reflex", settings={"speed_gain": "0 nA*s"}),
    }
    own = [own_frequency(kilograms) for kilograms in PAYLOADS_KG]
    runs = {"with feedback": {}, "oscillator alone": {"silenced": FEEDBACK}}
    with house_style():
        figure = new_figure(7.2, 2.7)
        figure.set_layout_engine("constrained")
        left, right = figure.subplots(1, 2)
        for number, (label, result) in enumerate(held.items()):
            angle = np.degrees(result.recording.channel("elbow")[:, 0])
            left.plot(
                result.recording.time_s, angle, color=CYCLE[number], linestyle=DASHES[number], label=label
            )
        left.set(xlabel="time [s]", ylabel="elbow [deg]", ylim=(-37, 3))
        left.legend(frameon=False, fontsize=SMALL, loc="lower right")
        for number, (label, fields) in enumerate(runs.items()):
            found = [
                frequency(simulate(with_payload(kilograms, duration=30.0, **fields)).recording)
                for kilograms in PAYLOADS_KG
            ]
            right.plot(
                own,
                found,
                color=CYCLE[number],
                linestyle=DASHES[number],
                marker="o",
                markersize=3,
                label=label,
            )
        right.plot([0.8, 1.7], [0.8, 1.7], color=GREY, linewidth=0.8, label="that of the arm")
        right.set(xlabel="frequency of the arm [Hz]", ylabel="frequency of the rhythm [Hz]")
        right.legend(frameon=False, fontsize=SMALL, loc="upper left")
        for axes in (left, right):
            tidy(axes)
        save_figure(figure, IMAGES / "arm_results.png")


def still(result: Result, time_s: float) -> NDArray[np.uint8]:
    """The arm from above at a moment; shape (height, width, 3)."""
    model, tick = result.recording.robot.model, int(time_s / result.recording.step_s)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[:] = result.recording.qpos[tick, 0]
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera("above").id
    with Screen(model, 400, 300) as screen:
        screen.look(data, camera)
        return screen.draw()


def draw_stills() -> None:
    """Before the load; and held against it by the tone alone and by the reflex."""
    from PIL import Image

    reflex, tone = simulate("arm_reflex"), simulate("arm_reflex", controller="open_loop")
    pictures = [still(reflex, 0.8), still(tone, HELD_S), still(reflex, HELD_S)]
    Image.fromarray(np.concatenate(pictures, axis=1)).save(IMAGES / "arm.png", optimize=True)


if __name__ == "__main__":
    draw_circuit(load_circuit("stretch_reflex"), IMAGES / "arm_reflex_circuit.png")
    draw_results()
    draw_stills()
