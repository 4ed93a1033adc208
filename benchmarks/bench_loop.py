"""The closed loop against bare physics: the same robot, the same targets, the same number of physics steps.

The loop is everything: gait, sensors with noise, circuit, recording. Bare is nothing but `mj_step`, or, for
many robots, `mujoco.batch.Batch.step`, with the walk's targets written once a control step.
"""

from __future__ import annotations

import mujoco
from mujoco.batch import Batch

from circuitkit.biped.dynamics import generalised_positions
from circuitkit.biped.thresholds import run_and_judge
from circuitkit.simulation import Plan, load_scenario, make_plan
from circuitkit.simulation.disturbance import Trial
from circuitkit.simulation.loop import run_loop
from circuitkit.study.bench import Case, Work

_ALONE_S = 17.0  # as long as nao_push, so that making the arrays counts as much as it does there
_TOGETHER_S = 4.0


def cases() -> tuple[Case, ...]:
    """One robot, and 64, which are recorded or only judged."""
    return (
        Case("closed loop: 1 robot", "mj_step alone, one robot", _one, limit=1.35),
        Case("closed loop: 64 robots", "Batch.step alone, 64 robots", lambda: _many(64), limit=1.15),
        Case("verdicts: 64 robots", "Batch.step alone, 64 robots", lambda: _judged(64), limit=1.1),
    )


def _plan(duration_s: float) -> Plan:
    return make_plan(load_scenario("nao_push").model_copy(update={"duration": duration_s, "pushes": ()}))


def _one() -> tuple[Work, Work]:
    plan = _plan(_ALONE_S)
    model = plan.robot.model
    data = mujoco.MjData(model)
    start = generalised_positions(plan.robot, plan.walk)[0]
    substeps = round(plan.walk.gait.control_step / model.opt.timestep)

    def bare() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos = start
        for target in plan.targets:
            data.ctrl = target
            for _ in range(substeps):
                mujoco.mj_step(model, data)

    return lambda: run_loop(plan.setup("circuit", [Trial(0, ())])), bare


def _many(batch: int) -> tuple[Work, Work]:
    plan = _plan(_TOGETHER_S)
    trials = [Trial(seed, ()) for seed in range(batch)]
    return lambda: run_loop(plan.setup("circuit", trials)), _bare(plan, batch)


def _judged(batch: int) -> tuple[Work, Work]:
    plan = _plan(_TOGETHER_S)
    trials = [Trial(seed, ()) for seed in range(batch)]
    thresholds = plan.scenario.thresholds
    return lambda: run_and_judge(plan.setup("circuit", trials), thresholds), _bare(plan, batch)


def _bare(plan: Plan, batch: int) -> Work:
    """Steps a batch along the targets of a plan, and nothing else."""
    worlds = Batch(plan.robot.model, batch)
    ctrl, qpos, qvel = worlds.bind("ctrl"), worlds.bind("qpos"), worlds.bind("qvel")
    start = generalised_positions(plan.robot, plan.walk)[0]
    substeps = round(plan.walk.gait.control_step / plan.robot.model.opt.timestep)

    def bare() -> None:
        worlds.reset()
        qpos[:], qvel[:] = start, 0.0
        for target in plan.targets:
            ctrl[:] = target
            worlds.step(nstep=substeps)

    return bare
