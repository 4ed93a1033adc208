"""The closed loop against bare physics: the same robot, the same targets, the same number of physics steps.

The loop is everything: reference, sensors with noise, circuit, recording. Bare is nothing but `mj_step`, or,
for many robots, `mujoco.batch.Batch.step`, with the controls that the loop has sent, written once a control
step: what touches what, and so the work of the physics, is the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from circuitkit.control import Array
from circuitkit.robots.worlds import substeps_of
from circuitkit.simulation import Plan, RunSpec, load_scenario, make_plan
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.loop import Setup, run_and_watch, run_loop
from circuitkit.study.bench import Case, Work

_TOGETHER = 64


@dataclass(frozen=True)
class _Loop:
    """A scenario that is measured without what befalls it, but for noise.

    Attributes:
        scenario: Its name.
        alone_s: How long one robot runs: as long as the scenario, so that making arrays counts as much, [s].
        together_s: How long many robots run, [s].
        alone: Limit of the ratio for one robot.
        together: Limit of the ratio for many.
    """

    scenario: str
    alone_s: float
    together_s: float
    alone: float
    together: float

    def plan(self, duration_s: float) -> Plan:
        """The plan of a run so long, which nothing ends early."""
        loaded = load_scenario(self.scenario)
        noise = tuple(each for each in loaded.befalling if isinstance(each, Noise))
        changes = {"duration": duration_s, "until": None}
        return make_plan(loaded.with_disturbances(noise).model_copy(update=changes))

    def one(self) -> tuple[Work, Work]:
        """One robot, recorded, and `mj_step`."""
        plan = self.plan(self.alone_s)
        setup = _setup(plan, 1)
        model, controls = plan.robot.model, _controls(setup)[:, 0]
        data = mujoco.MjData(model)
        substeps = substeps_of(plan.robot, plan.body.step_s)

        def bare() -> None:
            mujoco.mj_resetData(model, data)
            data.qpos = plan.body.motion.start_qpos
            for control in controls:
                data.ctrl = control
                for _ in range(substeps):
                    mujoco.mj_step(model, data)

        return lambda: run_loop(setup), bare

    def many(self, *, recorded: bool) -> tuple[Work, Work]:
        """Many robots, recorded or only measured, and `Batch.step`."""
        plan = self.plan(self.together_s)
        setup = _setup(plan, _TOGETHER)
        bare = bare_batch(plan, _controls(setup))
        return (lambda: run_loop(setup)) if recorded else (lambda: run_and_watch(setup)), bare


def _setup(plan: Plan, batch: int) -> Setup:
    specs = [RunSpec(seed, plan.scenario.befalling) for seed in range(batch)]
    return plan.setup(plan.controller(), specs)


def _controls(setup: Setup) -> Array:
    """What the loop sends to the actuators; shape (T, B, nu)."""
    recording = run_loop(setup)
    targets = setup.motion.targets
    sent = np.broadcast_to(targets[:, np.newaxis], (setup.ticks, len(setup.specs), targets.shape[1])).copy()
    for name in recording.command_names:
        command = setup.robot.commands[name]
        values = recording.command(name)
        if command.limits is not None:
            values = np.clip(values, *command.limits)
        sent += values[..., np.newaxis] * command.factors
    return sent


def bare_batch(plan: Plan, controls: Array) -> Work:
    """Steps a batch with these controls, shape (T, B, nu), and does nothing else."""
    worlds = Batch(plan.robot.model, controls.shape[1])
    ctrl, qpos, qvel = worlds.bind("ctrl"), worlds.bind("qpos"), worlds.bind("qvel")
    substeps = substeps_of(plan.robot, plan.body.step_s)

    def bare() -> None:
        worlds.reset()
        qpos[:], qvel[:] = plan.body.motion.start_qpos, 0.0
        for control in controls:
            ctrl[:] = control
            worlds.step(nstep=substeps)

    return bare


_LOOPS = {
    "closed loop": _Loop("nao_push", 17.0, 4.0, alone=1.30, together=1.10),
    "vehicle": _Loop("vehicle_avoids", 20.0, 4.0, alone=1.5, together=1.15),
    "quadruped": _Loop("quadruped_trots", 10.0, 4.0, alone=1.5, together=1.15),
}


def cases() -> tuple[Case, ...]:
    """One robot, and 64, which are recorded or only measured."""
    found = []
    for name, loop in _LOOPS.items():
        found.append(Case(f"{name}: 1 robot", "mj_step alone, one robot", loop.one, limit=loop.alone))
        for words, recorded in ((f"{name}: 64 robots", True), (f"{name}, only measures: 64 robots", False)):
            against = "Batch.step alone, 64 robots"

            def prepare(loop: _Loop = loop, *, recorded: bool = recorded) -> tuple[Work, Work]:
                return loop.many(recorded=recorded)

            found.append(Case(words, against, prepare, limit=loop.together))
    return tuple(found)
