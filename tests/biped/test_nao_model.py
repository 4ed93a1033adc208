"""The NAO's model against the published data, closed forms and its own mirror image."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from circuitkit.robots import load_robot

DATA = yaml.safe_load((Path(__file__).parent / "nao_v4_data.yaml").read_text(encoding="utf-8"))
MODEL_FILE = load_robot("nao").mjcf_path
LOOKS_GROUP, SOLE_GROUP = 2, 3
ARMATURE, DAMPING = 0.01, 0.1
MIRROR = np.diag([1.0, -1.0, 1.0])  # left and right, for points
AXIAL_MIRROR = np.diag([-1.0, 1.0, -1.0])  # the same for rotations
LEG_LINKS = ("LThigh", "LTibia", "LAnklePitch", "l_ankle")


def new_spec():
    return mujoco.MjSpec.from_string(MODEL_FILE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def model():
    return new_spec().compile()


def matrix(inertia):
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def rotation(quaternion):
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def set_joints(data, **angles):
    for name, angle in angles.items():
        data.joint(name).qpos = angle


def stand(data, knee=0.0):
    """Feet flat, the ankle under the hip, the arms hanging."""
    thigh, tibia = (np.abs(DATA["joints"][name]["origin"][2]) for name in ("LKneePitch", "LAnklePitch"))
    ankle = -math.atan2(thigh * math.sin(knee), tibia + thigh * math.cos(knee))
    for side in "LR":
        leg = {"HipPitch": -knee - ankle, "KneePitch": knee, "AnklePitch": ankle}
        set_joints(data, **{side + joint: angle for joint, angle in leg.items()})
        set_joints(data, **{side + "ShoulderPitch": math.pi / 2})


def com(model, data):
    mujoco.mj_forward(model, data)
    return data.body("torso").subtree_com.copy()


# --- the published data -------------------------------------------------------------------------------------


def test_data_file_holds_numbers():
    values = [
        value
        for entry in (*DATA["links"].values(), *DATA["joints"].values())
        for field in entry.values()
        for value in (field if isinstance(field, list) else [field])
    ]
    assert {type(value) for value in values} == {float, str}
    assert all(isinstance(value, float) or value.replace("_", "").isalpha() for value in values)


def test_total_mass(model):
    assert model.body("torso").subtreemass[0] == pytest.approx(DATA["total_mass"], abs=1e-6)


def test_no_link_and_no_joint_more_or_less(model):
    bodies = {model.body(i).name for i in range(1, model.nbody)}
    joints = {model.joint(i).name for i in range(model.njnt)}
    assert bodies == set(DATA["links"])
    assert joints == {"root", *DATA["joints"]}


@pytest.mark.parametrize("name", DATA["links"])
def test_link(model, name):
    link, body = DATA["links"][name], model.body(name)
    assert body.mass[0] == pytest.approx(link["mass"], rel=1e-12)
    np.testing.assert_allclose(body.ipos, link["com"], atol=1e-12)
    principal = np.linalg.eigvalsh(matrix(link["inertia"]))
    np.testing.assert_allclose(np.sort(body.inertia), principal, rtol=1e-6)
    axes = rotation(body.iquat)
    np.testing.assert_allclose(axes @ np.diag(body.inertia) @ axes.T, matrix(link["inertia"]), atol=1e-9)


@pytest.mark.parametrize("name", DATA["links"])
def test_inertia_is_that_of_a_body(model, name):
    small, middle, large = np.sort(model.body(name).inertia)
    assert small > 0.0
    assert small + middle > large


@pytest.mark.parametrize("name", DATA["joints"])
def test_joint(model, name):
    entry, joint = DATA["joints"][name], model.joint(name)
    child = model.body(joint.bodyid[0])
    assert joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE
    assert child.name == entry["child"]
    assert model.body(child.parentid[0]).name == entry["parent"]
    axis = np.array(entry["axis"])
    np.testing.assert_allclose(joint.axis, axis / np.linalg.norm(axis), atol=1e-9)
    np.testing.assert_allclose(child.pos, entry["origin"], atol=1e-12)
    np.testing.assert_array_equal(child.quat, [1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(joint.pos, 0.0)
    np.testing.assert_allclose(joint.range, entry["range"], atol=1e-12)
    assert joint.limited[0]
    assert (joint.armature[0], joint.damping[0]) == (ARMATURE, DAMPING)


def test_trunk_floats_freely(model):
    root = model.joint("root")
    assert root.type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert model.body(root.bodyid[0]).name == "torso"
    assert not np.any(root.armature)
    assert not np.any(root.damping)


def test_hip_yaw_pitch_joints_are_one_motor(model):
    data = mujoco.MjData(model)
    assert model.neq == 1
    for right, difference in ((-0.1, 0.4), (0.3, 0.0)):
        set_joints(data, LHipYawPitch=0.3, RHipYawPitch=right)
        mujoco.mj_forward(model, data)
        residual = data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
        np.testing.assert_allclose(np.abs(residual), [difference], atol=1e-12)


def test_servos_and_sensors_are_left_to_the_robot_file(model):
    assert (model.nu, model.nsensor, model.nkey) == (0, 0, 0)
    assert model.body("world").geomnum[0] == 1
    assert model.site("imu").bodyid[0] == model.body("torso").id


def test_solver_settings(model):
    option = model.opt
    assert (option.timestep, option.impratio) == (0.002, 10.0)
    assert option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert option.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC


# --- posture and dynamics -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("knee_deg", "height"), DATA["com_height_over_knee_deg"].items())
def test_com_height(model, knee_deg, height):
    data = mujoco.MjData(model)
    stand(data, math.radians(knee_deg))
    ground = com(model, data)[2] - data.body("l_ankle").xpos[2] + DATA["foot_height"]
    assert ground == pytest.approx(height, abs=1e-3)


def test_soles_touch_the_ground_in_the_zero_pose(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name in ("l_sole", "r_sole"):
        assert data.geom(name).xpos[2] - model.geom(name).size[2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("roll_deg", [-15.0, 5.0, 15.0])
def test_com_shift_by_ankle_roll(model, roll_deg):
    """Ankles and hips roll against each other: feet flat, trunk upright."""
    data = mujoco.MjData(model)
    stand(data)
    roll = math.radians(roll_deg)
    set_joints(data, LAnkleRoll=roll, RAnkleRoll=roll, LHipRoll=-roll, RHipRoll=-roll)
    sideways = com(model, data)[1] - (data.body("l_ankle").xpos[1] + data.body("r_ankle").xpos[1]) / 2
    assert sideways / math.sin(roll) == pytest.approx(DATA["com_shift_per_sin_ankle_roll"], rel=0.03)


def test_leg_swing_has_the_energy_of_the_parallel_axis_theorem(model):
    """T = ½ ω² Σ (I_yy + m (x² + z²)) over the links below the hip pitch, plus the armature."""
    data = mujoco.MjData(model)
    rate = 1.7
    knee, ankle = (np.array(DATA["joints"][name]["origin"]) for name in ("LKneePitch", "LAnklePitch"))
    origins = dict(zip(LEG_LINKS, (0.0 * knee, knee, knee + ankle, knee + ankle), strict=True))
    about_hip = ARMATURE
    for name, origin in origins.items():
        link = DATA["links"][name]
        x, _, z = origin + link["com"]
        about_hip += link["inertia"][1] + link["mass"] * (x**2 + z**2)
    data.joint("LHipPitch").qvel = rate
    mujoco.mj_forward(model, data)
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    assert data.qvel @ momentum / 2 == pytest.approx(rate**2 * about_hip / 2, rel=1e-9)


def standing_on_floor():
    """A model with stiff servos, standing 5 mm above its floor with bent knees."""
    spec = new_spec()
    for name in DATA["joints"]:
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=300.0, kv=3.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    stand(data, math.radians(33.0))
    mujoco.mj_forward(model, data)
    data.qpos[2] += DATA["foot_height"] + 0.005 - data.body("l_ankle").xpos[2]
    for name in DATA["joints"]:
        data.actuator(name).ctrl = data.joint(name).qpos[0]
    return model, data


def test_dropped_robot_comes_to_rest_on_its_soles():
    model, data = standing_on_floor()
    mujoco.mj_step(model, data, nstep=1000)
    soles = {model.geom(name).id for name in ("l_sole", "r_sole")}
    upward, wrench = 0.0, np.zeros(6)
    for index, contact in enumerate(data.contact[: data.ncon]):
        assert set(contact.geom) - {model.geom("floor").id} <= soles
        assert contact.dist > -1e-3
        mujoco.mj_contactForce(model, data, index, wrench)
        upward += wrench[0]
    assert upward == pytest.approx(DATA["total_mass"] * 9.81, rel=0.01)
    assert np.abs(data.qvel).max() < 1e-2
    assert data.body("torso").xmat[8] > math.cos(math.radians(5.0))


# --- left and right -----------------------------------------------------------------------------------------


def partner(name):
    """The name on the other side: LThigh and RThigh, l_ankle and r_ankle; trunk and head are their own."""
    if name.startswith(("torso", "Neck", "Head")):
        return name
    return {"L": "R", "R": "L", "l": "r", "r": "l"}[name[0]] + name[1:]


def mirror_velocities(model):
    """The matrix P that turns generalised velocities into those of the mirror image; P is its own inverse."""
    p = np.zeros((model.nv, model.nv))
    p[:3, :3], p[3:6, 3:6] = MIRROR, AXIAL_MIRROR
    for name in DATA["joints"]:
        joint, other = model.joint(name), model.joint(partner(name))
        p[joint.dofadr[0], other.dofadr[0]] = joint.axis @ AXIAL_MIRROR @ other.axis
    return p


def mirrored_poses(model, rng):
    """A random pose within the limits and its mirror image."""
    data = mujoco.MjData(model)
    low, high = np.array([model.joint(name).range for name in DATA["joints"]]).T
    set_joints(data, **dict(zip(DATA["joints"], rng.uniform(low, high), strict=True)))
    p = mirror_velocities(model)
    image = mujoco.MjData(model)
    image.qpos[7:] = p[6:, 6:] @ data.qpos[7:]
    for pose in (data, image):
        mujoco.mj_forward(model, pose)
    return data, image, p


def test_joint_axes_are_mirrored(model):
    p = mirror_velocities(model)
    np.testing.assert_allclose(p @ p, np.eye(model.nv), atol=1e-12)


def test_mirrored_pose_has_the_mirrored_com(model):
    """Masses and centres of mass are published as exact mirror images, so rounding alone may differ."""
    for seed in range(20):
        data, image, _ = mirrored_poses(model, np.random.default_rng(seed))
        np.testing.assert_allclose(com(model, image), MIRROR @ com(model, data), atol=1e-12)


def test_mirrored_pose_has_nearly_the_mirrored_inertia(model):
    """The published inertias differ between left and right; a mass matrix may by no more than all of them.

    An entry of it holds aᵀ I b of each link at most, with unit axes a and b: |ΔM| ≤ Σ ‖ΔI‖ over the links.
    """
    inertia = {name: matrix(link["inertia"]) for name, link in DATA["links"].items()}
    differences = [inertia[name] - MIRROR @ inertia[partner(name)] @ MIRROR for name in inertia]
    allowed = sum(np.linalg.norm(difference, 2) for difference in differences)
    assert allowed < 3e-4  # next to 0.024 kg m², the least moment of the whole robot standing
    for seed in range(5):
        data, image, p = mirrored_poses(model, np.random.default_rng(seed))
        mass, mirrored = np.zeros((2, model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        mujoco.mj_fullM(model, image, mirrored)
        np.testing.assert_allclose(p @ mirrored @ p.T, mass, atol=allowed)


# --- looks --------------------------------------------------------------------------------------------------


def shape(model, geom):
    """Where and how a geom is: centre and second moments in its body's frame, from vertices or from sizes."""
    turn = rotation(geom.quat)
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(geom.dataid[0])
        start = mesh.vertadr[0]
        points = model.mesh_vert[start : start + mesh.vertnum[0]] @ turn.T + geom.pos
        return np.concatenate([points.mean(axis=0), np.cov(points.T).ravel()])
    axes = {mujoco.mjtGeom.mjGEOM_SPHERE: [0, 0, 0], mujoco.mjtGeom.mjGEOM_BOX: [0, 1, 2]}
    axes |= {mujoco.mjtGeom.mjGEOM_ELLIPSOID: [0, 1, 2]}
    size = geom.size[axes.get(geom.type[0], [0, 0, 1])]  # capsules and cylinders: radius, half length
    return np.concatenate([geom.pos, (turn @ np.diag(size**2) @ turn.T).ravel()])


