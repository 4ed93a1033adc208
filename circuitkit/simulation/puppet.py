"""The robot of a recording with all its looks, set into its recorded poses; and the arrow of a push."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.robots import RobotModel
from circuitkit.simulation.story import PushSpan

if TYPE_CHECKING:
    from circuitkit.simulation.recording import Recording

Array = NDArray[np.float64]

LIGHT = np.array([-0.08, 0.5, -1.0])  # where the light goes
ARROW_RGBA = np.array([0.86, 0.09, 0.07, 1.0], dtype=np.float32)

_FOLLOW_S = 1.0  # the camera goes where the robot is on average over so long
_ARROW_M_PER_N = 0.011
_SHAFT_M, _HEAD_WIDTH_M, _HEAD_M, _RINGS = 0.011, 0.03, 0.06, 14
_FAR_M = 2.0
_SUNK_M = 0.01
_BIG = 0.25  # a part with this share of the largest one's volume is no arm and no leg


def film_model(robot: RobotModel, width: int = 640, height: int = 480) -> mujoco.MjModel:
    """The robot's MJCF with all its looks, on a checkered floor with squares of 10 cm.

    Args:
        robot: The robot.
        width: Of the largest picture, [pixels].
        height: Of the largest picture, [pixels].
    """
    spec = mujoco.MjSpec.from_file(str(robot.spec.mjcf_path))
    _add_sky(spec)
    _add_floor(spec)
    kind = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_light(type=kind, dir=LIGHT, castshadow=False, diffuse=[0.62] * 3)
    visual, head = spec.visual, spec.visual.headlight
    head.ambient, head.diffuse, head.specular = [0.5] * 3, [0.35] * 3, [0.1] * 3
    visual.global_.offwidth, visual.global_.offheight = width, height
    visual.quality.offsamples, visual.quality.numslices, visual.quality.numstacks = 0, 20, 12
    visual.map.znear = 0.02
    return spec.compile()


def _add_sky(spec: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
    spec.add_texture(
        name="stage_sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=128, height=768,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, rgb1=[0.62, 0.74, 0.87], rgb2=[0.94, 0.96, 0.98],
    )  # fmt: skip


def _add_floor(spec: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
    spec.add_texture(
        name="stage_floor", type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER, rgb1=[0.86, 0.87, 0.88], rgb2=[0.74, 0.76, 0.78],
    )  # fmt: skip
    material = spec.add_material(
        name="stage_floor", texrepeat=[5, 5], texuniform=True, specular=0, shininess=0, emission=0.25
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "stage_floor"
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], material="stage_floor", contype=0, conaffinity=0
    )


class Puppet:
    """One robot of a recording.

    Attributes:
        model: Its looks.
        data: Its pose.
        centre_m: Where it is by and large, forward and left, for a camera to follow; shape (T, 2).
    """

    def __init__(self, recording: Recording, robot: int = 0, width: int = 640, height: int = 480) -> None:
        """Make the puppet; it can be drawn in pictures of up to a size, [pixels]."""
        recorded = recording.robot.model
        self.model = film_model(recording.robot, width, height)
        self.data = mujoco.MjData(self.model)
        self._qpos = recording.qpos[:, robot]
        self._bodies = [self.model.body(recorded.body(i).name).id for i in range(recorded.nbody)]
        self._feet = [self._bodies[foot] for foot in recording.robot.feet_id]
        self.centre_m = _followed(self._qpos[:, :2], round(_FOLLOW_S / recording.walk.gait.control_step))

    def stand(self, tick: int) -> None:
        """Take the pose after a tick."""
        self.data.qpos[:] = self._qpos[tick]
        mujoco.mj_kinematics(self.model, self.data)

    def last_above_ground(self, tick: int) -> int:
        """The last tick, from a given one on, before the torso or the head is in the ground.

        Only the soles touch the ground, so that a robot that has fallen sinks in.
        """
        model = self.model
        volume = np.prod(model.geom_aabb[:, 3:], axis=1)
        mine = (model.geom_bodyid > 0) & ~np.isin(model.geom_bodyid, self._feet)
        big = np.flatnonzero(mine & (volume >= _BIG * volume[mine].max()))
        box = model.geom_aabb[big]
        for later in range(tick, len(self._qpos)):
            self.stand(later)
            upward = self.data.geom_xmat[big].reshape(-1, 3, 3)[:, 2]
            middle = self.data.geom_xpos[big, 2] + np.einsum("ij,ij->i", upward, box[:, :3])
            if (middle - np.einsum("ij,ij->i", np.abs(upward), box[:, 3:])).min() < -_SUNK_M:
                return max(later - 1, 0)
        return len(self._qpos) - 1

    def arrow(self, push: PushSpan) -> tuple[Array, Array]:
        """Tail and tip of a push's arrow: it points at its body's centre of mass and ends on the surface."""
        direction = push.force / push.size_n
        start = self.data.xipos[self._bodies[push.body]] - _FAR_M * direction
        hit = np.zeros(1, dtype=np.int32)
        away = mujoco.mj_ray(self.model, self.data, start, direction, None, 0, -1, hit)
        tip: Array = start + (away if 0 <= away <= _FAR_M else _FAR_M) * direction
        return tip - push.size_n * _ARROW_M_PER_N * direction, tip


def add_arrow(scene: mujoco.MjvScene, tail: Array, tip: Array) -> None:
    """Add an arrow to a scene.

    Of cylinders, for MuJoCo 4.0 draws its own arrows half as long as they are.
    """
    direction = (tip - tail) / np.linalg.norm(tip - tail)
    neck = tip - _HEAD_M * direction
    if np.dot(neck - tail, direction) > 0:
        _add_cylinder(scene, tail, neck, _SHAFT_M)
    for ring in range(_RINGS):
        begin, end = (neck + _HEAD_M * (ring + more) / _RINGS * direction for more in (0, 1))
        _add_cylinder(scene, begin, end, _HEAD_WIDTH_M * (1 - (ring + 0.5) / _RINGS))


def _add_cylinder(scene: mujoco.MjvScene, begin: Array, end: Array, radius_m: float) -> None:
    part, kind = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_CYLINDER
    mujoco.mjv_initGeom(part, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), ARROW_RGBA)
    mujoco.mjv_connector(part, kind, radius_m, begin, end)
    part.emission = 0.4
    scene.ngeom += 1


def _followed(path: Array, window: int) -> Array:
    """The mean over a window of ticks around each tick; shape (T, 2)."""
    half = max(window // 2, 1)
    padded = np.concatenate([np.repeat(path[:1], half, axis=0), path, np.repeat(path[-1:], half, axis=0)])
    total = np.cumsum(np.concatenate([np.zeros((1, path.shape[1])), padded]), axis=0)
    mean: Array = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    return mean
