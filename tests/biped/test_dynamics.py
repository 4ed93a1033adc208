"""The dynamics along a walk against momentum balances and virtual work, worked out another way."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np
import pytest
from scipy.linalg import null_space
from walking import bare_nao, nao_body

from circuitkit.biped.dynamics import BodyDynamics, generalised_positions
from circuitkit.biped.gait import load_gait, plan_walk

DT = 0.01


@pytest.fixture(scope="module", params=["gait_march", "gait_walk_4cm"])
def walk(request):
    """Three steps, as for a point mass: the whole body's ZMP is then another one."""
    return plan_walk(load_gait(request.param), nao_body().block.legs.geometry(), 270)[0]


def momentum_balance(positions):
    """ZMP from CoM and angular momentum by finite differences; shape (T - 2, 2).

    With forces only from the ground: m (c'' + g) is their sum and L' their moment about the CoM c, so
    x = c_x - c_z c_x'' / (g + c_z'') - L_y' / (m (g + c_z'')) and y likewise with + L_x'.
    """
    model, data = bare_nao(), mujoco.MjData(bare_nao())
    mass = model.body("torso").subtreemass[0]
    coms, momenta = [], []
    for now, then in pairwise(positions):
        velocity = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, velocity, DT, now, then)
        data.qpos[:] = now
        mujoco.mj_integratePos(model, data.qpos, velocity, DT / 2)
        data.qvel[:] = velocity
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        momenta.append(data.subtree_angmom[1].copy())
        data.qpos[:] = now
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        coms.append(data.subtree_com[1].copy())
    com, turn = np.array(coms), np.diff(momenta, axis=0) / DT
    acceleration = (com[2:] - 2 * com[1:-1] + com[:-2]) / DT**2
    com, turn, up = com[1:-1], turn[:-1], 9.81 + acceleration[:, 2]
    turned = np.column_stack([-turn[:, 1], turn[:, 0]])
    return com[:, :2] + (turned / mass - com[:, 2:] * acceleration[:, :2]) / up[:, None]


def test_the_zmp_is_that_of_the_momentum_balance(walk):
    robot = nao_body()
    expected = momentum_balance(generalised_positions(robot, walk))
    found = BodyDynamics(robot).zmp(walk)[1:-2]
    difference = np.abs(found - expected)
    assert np.percentile(difference, 99) < 1e-3
    assert np.median(difference) < 1e-4


def test_at_rest_the_zmp_is_under_the_centre_of_mass(walk):
    robot = nao_body()
    model, data = bare_nao(), mujoco.MjData(bare_nao())
    data.qpos[:] = generalised_positions(robot, walk)[5]
    mujoco.mj_forward(model, data)
    zmp = BodyDynamics(robot).zmp(walk)[5]
    np.testing.assert_allclose(zmp, data.body("torso").subtree_com[:2], atol=2e-4)


def generalised_forces(walk):
    """M q'' + bias - passive along the walk, by MuJoCo's forward quantities; and the foot Jacobians."""
    robot = nao_body()
    positions = generalised_positions(robot, walk)
    model, data = bare_nao(), mujoco.MjData(bare_nao())
    rates = np.zeros((walk.ticks, model.nv))
    for t in range(walk.ticks - 1):
        mujoco.mj_differentiatePos(model, rates[t], DT, positions[t], positions[t + 1])
    for t in range(1, walk.ticks - 1):
        data.qpos[:] = positions[t]
        data.qvel[:] = (rates[t] + rates[t - 1]) / 2
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        force = inertia @ (rates[t] - rates[t - 1]) / DT + data.qfrc_bias - data.qfrc_passive
        jacobians = []
        for name in ("l_ankle", "r_ankle"):
            jacobian = np.zeros((6, model.nv))
            mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], data.body(name).id)
            jacobians.append(jacobian)
        yield t, force, jacobians


def test_torques_do_the_virtual_work_of_the_motion(walk):
    """In any small motion that leaves the feet on the ground, its forces do no work: the servos do it all."""
    robot = nao_body()
    torques = BodyDynamics(robot).torques(walk)
    checked = 0
    for t, force, jacobians in generalised_forces(walk):
        share = walk.schedule.left_load[t]
        feet = [j for j, part in zip(jacobians, (share, 1 - share), strict=True) if part > 0]
        free = null_space(np.concatenate(feet))
        missing = torques[t] @ free[robot.dof_index] - force @ free
        np.testing.assert_allclose(missing, 0.0, atol=2e-3)
        checked += free.shape[1]
    assert checked > 18 * 260


def test_the_support_leg_carries_and_the_swing_leg_only_itself(walk):
    robot = nao_body()
    torques = np.abs(BodyDynamics(robot).torques(walk))[:, robot.leg_servo]
    for step in (0, 1):
        single = (walk.schedule.step == step) & (walk.schedule.single_support > 0)
        left, right = torques[single, :5].sum(), torques[single, 5:].sum()
        carrying, swinging = (left, right) if step == 0 else (right, left)
        assert carrying > 3 * swinging


def test_positions_are_the_walk_in_the_robots_order(walk):
    robot = nao_body()
    positions = generalised_positions(robot, walk)
    targets = positions[:, robot.qpos_index]
    np.testing.assert_array_equal(targets[:, robot.leg_servo], walk.joints_rad)
    np.testing.assert_allclose(positions[:, 2] - walk.pelvis_m[:, 2], 0.085)
    np.testing.assert_array_equal(positions[:, 3:7], [[1, 0, 0, 0]] * walk.ticks)
    arms = list(robot.servos).index(robot.model.actuator("LShoulderPitch").id)
    np.testing.assert_allclose(targets[:, arms], np.pi / 2)