def shapes_of(model, body_name):
    body = model.body(body_name)
    geoms = [model.geom(body.geomadr[0] + i) for i in range(body.geomnum[0])]
    return [(int(geom.type[0]), int(geom.matid[0]), shape(model, geom)) for geom in geoms]


def mirror_shape(values):
    return np.concatenate([MIRROR @ values[:3], (MIRROR @ values[3:].reshape(3, 3) @ MIRROR).ravel()])


@pytest.mark.parametrize("name", DATA["links"])
def test_looks_are_mirrored(model, name):
    others = shapes_of(model, partner(name))
    for kind, material, values in shapes_of(model, name):
        image = mirror_shape(values)
        alike = [i for i, other in enumerate(others) if other[:2] == (kind, material)]
        assert alike
        closest = min(alike, key=lambda i: np.abs(others[i][2] - image).max())
        np.testing.assert_allclose(others.pop(closest)[2], image, atol=1e-7)
    assert others == []


def test_only_the_soles_touch(model):
    touching = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    assert {model.geom(i).name for i in touching} == {"floor", "l_sole", "r_sole"}
    soles = [model.geom(name).id for name in ("l_sole", "r_sole")]
    assert set(model.geom_group[soles]) == {SOLE_GROUP}
    assert set(np.delete(model.geom_group, [*soles, model.geom("floor").id])) == {LOOKS_GROUP}


