"""The robot of a recording in its recorded poses, as a camera sees it, with pushes as arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from circuitkit.control import Array
from circuitkit.robots import RobotModel
from circuitkit.robots.mjcf import compile_mjcf, read_mjcf
from circuitkit.simulation.recording import Recording
from circuitkit.simulation.renderer import Screen
from circuitkit.simulation.result import PushSpan

if TYPE_CHECKING:
    from PIL import Image

LIGHT = np.array([-0.08, 0.5, -1.0])  # where the light goes
ARROW_RGBA = np.array([0.86, 0.09, 0.07, 1.0], dtype=np.float32)
FILM_CAMERA = "film"  # a camera of this name in the MJCF is the one that films, else its first one

_OWN_LIGHT = "circuitkit light"  # shines where the MJCF has no lights
_SLICES, _STACKS = 20, 12  # of round parts
_SHADOW_PIXELS = 2048  # of the MJCF's own lights, at most

# Presses what is above the ground flat along the light; not wholly, for a surface needs a normal.
_FLAT = np.array([[1.0, 0.0, -LIGHT[0] / LIGHT[2]], [0.0, 1.0, -LIGHT[1] / LIGHT[2]], [0.0, 0.0, 1e-3]])
_SHADOW_RGBA = np.array([0.47, 0.49, 0.52, 1.0], dtype=np.float32)
_SHADOW_SIZES = 0.0025  # how far above the ground, in sizes of the robot
_CASTS_SIZES = 0.03  # from this radius on a part casts a shadow, in sizes of the robot
_LEVEL = 0.999  # cosine between the normal of a level plane and the vertical

_FOLLOW_S = 1.0  # a following camera goes where the robot is on average over so long
_FINENESS = 2  # drawn so much larger and then reduced: smoother and faster than the renderer's own smoothing
_AZIMUTH_DEG, _ELEVATION_DEG = 148.0, -12.0  # from the robot's front right
_SIZES_AWAY = 1.75  # the camera is so many sizes of the robot away
_ARROW_SIZES = 0.45  # a push's arrow, in sizes of the robot
_ARROW_SHARE = 0.25  # and at most so much of the height of the picture
_FAR_SIZES = 6.0
_SUNK = 0.15  # of the height at the start: lower than this the robot is not shown any more


def film_model(robot: RobotModel, width: int = 640, height: int = 480) -> mujoco.MjModel:
    """The robot's MJCF with all its looks; sky, light and a checkered ground where it has none of its own.

    Args:
        robot: The robot.
        width: Of the largest picture, [pixels].
        height: Of the largest picture, [pixels].
    """
    spec = read_mjcf(robot.robot.mjcf_path)
    if not any(texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX for texture in spec.textures):
        _add_sky(spec)
    planes = [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE and not geom.material]
    if planes:
        _add_checks(spec)
        for plane in planes:
            plane.material = "circuitkit ground"
            plane.rgba = [1.0, 1.0, 1.0, 1.0]
    if not len(spec.lights):
        kind = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        spec.worldbody.add_light(name=_OWN_LIGHT, type=kind, dir=LIGHT, castshadow=False, diffuse=[0.62] * 3)
        head = spec.visual.headlight
        head.ambient, head.diffuse, head.specular = [0.5] * 3, [0.35] * 3, [0.1] * 3
    visual = spec.visual
    visual.global_.offwidth, visual.global_.offheight = width, height
    quality = visual.quality
    quality.offsamples, quality.numslices, quality.numstacks = 0, _SLICES, _STACKS
    quality.shadowsize = min(quality.shadowsize, _SHADOW_PIXELS)
    for key in spec.keys:
        key.ctrl = []
    return compile_mjcf(spec, robot.robot.mjcf_path)


def _add_sky(spec: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
    spec.add_texture(
        name="circuitkit sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=128, height=768,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, rgb1=[0.62, 0.74, 0.87], rgb2=[0.94, 0.96, 0.98],
    )  # fmt: skip


def _add_checks(spec: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
    spec.add_texture(
        name="circuitkit ground", type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER, rgb1=[0.86, 0.87, 0.88], rgb2=[0.74, 0.76, 0.78],
    )  # fmt: skip
    material = spec.add_material(
        name="circuitkit ground", texrepeat=[5, 5], texuniform=True, specular=0, shininess=0, emission=0.05
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "circuitkit ground"


class ReplayModel:
    """One robot of a recording, which can be put into its poses.

    Attributes:
        model: Its looks.
        data: Its pose.
        centre_m: Where it is by and large, for a camera to follow; shape (T, 3).
        size_m: How large it is.
        arrow_m: How long the arrow of a push is.
        fixed_camera: Number of the MJCF's camera that films; -1 if one follows.
    """

    def __init__(self, recording: Recording, robot: int = 0, width: int = 640, height: int = 480) -> None:
        """Make it; it can be drawn in pictures of up to a size, [pixels]."""
        recorded = recording.robot.model
        self.model = film_model(recording.robot, width, height)
        self.data = mujoco.MjData(self.model)
        self._qpos = _poses(recording, robot)
        self._bodies = [
            self.model.body(recorded.body(i).name).id if recorded.body(i).name else i
            for i in range(recorded.nbody)
        ]
        self.fixed_camera = _film_camera(self.model)
        base = recording.robot.base
        self._body = int(recorded.jnt_bodyid[base]) if base is not None else _heaviest(recorded)
        self.stand(0)
        self.size_m = _size(self.model, self.data, self._body)
        path = self._path()
        self.centre_m = _followed(path, round(_FOLLOW_S / recording.step_s))
        self._height = path[:, 2] - _ground(recorded)
        self.arrow_m = self._arrow_length()

    def stand(self, tick: int) -> None:
        """Take the pose after a tick."""
        self.data.qpos[:] = self._qpos[tick]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)  # which cameras follow
        mujoco.mj_camlight(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        mujoco.mj_tendon(self.model, self.data)

    def last_above_ground(self, tick: int) -> int:
        """The last tick, from a given one on, before the robot sinks into the ground.

        Parts that touch nothing sink.
        """
        sunk = self._height[tick:] < _SUNK * self._height[0]
        return tick + int(sunk.argmax()) - 1 if sunk.any() else len(self._qpos) - 1

    def _path(self) -> Array:
        path = np.empty((len(self._qpos), 3))
        for tick in range(len(path)):
            self.data.qpos[:] = self._qpos[tick]
            mujoco.mj_kinematics(self.model, self.data)
            path[tick] = self.data.xipos[self._body]
        return path

    def arrow(self, push: PushSpan) -> tuple[Array, Array]:
        """Tail and tip of a push's arrow: it points at where the push acts and ends on the surface."""
        direction = push.force / push.size_n
        far = _FAR_SIZES * self.size_m
        body = self._bodies[push.body]
        point = self.data.xmat[body].reshape(3, 3) @ push.point_m if push.turns else push.point_m
        start = self.data.xipos[body] + point - far * direction
        hit = np.zeros(1, dtype=np.int32)
        away = mujoco.mj_ray(self.model, self.data, start, direction, None, 0, -1, hit)
        tip: Array = start + (away if 0 <= away <= far else far) * direction
        return tip - self.arrow_m * direction, tip

    def _arrow_length(self) -> float:
        """As it suits the robot's size, and what the MJCF's camera sees of its surroundings."""
        if self.fixed_camera < 0:
            return _ARROW_SIZES * self.size_m
        half_angle = np.radians(self.model.cam_fovy[self.fixed_camera]) / 2
        away = np.linalg.norm(self.data.cam_xpos[self.fixed_camera] - self.data.xipos[self._body])
        return float(min(_ARROW_SIZES * self.size_m, _ARROW_SHARE * 2 * away * np.tan(half_angle)))


