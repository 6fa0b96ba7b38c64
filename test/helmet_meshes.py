"""Meshes of helmets for the tests: the ellipsoid of ``fullface``, whole or with a face opening."""

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.geometry import Geometry, write_geometry
from helmet_sim_ros.model.helmet import Helmet, load_helmet

OUTER = (0.150, 0.130, 0.140)  # m, fullface
INNER = (0.106, 0.086, 0.096)  # m, 44 mm inside
#: Columns of an analytic helmet to compare with, as many as the imported one has: what differs is
#: then the shape and not the size of the cells.
FINE = 4000


def ellipsoid(semi_axes: tuple[float, float, float], fineness: int = 6) -> trimesh.Trimesh:
    """A closed ellipsoid of 20 * 4^fineness triangles whose volume is the ellipsoid's [m]."""
    mesh = trimesh.creation.icosphere(fineness)
    mesh.vertices *= semi_axes
    volume = 4.0 / 3.0 * np.pi * np.prod(semi_axes)
    mesh.apply_scale((volume / mesh.volume) ** (1.0 / 3.0))
    return mesh


def in_opening(point: FloatArray) -> NDArray[np.bool_]:
    """Where the face opening is: in front, below the head's centre and above the chin."""
    opening: NDArray[np.bool_] = (
        (point[:, 0] > 0.03) & (np.abs(point[:, 1]) < 0.09) & (np.abs(point[:, 2] + 0.06) < 0.03)
    )
    return opening


def opened(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh without the triangles of the face opening."""
    mesh = mesh.copy()
    mesh.update_faces(~in_opening(mesh.triangles_center))
    return mesh


def written(mesh: trimesh.Trimesh, path: Path, unit: float = 1e-3) -> Path:
    """The mesh in a file, its numbers in a unit [m]."""
    mesh = mesh.copy()
    mesh.apply_scale(1.0 / unit)
    mesh.export(path)
    return path


def fine_fullface() -> Helmet:
    """``fullface`` as a foam helmet with ``FINE`` columns."""
    changes = {"liner.columns": FINE, "coupling": "foam"}
    return load_helmet("fullface").replaced(changes)  # type: ignore[no-any-return]


def analytic_with_opening(folder: Path) -> Helmet:
    """``fullface`` without the columns in the face opening."""
    helmet = fine_fullface()
    c = columns(helmet)
    kept = ~in_opening(c.point)
    count, thickness = int(kept.sum()), helmet.liner.thickness
    geometry = Geometry(
        c.point[kept], c.normal[kept], c.area[kept], c.thickness[kept],
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.array(OUTER), np.zeros(3),
        np.array([thickness, 0.0, 0.0, 0.0]), np.array(thickness),
        ellipsoid(OUTER, 2).vertices.copy(), ellipsoid(OUTER, 2).faces.astype(np.int32),
    )  # fmt: skip
    path = write_geometry(geometry, folder, "opened")
    return helmet.replaced({"geometry": str(path), "liner.columns": count})  # type: ignore[no-any-return]
