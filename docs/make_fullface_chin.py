"""Make the helmet ``fullface_chin`` and its array file: ``fullface`` with eye port and chin bar.

    python docs/make_fullface_chin.py

Shell and foam are those of ``fullface``; above the eye port the surface is its ellipsoid. Port,
chin bar and rim are usual shapes of the trade, not those of a product.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np
import trimesh
import yaml
from numpy.typing import NDArray

from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study.helmets.importing import ImportPlan, import_helmet, write_helmet_folder

NAME = "fullface_chin"
FINENESS = 7  # 20 * 4^7 triangles: edges follow the port to 2 mm
PORT = (70.0, 17.0)  # deg, half width and half height of the eye port, seen from the head's centre
PORT_MIDDLE = -7.0  # deg, its elevation: the upper edge leaves room for point B
RIM = -0.120  # m, height below which there is no helmet
CHIN = (-36.0, 16.0, 50.0)  # deg: elevation of the chin bar, its half height, half width
BULGE = 0.17  # of the ellipsoid's radius, by which the chin bar stands out: room for the mouth
CHIN_LINER = 0.030  # m; usual 20 to 30 mm, thinner than on the skull


def directions(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuth and elevation of points [deg]."""
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    elevation = np.degrees(np.arcsin(points[:, 2] / np.linalg.norm(points, axis=1)))
    return azimuth, elevation


def bulge(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """1 in the middle of the chin bar, falling to 0 around it, (n,)."""
    azimuth, elevation = directions(points)
    return np.exp(-((azimuth / CHIN[2]) ** 4) - ((elevation - CHIN[0]) / CHIN[1]) ** 2)


def surface(semi_axes: NDArray[np.float64], chin: float) -> trimesh.Trimesh:
    """The ellipsoid with the chin bar standing out by a share of its radius, whole."""
    mesh = trimesh.creation.icosphere(FINENESS)
    mesh.vertices *= semi_axes
    mesh.vertices *= 1.0 + chin * bulge(mesh.vertices)[:, None]
    return mesh


def opened(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh without eye port and without what lies below the rim."""
    azimuth, elevation = directions(mesh.triangles_center)
    port = (azimuth / PORT[0]) ** 4 + ((elevation - PORT_MIDDLE) / PORT[1]) ** 4 < 1.0
    mesh.update_faces(~port & (mesh.triangles_center[:, 2] > RIM))
    return mesh


def main() -> None:
    """Write the helmet into ``config/helmets``."""
    base = load_helmet("fullface")
    outer = np.array(base.shell.semi_axes)
    thickness = base.liner.thickness
    with tempfile.TemporaryDirectory() as folder:
        shell, liner = Path(folder, "shell.ply"), Path(folder, "liner.ply")
        opened(surface(outer, BULGE)).export(shell)
        # The liner's inside: as far below the shell as the liner is thick there.
        inner = surface(outer, BULGE)
        depth = thickness + (CHIN_LINER - thickness) * bulge(inner.vertices)
        inner.vertices -= depth[:, None] * inner.vertex_normals
        inner.export(liner)
        plan = ImportPlan(
            units="m", origin=(0.0, 0.0, 0.0), mass=base.mass, areal_density=4.5, base="fullface"
        )
        path = write_helmet_folder(import_helmet(shell, liner, plan), Path(folder, NAME))
        target = share_directory() / "config" / "helmets"
        for old in target.glob(f"{NAME}*"):
            old.unlink()
        values = yaml.safe_load(path.read_text())
        values["description"] = (
            "fullface with an eye port of 140 x 34 deg, a chin bar with 30 to 38 mm of foam and a "
            "rim, "
            "made by docs/make_fullface_chin.py; usual shapes of the trade, not those of a product."
        )
        array = path.parent / values["geometry"]
        values["geometry"] = f"{NAME}-{array.stem.rpartition('-')[2]}.npz"
        shutil.copy(array, target / values["geometry"])
        text = yaml.safe_dump(values, sort_keys=False, allow_unicode=True)
        (target / f"{NAME}.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