def _poses(recording: Recording, robot: int) -> Array:
    """Positions by tick; from where the run became invalid on, those before: what came is no pose."""
    poses: Array = recording.qpos[:, robot]
    if recording.invalid[robot] is None and np.isfinite(poses).all():
        return poses
    found, last = poses.copy(), recording.motion.start_qpos
    end = recording.ticks if recording.invalid[robot] is None else int(recording.end_tick[robot])
    for tick in range(len(found)):
        last = poses[tick] if tick < end and np.isfinite(poses[tick]).all() else last
        found[tick] = last
    return found


def _ground(model: mujoco.MjModel) -> float:
    """Height of the highest level ground; far below if there is none."""
    kinds = np.array([mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD], dtype=int)
    level = np.isin(model.geom_type, kinds) & (model.body_weldid[model.geom_bodyid] == 0)
    return float(model.geom_pos[level, 2].max(initial=-np.inf))


def _film_camera(model: mujoco.MjModel) -> int:
    """The camera that is made for films, else the first one that looks at the robot, not out of its eyes."""
    names = [model.camera(i).name for i in range(model.ncam)]
    if FILM_CAMERA in names:
        return names.index(FILM_CAMERA)
    fixed = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
    outside = (model.cam_mode != fixed) | (model.body_weldid[model.cam_bodyid] == 0)
    return int(np.argmax(outside)) if outside.any() else -1


