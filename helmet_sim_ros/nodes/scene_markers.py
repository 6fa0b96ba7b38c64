"""Rider, helmet, what surrounds them and the forces between them as RViz markers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from scipy.spatial.transform import Rotation
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.model.arrows import FORCES, Arrow, force_arrows
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

    def put(self, position: FloatArray, rotation: FloatArray, turn: FloatArray) -> None:
        """Pose the shape: position (3,), rotation (3, 3) and as quaternion x, y, z, w (4,)."""
        quaternion = Quaternion(**dict(zip("xyzw", turn.tolist(), strict=True)))
        places = (position + self.offsets @ rotation.T).tolist()
        for marker, (x, y, z) in zip(self.markers, places, strict=True):
            marker.pose = Pose(position=Point(x=x, y=y, z=z), orientation=quaternion)


class SceneMarkers:
    """The markers of one setup; frame ``world``.

    A capsule becomes a cylinder and a sphere at each end; of a plane the part under the helmet is
    drawn. The namespace of a marker is the body's name, that of an arrow, ``ground`` for a level
    plane, or ``surface`` for anything else that surrounds the rider.

    Attributes:
        scene: posed by :meth:`message`.
    """

    def __init__(self, setup: ImpactSetup | Fall) -> None:
        self.setup = setup
        self.scene = Scene(setup)
        self._solids = self.scene.around()
        edge = _WIDE if isinstance(setup, Fall) else _EDGE
        self._around = [_drawn_solid(solid, edge) for solid in self._solids]
        self._parts = [_drawn(s.name, s.kind, s.size, s.color) for s in self.scene.shapes]
        self._put_around(self._solids)
        self._arrows = [_marker(Marker.ARROW, name, _ARROW, (0.0,) * 4) for name in FORCES]
        shapes = (marker for part in (*self._around, *self._parts) for marker in part.markers)
        self._message = MarkerArray(markers=[*shapes, *self._arrows])
        for number, marker in enumerate(self._message.markers):
            marker.id = number

    def message(self, record: ImpactRecord, index: int, time_ns: int) -> MarkerArray:
        """The scene at one sample; the same object every time."""
        if not self.scene.is_still:
            self._solids = self.scene.around(float(record.time[index]))
            self._put_around(self._solids)
        for part, solid in zip(self._around, self._solids, strict=True):
            if solid.kind == "plane":
                _under(part, solid, record.helmet_position[index])
        positions, quaternions = self.scene.poses(record, index)
        rotations = Rotation.from_quat(quaternions).as_matrix()
        for part, *pose in zip(self._parts, positions, rotations, quaternions, strict=True):
            part.put(*pose)
        for marker, arrow in zip(self._arrows, force_arrows(record, index), strict=True):
            _point(marker, arrow)
        now = stamp(time_ns)
        for marker in self._message.markers:
            marker.header.stamp = now
        return self._message

    def _put_around(self, solids: list[Primitive]) -> None:
        for part, solid in zip(self._around, solids, strict=True):
            part.put(solid.position, solid.rotation, Rotation.from_matrix(solid.rotation).as_quat())


def _under(part: _Drawn, plane: Primitive, helmet: FloatArray) -> None:
    """Move the drawn part of a plane to where the helmet is over it."""
    normal = plane.rotation[:, 2]
    foot = helmet - normal * float(normal @ (helmet - plane.position))
    turn = Rotation.from_matrix(plane.rotation).as_quat()
    part.put(foot, plane.rotation, turn)


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


def _point(marker: Marker, arrow: Arrow) -> None:
    """Let a marker show a force, or nothing while there is none."""
    marker.action = Marker.ADD if arrow.visible else Marker.DELETE
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in (arrow.tail.tolist(), arrow.tip.tolist())]
    marker.color = ColorRGBA(**dict(zip("rgba", arrow.color, strict=True)))


def _marker(kind: int, name: str, size: Size, color: Color) -> Marker:
    x, y, z = size
    r, g, b, a = color
    marker = Marker(
        ns=name, type=kind, action=Marker.ADD,
        scale=Vector3(x=x, y=y, z=z), color=ColorRGBA(r=r, g=g, b=b, a=a),
    )  # fmt: skip
    marker.header.frame_id = "world"
    return marker
