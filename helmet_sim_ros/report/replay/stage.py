"""The scene of an impact as MuJoCo's drawing primitives, for video and viewer."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.model.arrows import force_arrows
from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.model.surface.drawing import Primitive, drawn
from helmet_sim_ros.report.replay.scene import scene_of

Color = tuple[float, float, float, float]
_KINDS = {
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
}
_GROUND = (0.78, 0.80, 0.82, 1.0)
_ANVIL = (0.60, 0.63, 0.66, 1.0)  # what else is struck
_LINE = (0.60, 0.63, 0.66, 1.0)
_TILE, _HALF = 0.25, 2.0  # m, spacing of a plane's lines and half its edge
_SHAFT = 0.012  # m, half width of an arrow
_SKY, _SKY_RADIUS = (0.92, 0.94, 0.96, 1.0), 15.0
_SHELL_OPACITY = 0.55  # so that head and arrows are seen through it


class Stage:
    """Draws one record; the same shapes as in the ``scene`` topic and in the report.

    Attributes:
        scene: posed by :meth:`draw`.
    """

    def __init__(self, record: ImpactRecord) -> None:
        """Rebuild the scene.

        Raises:
            LogError: this version's model cannot show the record.
        """
        self.record = record
        self.scene: Scene = scene_of(record)
        model = self.scene.model
        model.vis.headlight.ambient[:] = 0.45
        model.vis.headlight.diffuse[:] = 0.55
        model.vis.headlight.specular[:] = 0.1

    def draw(self, target: mujoco.MjvScene, index: int) -> None:
        """Add bodies, ground and forces of one sample to a scene."""
        target.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 0  # the sky is seen from inside
        sky = _add(
            target, mujoco.mjtGeom.mjGEOM_SPHERE, (_SKY_RADIUS,) * 3, (0.0,) * 3, np.eye(3).ravel(),
            _SKY,
        )  # fmt: skip
        sky.emission = 0.8
        self.draw_around(target, index)
        positions, quaternions = self.scene.poses(self.record, index)
        shapes = zip(self.scene.shapes, positions, quaternions, strict=True)
        # What can be seen through comes last, as OpenGL wants it.
        for shape, position, (x, y, z, w) in sorted(shapes, key=lambda s: s[0].name == "helmet"):
            rotation = np.empty(9)
            mujoco.mju_quat2Mat(rotation, np.array([w, x, y, z]))
            r, g, b, opacity = shape.color
            color = (r, g, b, min(opacity, _SHELL_OPACITY) if shape.name == "helmet" else opacity)
            if shape.name == "helmet" and self.scene.mesh is not None:
                self._draw_mesh(target, position, rotation, color)
                continue
            _add(target, _KINDS[shape.kind], shape.size, position, rotation, color)

    def _draw_mesh(
        self, target: mujoco.MjvScene, position: FloatArray, rotation: FloatArray, color: Color
    ) -> None:
        """The helmet's own shell. MuJoCo keeps a mesh about its middle, along its main axes."""
        model, turn = self.scene.model, np.empty(9)
        mujoco.mju_quat2Mat(turn, model.mesh_quat[0])
        frame = rotation.reshape(3, 3)
        geom = _add(
            target, mujoco.mjtGeom.mjGEOM_MESH, (1.0,) * 3, position + frame @ model.mesh_pos[0],
            (frame @ turn.reshape(3, 3)).ravel(), color,
        )  # fmt: skip
        geom.dataid = 0  # twice the number of the mesh; odd: its convex hull

    def draw_around(self, target: mujoco.MjvScene, index: int) -> None:
        """Add surface and forces of one sample to a scene."""
        for solid in drawn(self.scene.setup.surface_config):
            if solid.kind == "plane":
                self._draw_plane(target, solid)
            else:
                kind, axes = _KINDS[solid.kind], solid.rotation.ravel()
                _add(target, kind, solid.size, solid.position, axes, _ANVIL)
        for arrow in force_arrows(self.record, index):
            if arrow.visible:
                geom = _add(
                    target, mujoco.mjtGeom.mjGEOM_ARROW, (0.0,) * 3, (0.0,) * 3,
                    np.eye(3).ravel(), arrow.color,
                )  # fmt: skip
                # MuJoCo 4.0 draws an arrow half as long as its connector.
                mujoco.mjv_connector(
                    geom, mujoco.mjtGeom.mjGEOM_ARROW, _SHAFT,
                    arrow.tail, 2.0 * arrow.tip - arrow.tail,
                )  # fmt: skip

    def _draw_plane(self, target: mujoco.MjvScene, plane: Primitive) -> None:
        """Lines under the helmet's first place, on a plate that hides nothing from behind."""
        axes, box = plane.rotation, mujoco.mjtGeom.mjGEOM_BOX
        in_front = (target.camera[0].pos - plane.position) @ axes[:, 2] >= 0.0
        away = (self.record.helmet_position[0] - plane.position) @ axes
        x, y = np.round(away[:2] / _TILE) * _TILE
        lines = np.arange(-_HALF, _HALF + 1e-9, _TILE)
        plates = [((_HALF, _HALF, 0.005), (x, y, -0.006), _GROUND)] if in_front else []
        plates += [((0.003, _HALF, 0.001), (x + offset, y, 0.0), _LINE) for offset in lines]
        plates += [((_HALF, 0.003, 0.001), (x, y + offset, 0.0), _LINE) for offset in lines]
        for size, place, color in plates:
            _add(target, box, size, plane.position + axes @ place, axes.ravel(), color)

    def corners(self) -> Iterator[FloatArray]:
        """Where the shapes are at the first and the last sample, for the camera."""
        for index in (0, len(self.record) - 1):
            yield self.scene.poses(self.record, index)[0].copy()


def _add(
    target: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: tuple[float, ...],
    position: FloatArray | tuple[float, ...],
    rotation: FloatArray,
    color: Color,
) -> mujoco.MjvGeom:
    geom = target.geoms[target.ngeom]
    mujoco.mjv_initGeom(
        geom, kind, np.array(size, dtype=float), np.array(position, dtype=float), rotation,
        np.array(color, dtype=np.float32),
    )  # fmt: skip
    target.ngeom += 1
    return geom