def _heaviest(model: mujoco.MjModel) -> int:
    """Without a free base: the child of the world that carries most."""
    bodies = [i for i in range(1, model.nbody) if int(model.body_parentid[i]) == 0]
    return max(bodies, key=lambda i: float(model.body_subtreemass[i]), default=0)


def _size(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    """How far the parts of a body and what it carries reach from its centre, twice."""
    geoms = [
        g
        for g in range(model.ngeom)
        if int(model.body_rootid[model.geom_bodyid[g]]) == int(model.body_rootid[body])
    ]
    moving = [g for g in geoms if int(model.geom_bodyid[g]) > 0] or geoms
    if not moving:
        return 1.0
    away = np.linalg.norm(data.geom_xpos[moving] - data.xipos[body], axis=1) + model.geom_rbound[moving]
    return float(2 * away.max())


def place_camera(camera: mujoco.MjvCamera, replay: ReplayModel, tick: int) -> None:
    """Use the MJCF's own camera, or look from the front right, so that pushes go across the picture."""
    if replay.fixed_camera >= 0:
        camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        camera.fixedcamid = replay.fixed_camera
        return
    camera.azimuth, camera.elevation = _AZIMUTH_DEG, _ELEVATION_DEG
    camera.distance = _SIZES_AWAY * replay.size_m
    camera.lookat[:] = replay.centre_m[tick]


def _level_ground(model: mujoco.MjModel, data: mujoco.MjData) -> float | None:
    """Height of the highest level plane, for shadows of our own light; None if the MJCF has its own."""
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_LIGHT, _OWN_LIGHT) < 0:
        return None
    planes = np.flatnonzero(model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE))
    level = [geom for geom in planes if data.geom_xmat[geom, 8] > _LEVEL]
    return max((float(data.geom_xpos[geom, 2]) for geom in level), default=None)


def _shadow_casters(model: mujoco.MjModel, size_m: float) -> frozenset[int]:
    """The parts that are not too small, not clear and not the ground itself."""
    opacity = model.geom_rgba[:, 3].copy()
    made = model.geom_matid >= 0
    opacity[made] = model.mat_rgba[model.geom_matid[made], 3]
    endless = np.isin(model.geom_type, (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)))
    large = model.geom_rbound >= _CASTS_SIZES * size_m
    return frozenset(map(int, np.flatnonzero((opacity == 1) & ~endless & large)))


