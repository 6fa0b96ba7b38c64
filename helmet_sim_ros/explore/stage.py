"""The 3-D scene of one side: rider, helmet, crush map and force arrows at one sample."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.explore import meshes
from helmet_sim_ros.explore.colors import crush_colors, rgb, shape_color
from helmet_sim_ros.explore.session import Shown, Side
from helmet_sim_ros.model.arrows import force_arrows
from helmet_sim_ros.model.scene import Scene, SceneShape

#: Body whose shape is drawn as a helmet.
_HELMET = "helmet"
#: How far the second rider lies beside the first [m].
BESIDE = 1.3
#: Crush below this share of the largest is not drawn.
_LEAST_CRUSH = 0.02


class Stage:
    """What is drawn of one side. Not for several threads at once.

    Attributes:
        shown: the impact that is drawn, None before the first.
    """

    def __init__(self, server: viser.ViserServer, side: Side) -> None:
        self._scene, self._root = server.scene, f"/{side}"
        self._side = side
        self._frame = self._scene.add_frame(self._root, show_axes=False)
        self._nodes: list[Any] = []
        self._looks: list[object] = []
        self._helmet: list[Any] = []
        self._helmet_look: object = None
        self._crush: Any = None
        self._arrows: Any = None
        self._model: Scene | None = None
        self.shown: Shown | None = None

    def show(self, shown: Shown, scene: Scene | None, offset: FloatArray) -> None:
        """Take another impact; :meth:`draw` poses it.

        Args:
            shown: the impact.
            scene: its shapes; None where there is nothing to draw.
            offset: moves the whole side, (3,) [m].
        """
        if scene is None or shown.record is None:
            self.clear()
            return
        self.shown, self._model = shown, scene
        self._frame.position = tuple(offset)
        self._show_shapes(scene)
        self._show_helmet(scene)
        self._show_crush(shown.record)
        if self._arrows is None:
            points = np.zeros((2, 2, 3), dtype=np.float32)
            colors = np.array([rgb(arrow.color) for arrow in force_arrows(shown.record, 0)])
            self._arrows = self._scene.add_arrows(
                f"{self._root}/forces", points, colors,
                shaft_radius=0.012, head_radius=0.028, head_length=0.06,
            )  # fmt: skip

    def clear(self) -> None:
        """Draw nothing."""
        for node in [*self._nodes, self._crush, *self._helmet, self._arrows]:
            if node is not None:
                node.remove()
        self._nodes, self._looks, self._helmet, self._helmet_look = [], [], [], None
        self._crush = self._arrows = self._model = self.shown = None

    def draw(self, index: int) -> None:
        """Pose everything at one sample."""
        if self._model is None or self.shown is None or self.shown.record is None:
            return
        record = self.shown.record
        index = min(index, len(record) - 1)
        positions, quaternions = self._model.poses(record, index)
        shapes = [i for i, s in enumerate(self._model.shapes) if s.name != _HELMET]
        for node, i in zip(self._nodes, shapes, strict=True):
            _pose(node, positions[i], quaternions[i])
        for node in self._helmet:
            _pose(node, record.helmet_position[index], record.helmet_orientation[index])
        points = [[arrow.tail, arrow.tip] for arrow in force_arrows(record, index)]
        visible = [arrow.visible for arrow in force_arrows(record, index)]
        self._arrows.points = np.array(
            [p if seen else [p[0], p[0]] for p, seen in zip(points, visible, strict=True)],
            dtype=np.float32,
        )

    def axes(self) -> tuple[FloatArray, FloatArray]:
        """Unit vectors at the first touch, (3,) each: from pelvis to head, and where he looks."""
        assert self._model is not None and self.shown is not None
        record = self.shown.record
        assert record is not None
        positions, _ = self._model.poses(record, 0)
        head = record.head_position[0]
        along = head - positions.mean(axis=0)
        turn = Rotation.from_quat(record.head_orientation[0])
        if np.linalg.norm(along) < 0.05:  # a headform has no body
            along = turn.apply([0.0, 0.0, 1.0])
        return along / np.linalg.norm(along), turn.apply([1.0, 0.0, 0.0])

    def extent(self, helmet_only: bool) -> tuple[FloatArray, float]:
        """Middle (3,) and radius [m] of what is drawn at the first touch."""
        if self._model is None or self.shown is None or self.shown.record is None:
            return np.array([0.0, 0.0, 0.5]), 1.0
        positions, _ = self._model.poses(self.shown.record, 0)
        helmet = self.shown.record.helmet_position[0]
        if helmet_only:
            return helmet, 0.3
        center = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
        return center, float(np.linalg.norm(positions - center, axis=1).max()) + 0.15

    def _show_shapes(self, scene: Scene) -> None:
        shapes = [shape for shape in scene.shapes if shape.name != _HELMET]
        looks: list[object] = [(s.name, s.kind, s.size, s.color) for s in shapes]
        if looks == self._looks:
            return
        for node in self._nodes:
            node.remove()
        self._looks = looks
        self._nodes = [self._added(number, shape) for number, shape in enumerate(shapes)]

    def _added(self, number: int, shape: SceneShape) -> Any:
        mesh = shape_mesh(shape)
        name = f"{self._root}/shapes/{number}_{shape.name}"
        if mesh is None:  # of a later version: not seen, but nothing breaks
            return self._scene.add_frame(name, show_axes=False)
        return self._scene.add_mesh_simple(
            name, mesh.vertices, mesh.faces, color=shape_color(shape, self._side)
        )

    def _show_helmet(self, scene: Scene) -> None:
        helmet = scene.setup.helmet_config
        drawn = any(shape.name == _HELMET for shape in scene.shapes)
        look = (drawn, helmet.shell.semi_axes, helmet.shell.center, helmet.mass)
        if look == self._helmet_look:
            return
        for node in self._helmet:
            node.remove()
        self._helmet, self._helmet_look = [], look
        if not drawn:
            return
        mesh = meshes.helmet_mesh(helmet)
        shape = next(shape for shape in scene.shapes if shape.name == _HELMET)
        frame = self._scene.add_frame(f"{self._root}/helmet", show_axes=False)
        shell = self._scene.add_mesh_simple(
            f"{self._root}/helmet/shell", mesh.shell.vertices, mesh.shell.faces,
            color=shape_color(shape, self._side),
        )  # fmt: skip
        self._helmet = [frame]
        assert shell is not None
        if len(mesh.visor.faces):
            self._scene.add_mesh_simple(
                f"{self._root}/helmet/visor", mesh.visor.vertices, mesh.visor.faces,
                color=(28, 32, 40), opacity=0.72, side="double",
            )  # fmt: skip
        self._crush = None

    def _show_crush(self, record: ImpactRecord) -> None:
        """Discs on the shell, one for each crushed foam column, coloured by residual crush."""
        if self._crush is not None:
            self._crush.remove()
            self._crush = None
        residual, position = record.extras.get("residual_crush"), record.extras.get(
            "column_position"
        )  # fmt: skip
        if not isinstance(residual, np.ndarray) or not isinstance(position, np.ndarray):
            return
        worst = float(residual.max(initial=0.0))
        crushed = residual > _LEAST_CRUSH * worst
        if worst <= 0.0 or not self._helmet:
            return
        outwards = position / np.linalg.norm(position, axis=1, keepdims=True)
        area = 4.0 * np.pi * float(np.mean(np.linalg.norm(position, axis=1))) ** 2
        radius = 0.62 * float(np.sqrt(area / len(position)))
        disc = meshes.disc()
        self._crush = self._scene.add_batched_meshes_simple(
            f"{self._root}/helmet/crush", disc.vertices * radius, disc.faces,
            batched_wxyzs=_towards(outwards[crushed]),
            batched_positions=position[crushed] + 0.003 * outwards[crushed],
            batched_colors=crush_colors(residual[crushed] / worst),
            side="double", cast_shadow=False, receive_shadow=False, lod="off",
        )  # fmt: skip


def shape_mesh(shape: SceneShape) -> meshes.Mesh | None:
    """The mesh of a shape; None for a kind that is not known here."""
    if shape.kind == "ellipsoid" and shape.name != "head":
        return meshes.rounded(shape.size)
    if shape.kind in ("ellipsoid", "sphere"):
        axes = np.array(shape.size)
        unit = meshes.sphere()
        return meshes.Mesh(unit.vertices * np.where(axes > 0.0, axes, axes[0]), unit.faces)
    if shape.kind == "capsule":
        return meshes.capsule(shape.size[0], shape.size[1])
    if shape.kind == "box":
        return meshes.box(shape.size)
    if shape.kind == "cylinder":
        return meshes.cylinder(shape.size[0], shape.size[1])
    return None


def _pose(node: Any, position: FloatArray, quaternion: FloatArray) -> None:
    x, y, z, w = quaternion
    node.position, node.wxyz = position, np.array([w, x, y, z])


def _towards(directions: FloatArray) -> FloatArray:
    """Quaternions w, x, y, z that turn the z axis to unit vectors (n, 3)."""
    axis = np.cross([0.0, 0.0, 1.0], directions)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, directions[:, 2:])
    unit = np.divide(axis, sine, out=np.tile([1.0, 0.0, 0.0], (len(axis), 1)), where=sine > 1e-9)
    turned: FloatArray = Rotation.from_rotvec(unit * angle).as_quat()[:, [3, 0, 1, 2]]
    return turned
