"""Rider, helmet, surface and the forces between them as RViz markers."""

from __future__ import annotations

import mujoco
import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.model.arrows import FORCES, Arrow, force_arrows
from helmet_sim_ros.model.scene import Scene, SceneShape
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.surface.drawing import GROUND, Primitive, drawn
from helmet_sim_ros.nodes.conversion import stamp

#: Half edges and half thickness of the drawn part of a plane [m].
_PLATE = (2.0, 2.0, 0.005)
_SURFACE_COLOR = (0.55, 0.55, 0.55, 1.0)
#: Diameter of an arrow's shaft and head, length of its head [m].
_ARROW = (0.015, 0.035, 0.05)


class SceneMarkers:
    """The markers of one setup; frame ``world``.

    A capsule becomes a cylinder and a sphere at each end. The namespace of a marker is the body's
    name, that of an arrow, ``ground`` for flat ground, or ``surface`` for any other that is struck.

    Attributes:
        scene: posed by :meth:`message`.
    """

    def __init__(self, setup: ImpactSetup) -> None:
        self.setup = setup
        self.scene = Scene(setup)
        self._parts = [_markers(shape) for shape in self.scene.shapes]
        surface = [marker for solid in drawn(setup.surface_config) for marker in _fixed(solid)]
        for marker in surface:
            marker.ns = GROUND if setup.surface_config.is_flat_ground else "surface"
        self._arrows = [_marker(Marker.ARROW, name, _ARROW, (0.0,) * 4) for name in FORCES]
        shapes = (marker for part in self._parts for marker in part)
        self._message = MarkerArray(markers=[*surface, *shapes, *self._arrows])
        for number, marker in enumerate(self._message.markers):
            marker.id = number

    def message(self, record: ImpactRecord, index: int, time_ns: int) -> MarkerArray:
        """The scene at one sample; the same object every time."""
        positions, quaternions = self.scene.poses(record, index)
        shapes = zip(
            self.scene.shapes, self._parts, positions.tolist(), quaternions.tolist(), strict=True
        )
        for shape, markers, position, quaternion in shapes:
            _place(shape, markers, position, quaternion)
        for marker, arrow in zip(self._arrows, force_arrows(record, index), strict=True):
            _point(marker, arrow)
        now = stamp(time_ns)
        for marker in self._message.markers:
            marker.header.stamp = now
        return self._message


def _fixed(solid: Primitive) -> list[Marker]:
    """The markers of a part of a surface, where it is."""
    position = solid.position
    if solid.kind == "plane":
        position = position - _PLATE[2] * solid.rotation[:, 2]
        solid = Primitive("box", _PLATE, position, solid.rotation)
    shape = SceneShape("", solid.kind, solid.size, _SURFACE_COLOR)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, solid.rotation.flatten())
    markers = _markers(shape)
    _place(shape, markers, position.tolist(), quaternion[[1, 2, 3, 0]].tolist())
    return markers


def _markers(shape: SceneShape) -> list[Marker]:
    a, b, c = shape.size
    if shape.kind == "ellipsoid":
        return [_marker(Marker.SPHERE, shape.name, (2 * a, 2 * b, 2 * c), shape.color)]
    if shape.kind == "sphere":
        return [_marker(Marker.SPHERE, shape.name, (2 * a,) * 3, shape.color)]
    if shape.kind == "box":
        return [_marker(Marker.CUBE, shape.name, (2 * a, 2 * b, 2 * c), shape.color)]
    tube = _marker(Marker.CYLINDER, shape.name, (2 * a, 2 * a, 2 * b), shape.color)
    if shape.kind == "cylinder":
        return [tube]
    caps = [_marker(Marker.SPHERE, shape.name, (2 * a,) * 3, shape.color) for _ in range(2)]
    return [tube, *caps]


def _place(
    shape: SceneShape, markers: list[Marker], position: list[float], quaternion: list[float]
) -> None:
    """Put the markers of one shape where it is; the quaternion is x, y, z, w."""
    x, y, z, w = quaternion
    turn = Quaternion(x=x, y=y, z=z, w=w)
    ends = [(0.0, 0.0, 0.0)]
    if shape.kind == "capsule":
        half = shape.size[1]
        axis = (2 * (x * z + w * y) * half, 2 * (y * z - w * x) * half,
                (1 - 2 * (x * x + y * y)) * half)  # fmt: skip
        ends += [axis, (-axis[0], -axis[1], -axis[2])]
    for marker, offset in zip(markers, ends, strict=True):
        a, b, c = (p + o for p, o in zip(position, offset, strict=True))
        marker.pose = Pose(position=Point(x=a, y=b, z=c), orientation=turn)


def _point(marker: Marker, arrow: Arrow) -> None:
    """Let a marker show a force, or nothing while there is none."""
    marker.action = Marker.ADD if arrow.visible else Marker.DELETE
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in (arrow.tail.tolist(), arrow.tip.tolist())]
    marker.color = ColorRGBA(**dict(zip("rgba", arrow.color, strict=True)))


def _marker(
    kind: int,
    name: str,
    size: tuple[float, float, float],
    color: tuple[float, float, float, float],
) -> Marker:
    x, y, z = size
    r, g, b, a = color
    marker = Marker(
        ns=name, type=kind, action=Marker.ADD,
        scale=Vector3(x=x, y=y, z=z), color=ColorRGBA(r=r, g=g, b=b, a=a),
    )  # fmt: skip
    marker.header.frame_id = "world"
    return marker
