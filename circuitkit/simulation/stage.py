"""The stage for a film: the camera that goes along with the robot, its shadow, and the push as an arrow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.simulation.puppet import LIGHT, Puppet, add_arrow
from circuitkit.simulation.renderer import Screen
from circuitkit.simulation.story import PushSpan

if TYPE_CHECKING:
    from PIL import Image

    from circuitkit.simulation.recording import Recording

Array = NDArray[np.float64]

_FINENESS = 2  # drawn so much larger and then reduced: smoother and faster than the renderer's own smoothing
_AZIMUTH_DEG, _ELEVATION_DEG, _DISTANCE_M, _HEIGHT_M = 148.0, -9.0, 1.12, 0.25  # from the robot's front right

# Presses what is above the floor flat along the light; not wholly, for a surface needs a normal.
_TO_FLOOR = np.array([[1.0, 0.0, -LIGHT[0] / LIGHT[2]], [0.0, 1.0, -LIGHT[1] / LIGHT[2]], [0.0, 0.0, 1e-3]])
_SHADOW_M = 1.5e-3  # above the floor
_SHADOW_RGBA = np.array([0.47, 0.49, 0.52, 1.0], dtype=np.float32)
_CASTS_SHADOW_M = 0.02  # from this radius on


def place_camera(camera: mujoco.MjvCamera, centre_m: Array) -> None:
    """Look at a robot from its front right, so that pushes from the side go across the picture.

    Args:
        camera: A free camera.
        centre_m: Where the robot is, forward and left; shape (2,).
    """
    camera.azimuth, camera.elevation, camera.distance = _AZIMUTH_DEG, _ELEVATION_DEG, _DISTANCE_M
    camera.lookat[:] = [*centre_m, _HEIGHT_M]


class Stage:
    """Pictures of one robot of a recording, tick by tick."""

    def __init__(self, recording: Recording, width: int, height: int, robot: int = 0) -> None:
        """Set the stage for pictures of a size, [pixels].

        Raises:
            RendererError: There is no off-screen renderer.
        """
        self._size = (width, height)
        large = (width * _FINENESS, height * _FINENESS)
        self.puppet = Puppet(recording, robot, *large)
        model = self.puppet.model
        self._camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, self._camera)
        solid = (model.geom_rbound >= _CASTS_SHADOW_M) & (model.geom_rgba[:, 3] == 1)
        self._casts = np.flatnonzero(solid & (model.geom_bodyid > 0))
        self._screen = Screen(model, *large)

    def picture(self, tick: int, push: PushSpan | None = None) -> Image.Image:
        """The robot after a tick, with the arrow of a push if there is one."""
        from PIL import Image

        self.puppet.stand(tick)
        place_camera(self._camera, self.puppet.centre_m[tick])
        self._screen.look(self.puppet.data, self._camera)
        self._add_shadow()
        if push is not None:
            add_arrow(self._screen.scene, *self.puppet.arrow(push))
        return Image.fromarray(self._screen.draw()).reduce(_FINENESS)

    def beside_arrow(self, push: PushSpan) -> tuple[float, float]:
        """Where in the last picture the arrow of a push begins; from the left and from the top, [pixels]."""
        camera = self._screen.scene.camera[0]
        away = self.puppet.arrow(push)[0] - camera.pos
        depth = float(np.dot(away, camera.forward))
        right = np.cross(camera.forward, camera.up)
        scale = self._size[1] / (camera.frustum_top - camera.frustum_bottom) * camera.frustum_near / depth
        across, upward = float(np.dot(away, right)), float(np.dot(away, camera.up))
        return self._size[0] / 2 + across * scale, self._size[1] / 2 - upward * scale

    def close(self) -> None:
        """Give the renderer back."""
        self._screen.close()

    def _add_shadow(self) -> None:
        """The robot's parts once more, pressed flat on the floor along the light, in one dark colour.

        The renderer's own shadows take as long as all the rest.
        """
        scene, model = self._screen.scene, self.puppet.model
        solid = mujoco.mjtObj.mjOBJ_GEOM
        shown = {geom.objid: geom for geom in scene.geoms[: scene.ngeom] if geom.objtype == solid}
        for part in self._casts:
            if part not in shown:
                continue
            geom, shadow = shown[part], scene.geoms[scene.ngeom]
            position = _TO_FLOOR @ geom.pos + [0.0, 0.0, _SHADOW_M]
            turned = (_TO_FLOOR @ np.asarray(geom.mat).reshape(3, 3)).ravel()
            mesh = geom.type == mujoco.mjtGeom.mjGEOM_MESH
            kind = mujoco.mjtGeom.mjGEOM_ELLIPSOID if mesh else geom.type
            size = model.geom_aabb[part, 3:] if mesh else geom.size
            mujoco.mjv_initGeom(shadow, kind, size, position, turned, _SHADOW_RGBA)
            shadow.size[:] = size
            shadow.specular, shadow.shininess = 0.0, 0.0
            scene.ngeom += 1