def test_looks_weigh_nothing():
    """Were a shape not massless, taking inertias from the shapes would give it mass."""
    spec = new_spec()
    masses = {geom.mass for geom in spec.geoms if geom.group == LOOKS_GROUP}
    assert masses == {0.0}


@pytest.mark.parametrize(("name", "sign"), [("l_sole", 1), ("r_sole", -1)])
def test_sole_box_has_the_published_extent(model, name, sign):
    geom, extent = model.geom(name), DATA["sole_extent"]
    y = sorted(sign * value for value in extent["y"])
    for axis, expected in ((0, extent["x"]), (1, y)):
        np.testing.assert_allclose(geom.pos[axis] + geom.size[axis] * np.array([-1, 1]), expected, atol=1e-9)
    assert geom.pos[2] - geom.size[2] == pytest.approx(-DATA["foot_height"], abs=1e-12)
    assert (geom.friction[0], geom.condim[0]) == (1.0, 3)


@pytest.mark.parametrize(("name", "sign"), [("l_sole", 1), ("r_sole", -1)])
def test_visible_sole_has_the_published_outline(model, name, sign):
    mesh = model.mesh(name)
    vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
    geom = model.geom(next(i for i in range(model.ngeom) if model.geom_dataid[i] == mesh.id))
    points = 1e3 * (vertices @ rotation(geom.quat).T + geom.pos)
    outline = np.array(DATA["sole_outline_left_mm"]) * [1, sign]
    bottom = points[points[:, 2] < -1e3 * DATA["foot_height"] + 1e-3]
    assert len(bottom) == len(outline)
    distances = np.linalg.norm(bottom[:, None, :2] - outline[None], axis=2)
    np.testing.assert_allclose(distances.min(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(distances.min(axis=1), 0.0, atol=1e-3)


def test_physics_is_the_same_without_the_looks():
    plain = new_spec()
    plain.compiler.discardvisual = True
    states = []
    for spec in (new_spec(), plain):
        model = spec.compile()
        data = mujoco.MjData(model)
        data.qvel[:] = np.random.default_rng(1).normal(size=model.nv)
        mujoco.mj_step(model, data, nstep=200)
        states.append((model.ngeom, np.concatenate([data.qpos, data.qvel])))
    (_, with_looks), (geoms, without) = states
    assert geoms == 3
    np.testing.assert_array_equal(with_looks, without)
