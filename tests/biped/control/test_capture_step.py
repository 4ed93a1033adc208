"""The step law against closed forms of the pendulum, what the ankles can hold, and the NAO that steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walking import a_push, assert_same_bits, interface_of, known_of, plan_of, walk_all, walk_alone

from circuitkit.base.errors import InputError
from circuitkit.base.source import find_data_file
from circuitkit.biped.control.capture_step import dcm_at_end, holdable_dcm
from circuitkit.biped.gait.lipm import natural_frequency
from circuitkit.control import load_controller
from circuitkit.simulation import RunSpec

OMEGA, DT = natural_frequency(0.27), 0.01
FOOT, PERIOD = 0.059, 0.55  # where the ZMP is under each foot, and how long each carries


def pendulum(y, velocity, zmp, duration):
    """Y'' = omega^2 (y - z) with a constant z, in closed form."""
    c, s = math.cosh(OMEGA * duration), math.sinh(OMEGA * duration)
    return zmp + (y - zmp) * c + velocity / OMEGA * s, (y - zmp) * OMEGA * s + velocity * c


# --- the step law -------------------------------------------------------------------------------------------


@given(y=st.floats(-0.1, 0.1), velocity=st.floats(-0.5, 0.5), zmp=st.floats(-0.1, 0.1), t=st.floats(0, 0.6))
def test_the_dcm_at_the_end_is_that_of_the_pendulum(y, velocity, zmp, t):
    end, end_velocity = pendulum(y, velocity, zmp, t)
    ahead = dcm_at_end(np.array([y + velocity / OMEGA]), zmp, t, OMEGA)
    np.testing.assert_allclose(ahead, end + end_velocity / OMEGA, atol=1e-12)


@settings(max_examples=30)
@given(kick=st.floats(-0.3, 0.3), moment=st.floats(0, PERIOD))
def test_with_the_foot_where_the_law_puts_it_the_walk_goes_on_as_planned_from_its_feet(kick, moment):
    """A pendulum that walks on the spot is kicked once; ever after it walks as before, delta further on."""
    # The periodic walk: the DCM starts at x and ends at -x over the foot at +FOOT.
    growth = math.exp(OMEGA * PERIOD)
    start = FOOT * (growth - 1) / (growth + 1)
    dcm = FOOT + (start - FOOT) * math.exp(OMEGA * moment) + kick / OMEGA
    planned_end = -start
    delta = dcm_at_end(np.array([dcm]), FOOT, PERIOD - moment, OMEGA)[0] - planned_end
    assert delta == pytest.approx(kick / OMEGA * math.exp(OMEGA * (PERIOD - moment)), abs=1e-9)
    dcm, foot = FOOT + (dcm - FOOT) * math.exp(OMEGA * (PERIOD - moment)), -FOOT + delta
    for _ in range(2):
        assert dcm - foot == pytest.approx(math.copysign(FOOT - start, dcm - foot), abs=1e-9)
        dcm = foot + (dcm - foot) * growth
        foot += 2 * math.copysign(FOOT, dcm - foot)


# --- what the ankles can hold -------------------------------------------------------------------------------


def test_on_one_support_forever_it_is_the_support():
    left, right = holdable_dcm(np.full(300, -0.1), np.full(300, 0.08), OMEGA, DT)
    np.testing.assert_allclose(left, 0.08)
    np.testing.assert_allclose(right, -0.1)


def test_before_a_change_of_feet_it_is_what_the_edge_brings_to_the_next_foot():
    ticks, change = 400, 40
    edge, next_edge = 0.1, -0.011
    high = np.where(np.arange(ticks) < change, edge, next_edge)
    left, right = holdable_dcm(high - 0.5, high, OMEGA, DT, change)
    expected = edge + (next_edge - edge) * np.exp(-OMEGA * DT * (change - np.arange(change)))
    np.testing.assert_allclose(left, expected, atol=1e-9)
    assert left.shape == right.shape == (change,)


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), tick=st.integers(0, 30), beyond=st.sampled_from([-1e-3, 1e-3]))
def test_what_is_inside_can_be_held_and_what_is_outside_cannot(seed, tick, beyond):
    """By brute force: the ZMP at the edge all the time is the most that any ankle can do against a fall."""
    rng = np.random.default_rng(seed)
    ticks = 160
    middle = np.repeat(rng.uniform(-0.1, 0.1, ticks // 20), 20)
    low, high = middle - 0.05, middle + 0.05
    left, _ = holdable_dcm(low, high, OMEGA, DT)
    dcm = left[tick] + beyond
    for k in range(tick, ticks - 1):
        dcm = high[k] + (dcm - high[k]) * math.exp(OMEGA * DT)
    assert (dcm < high[-1]) == (beyond < 0)


# --- the controller, told what to see -----------------------------------------------------------------------

SINGLE = range(110, 150)  # ticks within the first single support: the left foot carries, the right one swings
NUMBERS = {
    "ankle_circuit": "binn_lateral",
    "reach_outward": "50 mm",
    "reach_inward": "0 mm",
    "stretch": "50 %",
    "push_off": "50 %",
    "blend_back": "100 ms",
}


@pytest.fixture(scope="module")
def reference():
    return known_of(plan_of(duration=3.0))


class Fed:
    """The controller on a robot that keeps its plan but for an error of the DCM."""

    def __init__(self, reference, batch=1, **changes):
        self.reference, self.batch, self.tick = reference, batch, 0
        self.controller = load_controller("stepping", NUMBERS | changes).bind(interface_of(reference))
        self.controller.reset(batch)
        self.trace = np.zeros((batch, len(self.controller.trace_names)))

    def seen(self, error_m):
        """Readings on the plan, with the CoM beside it; everything that is not about the CoM is zero."""
        tick, plan = self.tick, self.reference
        middle = plan.ankles_m[tick, :, 1].mean()
        known = {
            "com_y": plan.com_m[tick, 1] - middle + np.broadcast_to(error_m, self.batch),
            "com_velocity_y": plan.com_velocity[tick, 1],
            "feet_y": plan.feet_apart_m[tick, 1],
        }
        rows = [np.broadcast_to(known.get(name, 0.0), self.batch) for name in self.controller.observations]
        return np.stack(rows, axis=1)

    def step(self, error_m=0.0):
        """The commands by name; each of shape (B,)."""
        commands = self.controller.step(self.seen(error_m))
        self.controller.store_trace(self.trace)
        self.tick += 1
        return dict(zip(self.controller.commands, commands.T.copy(), strict=True))

    def until(self, tick, error_m=0.0):
        """Step on; the commands of the last tick before `tick`."""
        while self.tick < tick:
            commands = self.step(error_m)
        return commands

    def traced(self, name):
        return self.trace[:, self.controller.trace_names.index(name)]


LEGS = ("left_foot_y", "right_foot_y", "left_leg_lift", "right_leg_lift")


def test_on_the_plan_the_legs_do_nothing_and_the_ankles_all(reference):
    fed = Fed(reference)
    while fed.tick < reference.walk.ticks:
        commands = fed.step()
        assert all(commands[name] == 0.0 for name in LEGS)
        assert fed.traced("ankle_share") == 1.0


def leg_length_m(reference):
    legs, knee = reference.body.legs, reference.walk.gait.knee
    square = legs.thigh_m**2 + legs.tibia_m**2 + 2 * legs.thigh_m * legs.tibia_m * math.cos(knee)
    return math.sqrt(square)


def test_the_swing_foot_goes_where_the_dcm_will_be(reference):
    fed = Fed(reference, reach_outward="120 mm", stretch="0 %")
    tick, error = 140, -0.055
    fed.until(tick)
    commands = fed.step(error)
    schedule = reference.schedule
    left_s = np.count_nonzero(
        (schedule.step == schedule.step[tick]) & (np.arange(len(schedule.step)) >= tick)
    )
    delta = error * math.exp(reference.omega * left_s * reference.step_s)
    expected = max(delta, -0.12)
    assert math.sin(commands["right_foot_y"][0]) * leg_length_m(reference) == pytest.approx(expected)
    # The plan's own DCM is not exactly eq. 2.
    assert fed.traced("step_y")[0] == pytest.approx(delta, rel=0.02)
    assert commands["left_foot_y"] == commands["left_leg_lift"] == commands["right_leg_lift"] == 0.0


def test_a_spread_leg_stretches_up_to_a_part_of_its_bend(reference):
    fed = Fed(reference)
    fed.until(130)
    commands = fed.step(-0.2)  # far beyond: the foot goes as far as it reaches
    assert math.sin(commands["right_foot_y"][0]) * leg_length_m(reference) == pytest.approx(-0.05)
    assert commands["right_leg_lift"][0] == pytest.approx(-0.5 * reference.walk.gait.knee / 2)


def test_the_leg_that_carries_pushes_off_on_its_own_side(reference):
    fed = Fed(reference)
    fed.until(130)
    commands = fed.step(0.2)
    assert math.sin(commands["left_foot_y"][0]) * leg_length_m(reference) == pytest.approx(0.5 * 0.05)
    # The other foot could only come inward: by reach_inward, here 0.
    assert commands["right_foot_y"][0] == 0.0


@pytest.fixture
def quick_to_let_go(tmp_path):
    """The shipped circuit with hardly any hysteresis, so that a single large error is a single step."""
    shipped = find_data_file("hand_over", "circuits").as_posix()
    path = tmp_path / "quick.yaml"
    path.write_text(
        f"circuit: quick\ncontrol_step: 10 ms\ntiming: ordered\ninclude: ['{shipped}']\n"
        "parameters: {margin: 20 mm, hold: 1 mm}\n",
        encoding="utf-8",
    )
    return str(path)


def test_a_foot_keeps_its_place_while_it_carries_and_comes_back_in_its_next_swing(reference, quick_to_let_go):
    fed = Fed(reference, hand_over=quick_to_let_go)
    fed.until(130)
    placed = fed.step(-0.2)["right_foot_y"]
    # Through the rest of this step, while no foot is in the air, and as stance.
    stays = fed.until(209)["right_foot_y"]
    schedule = reference.schedule
    swinging = (schedule.support == 0) & (schedule.single_support > 0) & (schedule.single_support < 1)
    rest_of_swing = np.count_nonzero(swinging[131:165])
    decay = math.exp(-0.01 / 0.1)
    assert math.sin(stays[0]) == pytest.approx(math.sin(placed[0]) * decay**rest_of_swing)
    later = fed.until(250)["right_foot_y"]
    again = np.count_nonzero(swinging[209:250])
    assert again > 10
    assert math.sin(later[0]) == pytest.approx(math.sin(stays[0]) * decay**again)


def test_who_acts_is_up_to_the_circuit(reference, tmp_path):
    never = tmp_path / "never.yaml"
    never.write_text(
        "circuit: never\ncontrol_step: 10 ms\ntiming: ordered\n"
        "inputs: {dcm_y: {unit: m, range: [-1 m, 1 m]}}\n"
        "neurons:\n  on: {model: step, role: excitatory, shift: -10 m}\n"
        "  off: {model: step, role: excitatory, shift: 10 m}\n"
        "synapses: [{from: dcm_y, to: on, weight: 1}, {from: dcm_y, to: off, weight: 1}]\n"
        "outputs:\n"
        "  ankle_share: {unit: '1', readout: {on: 0.5}}\n"
        "  step_share_left: {unit: '1', readout: {off: 1}}\n"
        "  step_share_right: {unit: '1', readout: {off: 1}}\n",
        encoding="utf-8",
    )
    fed, other = Fed(reference, hand_over=str(never)), Fed(reference)
    fed.until(130, 0.05), other.until(130, 0.05)
    assert all(fed.step(-0.2)[name] == 0.0 for name in LEGS)
    assert fed.traced("ankle_share") == 0.5


def test_a_missing_reading_leaves_that_robot_only_without_commands(reference):
    fed, alone = Fed(reference, batch=2), Fed(reference)
    fed.until(130), alone.until(130)
    fed.step(-0.2), alone.step(-0.2)
    rows = fed.seen(0.0)
    rows[0] = np.nan
    commands = fed.controller.step(rows)
    expected = alone.step(0.0)
    for i, name in enumerate(fed.controller.commands):
        assert np.isnan(commands[0, i])
        assert commands[1, i] == expected[name][0]


# --- the NAO ------------------------------------------------------------------------------------------------


def test_undisturbed_it_walks_as_under_the_ankle_circuit_alone():
    """To rounding: more channels are read at once, so the force cells are summed in another order."""
    spec = load_controller("stepping")
    plan = plan_of(spec.ankle_circuit, duration=3.0)
    stepping, ankles = walk_alone(plan, "stepping"), walk_alone(plan, "circuit")
    columns = [stepping.command_names.index(name) for name in ankles.command_names]
    np.testing.assert_allclose(stepping.commands[..., columns], ankles.commands, atol=1e-9)
    np.testing.assert_allclose(stepping.qpos, ankles.qpos, atol=1e-8)
    others = [i for i in range(len(stepping.command_names)) if i not in columns]
    assert not stepping.commands[..., others].any()


@pytest.mark.parametrize(("direction", "force_n"), [("inward", 31.0), ("outward", 13.5)])
def test_a_push_that_fells_the_ankles_alone_is_survived_with_a_step(direction, force_n):
    push = a_push(force=force_n, direction=direction, duration=0.2, step=2)
    plan = plan_of(load_controller("stepping").ankle_circuit, duration=6.5, disturbances=(push,))
    alone, stepping = walk_alone(plan, "circuit"), walk_alone(plan, "stepping")
    assert alone.ticks < plan.ticks, "it fell"
    assert stepping.ticks == plan.ticks, "it stands"
    side = stepping.trace_names.index("step_share_left" if direction == "outward" else "step_share_right")
    acting = np.flatnonzero(stepping.trace[:, 0, side])
    begin = stepping.effects.windows_s[0, 0] / 0.01
    assert begin < acting[0] < begin + 15
    assert stepping.commands[-1, 0, -4:] == pytest.approx(0.0, abs=0.02), "the feet came back"


def test_every_robot_of_a_batch_gets_the_bits_that_it_gets_alone():
    plan = plan_of(duration=2.2)
    specs = [RunSpec(seed, (a_push(force=force, step=1),)) for seed, force in ((3, 30.0), (4, 6.0))]
    both = walk_all(plan, "stepping", specs)
    assert both.commands[:, 0, -4:].any(), "the first one is pushed so hard that it steps"
    assert_same_bits(both, walk_all(plan, "stepping", specs[:1]), (0,))
    assert_same_bits(both, walk_all(plan, "stepping", specs[1:]), (1,))


def test_a_circuit_that_does_not_answer_cannot_decide(reference):
    with pytest.raises(InputError) as caught:
        load_controller("stepping", {"hand_over": "winner_take_all"}).bind(interface_of(reference))
    problem = caught.value.problems[0]
    assert problem.file.endswith("winner_take_all.yaml")
    assert problem.where == "outputs"
    wanted = "ankle_share, step_share_left, step_share_right"
    assert problem.message == f"missing {wanted}; required of a circuit that decides: {wanted}"
