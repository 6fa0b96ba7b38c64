"""What an impact looks like: the shapes of rider, helmet and ground, and where they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.force.columns import as_now
from helmet_sim_ros.model.geometry import read_geometry
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.placement import place_head
from helmet_sim_ros.model.rider.neck import named_today
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.state import read_state
from helmet_sim_ros.model.surface.drawing import Primitive, drawn
from helmet_sim_ros.model.world import build, specified

_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
}
_HEAD_SIZE = (0.095, 0.075, 0.115)  # m, semi-axes of the drawn head (it carries no contact)


@dataclass(frozen=True)
class SceneShape:
    """One shape to draw.

    Attributes:
        name: of the body it belongs to.
        kind: ``ellipsoid`` (size: semi-axes) or ``capsule`` (size: radius, half length along z, 0).
        size: [m].
        color: red, green, blue, opacity.
    """

    name: str
    kind: str
    size: tuple[float, float, float]
    color: tuple[float, float, float, float]


class ShellMesh(NamedTuple):
    """The outer surface of a helmet that was measured or drawn, in the frame of its shape.

    Attributes:
        vertices: (v, 3) [m].
        faces: triangles, outward by the right hand, (f, 3).
    """

    vertices: FloatArray
    faces: NDArray[np.int32]


def shell_mesh(helmet: Helmet) -> ShellMesh | None:
    """The drawing of a helmet's ``geometry``; None: its shell is the ellipsoid."""
    if helmet.geometry is None or helmet.coupling == "none":
        return None
    geometry = read_geometry(helmet.geometry)
    vertices = as_now(helmet, geometry, geometry.vertices) - np.array(helmet.shell.center)
    return ShellMesh(vertices, geometry.faces)


class Scene:
    """The shapes of one setup, posed from a record (live, or read from a log).

    Attributes:
        setup: the impact setup, or the fall.
        shapes: what to draw of rider and helmet; what surrounds them gives :meth:`around`.
        mesh: stands for the ellipsoid ``helmet`` of ``shapes`` where it can be drawn; None: the
            helmet is that ellipsoid.
        model, data: MuJoCo's, posed by :meth:`pose`; for renderers. The model holds ``mesh`` as
            asset 0.
    """

    def __init__(self, setup: ImpactSetup | Fall) -> None:
        self.setup = setup
        state = None if isinstance(setup, Fall) else setup.state
        self._began = 0.0 if state is None else read_state(state).time
        world = build(setup, setup.helmet_config)
        self.model, self.data = world.parts.model, world.data
        self.mesh = shell_mesh(setup.helmet_config)
        if self.mesh is not None:
            spec = specified(world.parts.plan)
            spec.add_mesh(
                name="shell", uservert=self.mesh.vertices.ravel(),
                userface=self.mesh.faces.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )  # fmt: skip
            self.model = spec.compile()
            self.data = mujoco.MjData(self.model)
        self._layout = world.parts.structure.layout
        model = self.model
        self._geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] != 0]
        parts = [
            SceneShape(
                model.body(model.geom_bodyid[g]).name,
                _KINDS[int(model.geom_type[g])],
                tuple(float(v) for v in model.geom_size[g]),  # type: ignore[arg-type]
                tuple(float(v) for v in model.geom_rgba[g]),  # type: ignore[arg-type]
            )
            for g in self._geoms
        ]
        head = SceneShape("head", "ellipsoid", _HEAD_SIZE, (0.85, 0.70, 0.60, 1.0))
        self.shapes = (head, *parts)

    @property
    def is_still(self) -> bool:
        """Whether nothing of :meth:`around` moves."""
        return not any(any(part.velocity) for part in self.setup.surface_config.shapes)

    def around(self, time: float = 0.0) -> list[Primitive]:
        """The solids around the rider at a time of the record [s]."""
        return drawn(self.setup.surface_config, self._began + time)

    def pose(self, record: ImpactRecord, index: int) -> None:
        """Put ``data`` into the pose of one sample of a record of this setup."""
        qpos, model = self.data.qpos, self.model
        turn = record.head_orientation[index][[3, 0, 1, 2]]
        first = self._layout.fit
        if first >= 0:  # all of the helmet's motion on the head in the joints of its fit
            away = record.helmet_position[index] - record.head_position[index]
            back = np.empty(4)
            mujoco.mju_negQuat(back, turn)
            mujoco.mju_rotVecQuat(qpos[first : first + 3], away, back)
            helmet = record.helmet_orientation[index][[3, 0, 1, 2]]
            mujoco.mju_mulQuat(qpos[first + 3 : first + 7], back, helmet)
        joints, positions = named_today(record.joint_names, record.joint_positions[index])
        self._layout.pose(qpos, joints, positions)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, turn)
        place_head(model, self.data, record.head_position[index], rotation.reshape(3, 3))

    def poses(self, record: ImpactRecord, index: int) -> tuple[FloatArray, FloatArray]:
        """Positions (n, 3) [m] and orientations x, y, z, w (n, 4) of ``shapes``, world axes."""
        self.pose(record, index)
        head = self.data.body("head")
        positions = np.vstack([head.xpos, self.data.geom_xpos[self._geoms]])
        quaternions = np.empty((len(self.shapes), 4))
        quaternions[0] = head.xquat
        for row, geom in enumerate(self._geoms, start=1):
            mujoco.mju_mat2Quat(quaternions[row], self.data.geom_xmat[geom])
        return positions, quaternions[:, [1, 2, 3, 0]]
