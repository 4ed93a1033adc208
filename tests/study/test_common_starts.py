"""Robots that start alike are simulated once until something befalls one of them: to the same last bit."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch
from small_robots import small_robot

from circuitkit.simulation import Plan, RunSpec, Scenario, load_scenario, make_plan
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.loop import Setup, run_and_watch, run_loop

ARRAYS = ("readings", "qpos", "observations", "commands", "trace")
MORE = (  # what remembers, and what begins before or after the push
    {"delay": {"channel": "*", "by": 0.02}},
    {"fault": {"channel": "LFsrFL", "reading": "stuck", "start": 1.2, "duration": 1.0}},
    {"fault": {"channel": "RFsrFL", "reading": "missing", "start": 1.0, "duration": 0.2}},
    {"actuator": {"actuator": "*AnkleRoll", "strength": 0.8, "start": 1.0, "duration": 0.5}},
)


def plan(controller: str) -> Plan:
    scenario = load_scenario("nao_push")
    more = type(scenario)(robot="nao", duration=1.0, disturbances=MORE).befalling
    changed = scenario.model_copy(update={"duration": 2.2, "controller": controller})
    return make_plan(changed.with_disturbances((*scenario.befalling, *more)))


def specs(made: Plan) -> list[RunSpec]:
    """Seven robots of two seeds; two are never pushed, and one is pushed twice."""
    jitter, push, *rest = made.scenario.befalling
    pushes = [
        [{"force": 5.0}],
        [{"force": 30.0}],
        [],
        [{"force": 20.0, "start": 1.9}, {"force": 3.0, "start": 1.41, "direction": "forward"}],
        [{"force": 20.0, "start": 0.0}],
        [],
        [{"force": 60.0, "duration": 0.4, "direction": "left"}],
    ]
    found = []
    for seed, each in zip((3, 3, 3, 3, 3, 4, 4), pushes, strict=True):
        some = [push.model_copy(update={"start": 1.4, "direction": "right", **change}) for change in each]
        found.append(RunSpec(seed, (jitter, *some, *rest)))
    return found


def apart(setup: Setup) -> Setup:
    """The same runs, each simulated by itself."""
    setup.effects.own_tick[:] = 0
    return setup


@pytest.mark.parametrize("controller", ["circuit", "stepping"])
def test_recordings_are_the_same_to_the_last_bit(controller):
    made = plan(controller)
    bound = made.controller()
    together = run_loop(made.setup(bound, specs(made)))
    alone = run_loop(apart(made.setup(bound, specs(made))))
    for name in ARRAYS:
        one, other = getattr(together, name), getattr(alone, name)
        assert one.shape == other.shape
        assert np.array_equal(one.view(np.int64), other.view(np.int64)), name
    assert together.measures == alone.measures


def test_measures_are_the_same_and_so_are_those_of_a_robot_alone():
    made = plan("circuit")
    bound, each = made.controller(), specs(made)
    together = run_and_watch(made.setup(bound, each))
    alone = run_and_watch(apart(made.setup(bound, each)))
    assert together.measures() == alone.measures()
    assert together.effort() == alone.effort()
    for i in (1, 3, 6):
        single = run_and_watch(made.setup(bound, [each[i]]))
        assert (single.measures(), single.effort()) == ((together.measures()[i],), (together.effort()[i],))


def test_only_one_robot_of_a_seed_is_stepped_before_its_push(monkeypatch):
    made = plan("circuit")
    setup = made.setup(made.controller(), specs(made))
    stepped, plain = [], Batch.step

    def step(self, ids=None, nstep=1, **more):
        stepped.append(self.nsim if ids is None else len(ids))
        plain(self, ids, nstep, **more)

    monkeypatch.setattr(Batch, "step", step)
    run_loop(setup)
    each_tick = stepped[::2]  # the last time step of a tick is a call of its own
    assert len(each_tick) == 220
    assert each_tick[0] == 3  # one of each seed, and the one that is pushed at once
    assert each_tick[-1] == 7
    begins = np.sort(setup.effects.own_tick)
    assert [each_tick.count(n) for n in (3, 7)] == [begins[1], 220 - begins[4]]


SLEEPY = """
<mujoco>
  <option timestep="0.002"><flag sleep="enable"/></option>
  <worldbody>
    <geom type="plane" size="9 9 .1"/>
    <body name="robot" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/>
      <body name="leg" pos=".3 0 0"><joint name="k" axis="0 0 1" damping=".01"/>
        <geom type="box" size=".05 .05 .05" mass=".1"/></body></body>
    <body name="box" pos="-3 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
  </worldbody>
</mujoco>
"""


def test_bodies_that_sleep_do_what_mujoco_says_whatever_the_batch(tmp_path):
    """Robots of one seed that are pushed at different times, in one batch; each as in MuJoCo by itself."""
    starts = (0.5, 1.0, None)
    pushes = [
        () if s is None else (Push(body="box", force=30.0, direction="left", duration=0.1, start=s),)
        for s in starts
    ]
    made = make_plan(Scenario(robot=small_robot(tmp_path, SLEEPY), control_step=0.01, duration=1.5))
    found = run_loop(made.setup(made.controller(), [RunSpec(0, push) for push in pushes]))
    model = mujoco.MjModel.from_xml_string(SLEEPY)
    for number, start in enumerate(starts):
        data = mujoco.MjData(model)
        for tick in range(found.ticks):
            pushed = start is not None and round(start * 100) <= tick < round(start * 100) + 10
            data.xfrc_applied[model.body("box").id, 1] = 30.0 if pushed else 0.0
            mujoco.mj_step(model, data, nstep=5)
            np.testing.assert_array_equal(found.qpos[tick, number], data.qpos)
