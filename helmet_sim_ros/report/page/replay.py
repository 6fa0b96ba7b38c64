"""The scene of an impact for the report's 3-D replay: shapes, and where they are over time."""

from __future__ import annotations

import hashlib

import numpy as np
from scipy.spatial import cKDTree

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.model.arrows import force_arrows
from helmet_sim_ros.model.scene import SceneShape, ShellMesh
from helmet_sim_ros.model.surface.drawing import Primitive, drawn
from helmet_sim_ros.report.page.crush import COLORS
from helmet_sim_ros.report.replay.scene import scene_of

#: Pictures of one replay.
FRAMES = 81
#: A helmet below this mass [kg] is drawn without a chin bar (a choice for the picture alone).
OPEN_FACE_MASS = 0.7


def replay_data(record: ImpactRecord) -> tuple[dict[str, object], dict[str, FloatArray]]:
    """Plain data and arrays for ``replay.js``.

    Returns:
        ``shapes`` (name, kind, size [m], cloth), ``face`` of the helmet, ``surface`` (kind, size,
        position, rotation row by row), ``names`` and ``arrowColors``; and the arrays ``time`` [ms],
        ``poses``: x, y, z, quaternion x, y, z, w of every shape, each over the frames, and
        ``arrows``: tail and tip of every force arrow, each over the frames. Of a helmet with a mesh
        also ``mesh``, its key in :func:`mesh_data`, and ``colors``; and the array ``crush``, the
        share of the most residual crush at each vertex.

    Raises:
        LogError: this version's model cannot show the record.
    """
    scene = scene_of(record)
    frames = np.unique(np.linspace(0, len(record) - 1, FRAMES).astype(int))
    poses, arrows = [], []
    for index in frames.tolist():
        poses.append(np.hstack(scene.poses(record, index)))
        arrows.append([np.hstack([a.tail, a.tip]) for a in force_arrows(record, index)])
    first = force_arrows(record, 0)
    open_face = scene.setup.helmet_config.mass < OPEN_FACE_MASS
    plain: dict[str, object] = {
        "shapes": [
            {"name": s.name, "kind": s.kind, "size": list(s.size), "cloth": _cloth(s)}
            for s in scene.shapes
        ],
        "face": "open" if open_face else "full",
        "surface": [_solid(solid) for solid in drawn(scene.setup.surface_config)],
        "arrowColors": [css_color(arrow.color) for arrow in first],
        "names": [arrow.name for arrow in first],
    }
    # Each component over time: neighbours differ little.
    arrays = {
        "time": record.time[frames] * 1e3,
        "poses": np.moveaxis(np.array(poses), 0, -1),
        "arrows": np.moveaxis(np.array(arrows), 0, -1),
    }
    if scene.mesh is not None:
        plain |= {"mesh": _key(scene.mesh), "colors": COLORS}
        center = np.array(scene.setup.helmet_config.shell.center)
        arrays["crush"] = _crush(record, scene.mesh.vertices + center)
    return plain, arrays


def mesh_data(record: ImpactRecord) -> tuple[str, dict[str, FloatArray]] | None:
    """Key and arrays of the mesh that :func:`replay_data` names; ``vertices`` x, y, z [m], each
    over all, ``faces`` in the same way. Impacts of one helmet share it; None: it has none.

    Raises:
        LogError: this version's model cannot show the record.
    """
    mesh = scene_of(record).mesh
    if mesh is None:
        return None
    return _key(mesh), {"vertices": mesh.vertices.T, "faces": mesh.faces.T.astype(float)}


def _key(mesh: ShellMesh) -> str:
    return hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()[:12]


def _crush(record: ImpactRecord, vertices: FloatArray) -> FloatArray:
    """Share of the most residual crush at places (v, 3) [m], of the nearest column."""
    residual, position = (record.extras.get(n) for n in ("residual_crush", "column_position"))
    nothing = np.zeros(len(vertices))
    if not isinstance(residual, np.ndarray) or not isinstance(position, np.ndarray):
        return nothing
    worst = float(residual.max(initial=0.0))
    if worst <= 0.0 or position.shape != (len(residual), 3):
        return nothing
    nearest: FloatArray = residual[cKDTree(position).query(vertices)[1]] / worst
    return nearest


def _cloth(shape: SceneShape) -> str:
    """What a part of the rider wears: a rider in a suit with gloves and boots."""
    if shape.name in ("helmet", "head"):
        return shape.name
    if shape.name.startswith(("hand", "foot")):
        return "leather"
    legs = shape.name.startswith(("thigh", "shank", "pelvis"))
    return "trousers" if legs else "jacket"


def _solid(solid: Primitive) -> dict[str, object]:
    return {
        "kind": solid.kind, "size": [float(v) for v in solid.size],
        "position": solid.position.tolist(), "rotation": solid.rotation.ravel().tolist(),
    }  # fmt: skip


def css_color(color: tuple[float, float, float, float]) -> str:
    """``rgba(204,38,38,1)``."""
    r, g, b = (round(255 * value) for value in color[:3])
    return f"rgba({r},{g},{b},{color[3]:g})"
