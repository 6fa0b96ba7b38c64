"""The 3-D scene of one side: rider, helmet, crush map and force arrows at one sample."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.explore import meshes
from helmet_sim_ros.explore.colors import SURFACE_COLOR, crush_colors, rgb, shape_color
from helmet_sim_ros.explore.session import Shown, Side
from helmet_sim_ros.model.arrows import force_arrows
from helmet_sim_ros.model.scene import Scene, SceneShape
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.drawing import Primitive, drawn

#: Body whose shape is drawn as a helmet.
_HELMET = "helmet"
#: How far the second rider lies beside the first [m].
BESIDE = 1.3
#: Crush below this share of the largest is not drawn.
_LEAST_CRUSH = 0.02
#: How far the copy of a crushed helmet hangs above it, and from it towards the feet; how far discs
#: lie above a shell [m].
_COPY_ABOVE, _COPY_BACK, _ABOVE_SHELL = 0.62, 0.3, 0.003
_PLATE = (1.5, 1.5)  # m, half edges of a drawn plane


class Stage:
    """What is drawn of one side. Not for several threads at once.

    Attributes:
        shown: the impact that is drawn, None before the first.
        floor: height [m] of the lowest point of what is struck; 0 for flat ground.
    """

    def __init__(self, server: viser.ViserServer, side: Side) -> None:
        self._scene, self._root = server.scene, f"/{side}"
        self._side = side
        self._frame = self._scene.add_frame(self._root, show_axes=False)
        self._nodes: list[Any] = []
        self._surface: list[Any] = []
        self._struck: SurfaceConfig | None = None
        self._looks: list[object] = []
        self._helmet: list[Any] = []
        self._helmet_look: object = None
        self._crush: list[Any] = []
        self._copy: Any = None
        self._label: Any = None
        self._arrows: Any = None
        self._model: Scene | None = None
        self.shown: Shown | None = None
        self.floor = 0.0

    def show(
        self, shown: Shown, scene: Scene | None, offset: FloatArray, viewed_from: FloatArray
    ) -> None:
        """Take another impact; :meth:`draw` poses it.

        Args:
            shown: the impact.
            scene: its shapes; None where there is nothing to draw.
            offset: moves the whole side, (3,) [m].
            viewed_from: direction from which it is mostly seen, (3,).
        """
        if scene is None or shown.record is None:
            self.clear()
            return
        self.shown, self._model = shown, scene
        self.move(offset)
        self._show_surface(scene)
        self._show_shapes(scene)
        self._show_helmet(scene)
        self._show_crush(scene, shown.record, viewed_from)
        if self._arrows is None:
            points = np.zeros((2, 2, 3), dtype=np.float32)
            colors = np.array([rgb(arrow.color) for arrow in force_arrows(shown.record, 0)])
            self._arrows = self._scene.add_arrows(
                f"{self._root}/forces", points, colors,
                shaft_radius=0.012, head_radius=0.028, head_length=0.06,
            )  # fmt: skip

    def move(self, offset: FloatArray) -> None:
        """Put the whole side elsewhere, (3,) [m]."""
        self._frame.position = offset

    def clear(self) -> None:
        """Draw nothing."""
        for node in [*self._surface, *self._nodes, *self._crush, *self._helmet, self._arrows]:
            if node is not None:
                node.remove()
        self._remove_copy()
        self._surface, self._struck, self.floor = [], None, 0.0
        self._nodes, self._looks, self._helmet, self._helmet_look = [], [], [], None
        self._crush = []
        self._arrows = self._model = self.shown = None

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

    def extent(self, helmet_only: bool) -> tuple[FloatArray, float]:
        """Middle (3,) and radius [m] of what is drawn at the first touch."""
        if self._model is None or self.shown is None or self.shown.record is None:
            return np.array([0.0, 0.0, 0.5]), 1.0
        positions, _ = self._model.poses(self.shown.record, 0)
        helmet = self.shown.record.helmet_position[0]
        if helmet_only:
            return helmet, 0.3
        if self._copy is not None:
            positions = np.vstack([positions, self._copy.position])
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
        return self._scene.add_mesh_simple(
            f"{self._root}/shapes/{number}_{shape.name}",
            mesh.vertices,
            mesh.faces,
            color=shape_color(shape, self._side),
        )

    def _show_surface(self, scene: Scene) -> None:
        """What is struck, but for flat ground, which the page draws."""
        surface = scene.setup.surface_config
        if surface is self._struck:
            return
        for node in self._surface:
            node.remove()
        self._surface, self._struck, self.floor = [], surface, 0.0
        if surface.is_flat_ground:
            return
        lowest = []
        for number, solid in enumerate(drawn(surface)):
            mesh = solid_mesh(solid)
            vertices = mesh.vertices @ solid.rotation.T + solid.position
            lowest.append(float(vertices[:, 2].min()))
            self._surface.append(
                self._scene.add_mesh_simple(
                    f"{self._root}/surface/{number}", vertices, mesh.faces, color=SURFACE_COLOR,
                    flat_shading=solid.kind == "box",
                )
            )  # fmt: skip
        self.floor = min(lowest)

    def _show_helmet(self, scene: Scene) -> None:
        helmet = scene.setup.helmet_config
        shape = next((shape for shape in scene.shapes if shape.name == _HELMET), None)
        look = (
            shape is None, helmet.geometry, helmet.shell.semi_axes, helmet.shell.center, helmet.mass
        )  # fmt: skip
        if look == self._helmet_look:
            return
        for node in [*self._crush, *self._helmet]:
            node.remove()
        self._crush, self._helmet, self._helmet_look = [], [], look
        self._remove_copy()
        if shape is None:
            return
        mesh = meshes.helmet_mesh(helmet)
        frame = self._scene.add_frame(f"{self._root}/helmet", show_axes=False)
        self._scene.add_mesh_simple(
            f"{self._root}/helmet/shell", mesh.shell.vertices, mesh.shell.faces,
            color=shape_color(shape, self._side),
        )  # fmt: skip
        self._helmet = [frame]
        if len(mesh.visor.faces):
            self._scene.add_mesh_simple(
                f"{self._root}/helmet/visor", mesh.visor.vertices, mesh.visor.faces,
                color=(28, 32, 40), opacity=0.72, side="double",
            )  # fmt: skip

    def _show_crush(self, scene: Scene, record: ImpactRecord, viewed_from: FloatArray) -> None:
        """The map of residual crush: on the helmet, and on a copy above it that shows the dent."""
        for node in self._crush:
            node.remove()
        self._crush = []
        found = crush_of(record)
        if found is None or not self._helmet:
            self._remove_copy()
            return
        residual, position = found
        turn, _ = Rotation.align_vectors([viewed_from], [residual @ position])
        copy = self._copy or self._added_copy(scene)
        upwards, _ = axes(record)
        copy.position = record.helmet_position[0] + [0.0, 0.0, _COPY_ABOVE] - _COPY_BACK * upwards
        copy.wxyz = _wxyz(turn)
        worst = 1e3 * float(residual.max())
        self._label.text = f"{self._side}: crushed by {worst:.1f} mm"
        self._label.position = turn.inv().apply([0.0, 0.0, 0.22])
        for parent in ("helmet", "copy"):
            node = self._scene.add_batched_meshes_simple(
                f"{self._root}/{parent}/crush", **_discs(residual, position), side="double",
                cast_shadow=False, receive_shadow=False, lod="off",
            )  # fmt: skip
            self._crush.append(node)

    def _added_copy(self, scene: Scene) -> Any:
        name = f"{self._root}/copy"
        shell = meshes.helmet_mesh(scene.setup.helmet_config).shell
        self._copy = self._scene.add_frame(name, show_axes=False)
        self._scene.add_mesh_simple(
            f"{name}/shell", shell.vertices, shell.faces, color=(206, 211, 218)
        )
        self._label = self._scene.add_label(f"{name}/label", "")
        return self._copy

    def _remove_copy(self) -> None:
        if self._copy is not None:
            self._copy.remove()
        self._copy = self._label = None


def axes(record: ImpactRecord) -> tuple[FloatArray, FloatArray]:
    """Unit vectors of the head at the first touch, (3,) each: upwards, and where it looks."""
    turn = Rotation.from_quat(record.head_orientation[0])
    return turn.apply([0.0, 0.0, 1.0]), turn.apply([1.0, 0.0, 0.0])


def shape_mesh(shape: SceneShape) -> meshes.Mesh:
    """The mesh of a part of the rider, along its own axes."""
    if shape.kind == "capsule":
        return meshes.capsule(shape.size[0], shape.size[1])
    if shape.name == "head":
        return meshes.ellipsoid(shape.size)
    return meshes.rounded(shape.size)


def solid_mesh(solid: Primitive) -> meshes.Mesh:
    """The mesh of a part of a surface, along its own axes; a plane as a plate."""
    first, second, _ = solid.size
    if solid.kind == "plane":
        plate = meshes.box((*_PLATE, 0.01))
        return meshes.Mesh(plate.vertices - [0.0, 0.0, 0.01], plate.faces)
    if solid.kind == "sphere":
        return meshes.ellipsoid((first, first, first))
    if solid.kind == "capsule":
        return meshes.capsule(first, second)
    if solid.kind == "cylinder":
        return meshes.cylinder(first, second)
    return meshes.box(solid.size) if solid.kind == "box" else meshes.ellipsoid(solid.size)


def crush_of(record: ImpactRecord) -> tuple[FloatArray, FloatArray] | None:
    """Residual crush [m] and position (n, 3) [m] of the foam columns that are crushed."""
    residual, position = (record.extras.get(n) for n in ("residual_crush", "column_position"))
    if not isinstance(residual, np.ndarray) or not isinstance(position, np.ndarray):
        return None
    worst = float(residual.max(initial=0.0))
    if worst <= 0.0 or position.shape != (len(residual), 3):
        return None
    crushed = residual > _LEAST_CRUSH * worst
    return residual[crushed], position[crushed]


def _discs(residual: FloatArray, position: FloatArray) -> dict[str, Any]:
    """Discs on a shell, as large as a column, coloured by crush."""
    outwards = position / np.linalg.norm(position, axis=1, keepdims=True)
    disc = meshes.disc()
    return {
        "vertices": disc.vertices * _spacing(position),
        "faces": disc.faces,
        "batched_wxyzs": _towards(outwards),
        "batched_positions": position + _ABOVE_SHELL * outwards,
        "batched_colors": crush_colors(residual / residual.max()),
    }


def _spacing(position: FloatArray) -> float:
    """Radius [m] at which discs at these points just close the gaps between them."""
    if len(position) < 2:
        return 0.01
    nearest = cKDTree(position).query(position, k=2)[0][:, 1]
    return 0.62 * float(np.median(nearest))


def _pose(node: Any, position: FloatArray, quaternion: FloatArray) -> None:
    x, y, z, w = quaternion
    node.position, node.wxyz = position, np.array([w, x, y, z])


def _wxyz(turn: Rotation) -> FloatArray:
    quaternion: FloatArray = turn.as_quat()[..., [3, 0, 1, 2]]
    return quaternion


def _towards(directions: FloatArray) -> FloatArray:
    """Quaternions w, x, y, z that turn the z axis to unit vectors (n, 3)."""
    axis = np.cross([0.0, 0.0, 1.0], directions)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, directions[:, 2:])
    unit = np.divide(axis, sine, out=np.tile([1.0, 0.0, 0.0], (len(axis), 1)), where=sine > 1e-9)
    return _wxyz(Rotation.from_rotvec(unit * angle))
