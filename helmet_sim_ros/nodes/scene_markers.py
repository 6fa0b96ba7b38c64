"""Rider, helmet, what surrounds them and the forces between them as RViz markers."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.biomech.rotation import matrices
from helmet_sim_ros.model.arrows import COLORS, FORCES, force_arrows
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.surface.drawing import GROUND, Primitive
from helmet_sim_ros.nodes.conversion import stamp

Color = tuple[float, float, float, float]
Size = tuple[float, float, float]

#: Edge of the drawn part of a plane of an impact and of a fall, and its thickness [m].
_EDGE, _WIDE, _THICK = 4.0, 40.0, 0.01
_GROUND, _SOLID = (0.55, 0.55, 0.55, 1.0), (0.45, 0.50, 0.58, 1.0)
#: Diameter of an arrow's shaft and head, length of its head [m].
_ARROW = (0.015, 0.035, 0.05)


class _Drawn(NamedTuple):
    """The markers of one shape, and where the middle of each is in its axes: (n, 3) [m]."""

    markers: list[Marker]
    offsets: FloatArray


class SceneMarkers:
    """The markers of one setup; frame ``world``.

    A capsule becomes a cylinder and a sphere at each end; of a plane the part under the helmet is
    drawn. The namespace of a marker is the body's name, that of an arrow, ``ground`` for a level
    plane, or ``surface`` for anything else that surrounds the rider.

    Attributes:
        scene: posed by :meth:`values` and :meth:`message`.
    """

    def __init__(self, setup: ImpactSetup | Fall) -> None:
        self.setup = setup
        self.scene = Scene(setup)
        self._solids = self.scene.around()
        edge = _WIDE if isinstance(setup, Fall) else _EDGE
        parts = [_drawn_solid(solid, edge) for solid in self._solids]
        parts += [_drawn(s.name, s.kind, s.size, s.color) for s in self.scene.shapes]
        self._shapes = [marker for part in parts for marker in part.markers]
        self._owners = np.repeat(np.arange(len(parts)), [len(part.markers) for part in parts])
        self._offsets = np.vstack([part.offsets for part in parts])
        self._arrows = [_marker(Marker.ARROW, name, _ARROW, COLORS[name]) for name in FORCES]
        self._message = MarkerArray(markers=[*self._shapes, *self._arrows])
        for number, marker in enumerate(self._message.markers):
            marker.id = number

    def message(self, record: ImpactRecord, index: int, time_ns: int) -> MarkerArray:
        """The scene at one sample; the same object every time."""
        return self.filled(*self.values(record, index), time_ns)

    def values(self, record: ImpactRecord, index: int) -> tuple[FloatArray, tuple[bool, ...]]:
        """The numbers of the scene at one sample: position [m] and orientation x, y, z, w of every
        shape's marker, tail and tip of every arrow [m]; and which of the arrows are there."""
        if not self.scene.is_still:
            self._solids = self.scene.around(float(record.time[index]))
        around = [_place(solid, record.helmet_position[index]) for solid in self._solids]
        turns = [_quaternion(solid.rotation) for solid in self._solids]
        positions, quaternions = self.scene.poses(record, index)
        positions = np.vstack([*around, positions])[self._owners]
        quaternions = np.vstack([turns, quaternions])[self._owners]
        turned = np.einsum("nij,nj->ni", matrices(quaternions), self._offsets)
        arrows = force_arrows(record, index)
        ends = [end for arrow in arrows for end in (arrow.tail, arrow.tip)]
        values = np.concatenate([np.hstack([positions + turned, quaternions]).ravel(), *ends])
        return values, tuple(arrow.visible for arrow in arrows)

    def filled(self, values: FloatArray, visible: tuple[bool, ...], time_ns: int) -> MarkerArray:
        """The message of such numbers; the same object every time."""
        shapes, arrows = np.split(values, [7 * len(self._shapes)])
        for marker, (x, y, z, *turn) in zip(
            self._shapes, shapes.reshape(-1, 7).tolist(), strict=True
        ):
            orientation = Quaternion(**dict(zip("xyzw", turn, strict=True)))
            marker.pose = Pose(position=Point(x=x, y=y, z=z), orientation=orientation)
        for marker, there, ends in zip(
            self._arrows, visible, arrows.reshape(-1, 2, 3).tolist(), strict=True
        ):
            marker.action = Marker.ADD if there else Marker.DELETE
            marker.points = [Point(x=x, y=y, z=z) for x, y, z in ends]
        now = stamp(time_ns)
        for marker in self._message.markers:
            marker.header.stamp = now
        return self._message


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Quaternion x, y, z, w, (4,), of a rotation matrix, (3, 3)."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    return quaternion[[1, 2, 3, 0]]


def _place(solid: Primitive, helmet: FloatArray) -> FloatArray:
    """Where a solid is drawn, (3,) [m]: of a plane the part that the helmet is over."""
    if solid.kind != "plane":
        return solid.position
    normal = solid.rotation[:, 2]
    return helmet - normal * float(normal @ (helmet - solid.position))


def _drawn_solid(solid: Primitive, edge: float) -> _Drawn:
    if solid.kind == "plane":
        name = GROUND if solid.rotation[2, 2] > 1.0 - 1e-9 else "surface"
        marker = _marker(Marker.CUBE, name, (edge, edge, _THICK), _GROUND)
        return _Drawn([marker], np.array([[0.0, 0.0, -0.5 * _THICK]]))
    return _drawn("surface", solid.kind, solid.size, _SOLID)


def _drawn(name: str, kind: str, size: Size, color: Color) -> _Drawn:
    """The markers of a shape in MuJoCo's conventions, see :class:`Primitive`."""
    a, b, c = size
    middle = np.zeros((1, 3))
    if kind == "box":
        return _Drawn([_marker(Marker.CUBE, name, (2 * a, 2 * b, 2 * c), color)], middle)
    if kind == "ellipsoid":
        return _Drawn([_marker(Marker.SPHERE, name, (2 * a, 2 * b, 2 * c), color)], middle)
    if kind == "sphere":
        return _Drawn([_marker(Marker.SPHERE, name, (2 * a,) * 3, color)], middle)
    tube = _marker(Marker.CYLINDER, name, (2 * a, 2 * a, 2 * b), color)
    if kind == "cylinder":
        return _Drawn([tube], middle)
    caps = [_marker(Marker.SPHERE, name, (2 * a,) * 3, color) for _ in range(2)]
    return _Drawn([tube, *caps], np.array([[0.0, 0.0, 0.0], [0.0, 0.0, b], [0.0, 0.0, -b]]))


def _marker(kind: int, name: str, size: Size, color: Color) -> Marker:
    x, y, z = size
    r, g, b, a = color
    marker = Marker(
        ns=name, type=kind, action=Marker.ADD,
        scale=Vector3(x=x, y=y, z=z), color=ColorRGBA(r=r, g=g, b=b, a=a),
    )  # fmt: skip
    marker.header.frame_id = "world"
    return marker