class CameraScene:
    """Pictures of one robot of a recording, tick by tick."""

    def __init__(self, recording: Recording, width: int, height: int, robot: int = 0) -> None:
        """Set everything up for pictures of a size, [pixels].

        Raises:
            RendererError: There is no off-screen renderer.
        """
        self._size = (width, height)
        large = (width * _FINENESS, height * _FINENESS)
        self.replay = ReplayModel(recording, robot, *large)
        self._camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(self.replay.model, self._camera)
        self._screen = Screen(self.replay.model, *large)
        self._ground = _level_ground(self.replay.model, self.replay.data)
        self._casts = _shadow_casters(self.replay.model, self.replay.size_m)

    def picture(self, tick: int, push: PushSpan | None = None) -> Image.Image:
        """The robot after a tick, with the arrow of a push if there is one."""
        from PIL import Image  # an extra

        self.replay.stand(tick)
        place_camera(self._camera, self.replay, tick)
        self._screen.look(self.replay.data, self._camera)
        if self._ground is not None:
            self._add_shadow(self._ground)
        if push is not None:
            add_arrow(self._screen.scene, *self.replay.arrow(push))
        return Image.fromarray(self._screen.draw()).reduce(_FINENESS)

    def _add_shadow(self, ground_m: float) -> None:
        """The robot's parts once more, pressed flat on the ground along the light, in one dark colour.

        The renderer's own shadows take as long as all the rest.
        """
        scene, model = self._screen.scene, self.replay.model
        solid = mujoco.mjtObj.mjOBJ_GEOM
        above = np.array([0.0, 0.0, ground_m + _SHADOW_SIZES * self.replay.size_m])
        for i in range(scene.ngeom):
            geom = scene.geoms[i]
            if geom.objtype != solid or geom.objid not in self._casts or scene.ngeom >= scene.maxgeom:
                continue
            mesh = geom.type == mujoco.mjtGeom.mjGEOM_MESH
            kind = mujoco.mjtGeom.mjGEOM_ELLIPSOID if mesh else geom.type
            size = model.geom_aabb[geom.objid, 3:] if mesh else geom.size
            place = _FLAT @ (geom.pos - [0.0, 0.0, ground_m]) + above
            turned = (_FLAT @ np.asarray(geom.mat).reshape(3, 3)).ravel()
            shadow = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(shadow, kind, size, place, turned, _SHADOW_RGBA)
            shadow.size[:] = size
            shadow.specular, shadow.shininess = 0.0, 0.0
            scene.ngeom += 1

    def beside_arrow(self, push: PushSpan) -> tuple[float, float]:
        """Where in the last picture the arrow of a push begins; from the left and from the top, [pixels]."""
        camera = self._screen.scene.camera[0]
        away = self.replay.arrow(push)[0] - camera.pos
        depth = max(float(np.dot(away, camera.forward)), 1e-6)
        right = np.cross(camera.forward, camera.up)
        scale = self._size[1] / (camera.frustum_top - camera.frustum_bottom) * camera.frustum_near / depth
        across, upward = float(np.dot(away, right)), float(np.dot(away, camera.up))
        return self._size[0] / 2 + across * scale, self._size[1] / 2 - upward * scale

    def close(self) -> None:
        """Give the renderer back."""
        self._screen.close()


def add_arrow(scene: mujoco.MjvScene, tail: Array, tip: Array) -> None:
    """Add an arrow to a scene, as thick as it suits its length.

    Of cylinders, for MuJoCo 4.0 draws its own arrows half as long as they are.
    """
    length = float(np.linalg.norm(tip - tail))
    shaft, wide, head, rings = 0.04 * length, 0.11 * length, 0.22 * length, 14
    direction = (tip - tail) / length
    neck = tip - head * direction
    if np.dot(neck - tail, direction) > 0:
        _add_cylinder(scene, tail, neck, shaft)
    for ring in range(rings):
        begin, end = (neck + head * (ring + more) / rings * direction for more in (0, 1))
        _add_cylinder(scene, begin, end, wide * (1 - (ring + 0.5) / rings))


def _add_cylinder(scene: mujoco.MjvScene, begin: Array, end: Array, radius_m: float) -> None:
    part, kind = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_CYLINDER
    mujoco.mjv_initGeom(part, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), ARROW_RGBA)
    mujoco.mjv_connector(part, kind, radius_m, begin, end)
    part.emission = 0.4
    scene.ngeom += 1


def _followed(path: Array, window: int) -> Array:
    """The mean over a window of ticks around each tick; shape (T, 3)."""
    half = max(window // 2, 1)
    padded = np.concatenate([np.repeat(path[:1], half, axis=0), path, np.repeat(path[-1:], half, axis=0)])
    total = np.cumsum(np.concatenate([np.zeros((1, path.shape[1])), padded]), axis=0)
    mean: Array = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    return mean
