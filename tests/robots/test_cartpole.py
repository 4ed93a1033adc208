"""Cart and pole: two neurons against nobody and against a PD controller of the same gains."""

from __future__ import annotations

import numpy as np
import pytest
from seeds import changed, disturbances_of, measured, run_seeds

from circuitkit import check, compile_circuit, load_circuit
from circuitkit.engine import run
from circuitkit.simulation.disturbances.push import Push

GAINS = np.array([2.0, 3.0, 35.0, 9.0])  # [N/m], [N s/m], [N/rad], [N s/rad]: those of the circuit around 0
MOTOR_N = 10.0
AFTER_TWO_PUSHES_S = 25.0


class PD:
    """The circuit's gains without neurons; cut off where the motor is."""

    name = "pd"
    observations = ("cart", "cart_speed", "pole", "pole_speed")
    commands = ("force",)

    def reset(self, batch):
        """Keep nothing."""

    def step(self, observation):
        return np.clip(observation @ GAINS[:, None], -MOTOR_N, MOTOR_N)


def _harder(factor):
    """The scenario with stronger pushes of the pole."""
    changes = [
        d.model_copy(update={"force": factor * d.force}) if isinstance(d, Push) and d.body == "pole" else d
        for d in disturbances_of("cartpole_balances")
    ]
    return changed("cartpole_balances", changes, duration=AFTER_TWO_PUSHES_S)


def test_the_circuit_has_no_errors_and_no_warnings():
    assert check("cartpole_balance") == ((), ())


def test_the_pair_of_neurons_is_a_saturating_pd():
    """sigmoid(a) - sigmoid(-a) = tanh(a / 2)."""
    program = compile_circuit(load_circuit("cartpole_balance"))
    inputs = np.random.default_rng(0).normal(size=(1, 50, 4)) * [0.5, 0.5, 0.1, 0.5]
    expected = MOTOR_N * np.tanh(inputs @ GAINS / MOTOR_N)
    np.testing.assert_allclose(run(program, inputs).readout[..., 0], expected, atol=1e-12)


@pytest.fixture(scope="module")
def balanced():
    return run_seeds("cartpole_balances")


def test_all_of_twenty_balance_for_a_minute(balanced):
    assert measured(balanced, "survived").sum() == 20
    assert balanced.time_s[-1] == pytest.approx(60.0)
    assert (measured(balanced, "furthest") < 1.3).all()
    assert (np.degrees(measured(balanced, "largest_lean")) < 12).all()


def test_nobody_balances_without_it():
    found = run_seeds("cartpole_balances", controller="open_loop")
    assert not measured(found, "survived").any()
    assert max(found.ended_s(robot) for robot in range(20)) < 5


def test_a_pd_of_the_same_gains_is_hardly_better(balanced):
    """Its force is cut off, that of the neurons saturates early: the cart goes a tenth further."""
    with_pd = run_seeds(changed("cartpole_balances", duration=AFTER_TWO_PUSHES_S), controller=PD())
    assert measured(with_pd, "survived").all()
    neurons, pd = (
        np.abs(found.channel("cart")[: with_pd.ticks]).max(axis=0) for found in (balanced, with_pd)
    )
    ratio = neurons.mean() / pd.mean()
    assert ratio == pytest.approx(1.09, abs=0.04)


@pytest.mark.parametrize("controller", [None, PD()], ids=["neurons", "pd"])
@pytest.mark.parametrize(("factor", "survive"), [(1.6, True), (1.8, False)])
def test_both_fail_at_the_same_pushes(controller, factor, survive):
    found = run_seeds(_harder(factor), range(5), controller)
    assert (measured(found, "survived") == survive).all()
