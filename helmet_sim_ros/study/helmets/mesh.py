"""Meshes of a helmet as a CAD system or scanner writes them: read, checked, in metres."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh, load_mesh
from trimesh.visual import ColorVisuals

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.study.helmets.crossings import crossings

SUFFIXES = (".stl", ".obj", ".ply")
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
#: Longest extent of a helmet, or of its liner [m]: bicycle helmets from 0.24 m, full-face ones to
#: 0.36 m, with room to both sides (general literature values). The ranges of any two units are
#: apart, so the size tells the unit.
SIZE = (0.18, 0.42)
logging.getLogger("trimesh").setLevel(logging.ERROR)


@dataclass(frozen=True)
class Part:
    """A mesh of a helmet in metres, in its file's axes.

    Attributes:
        path: of the file.
        mesh: vertices merged.
        unit: of the file.
        notes: what was found, in words.
    """

    path: Path
    mesh: Trimesh
    unit: str
    notes: tuple[str, ...]

    def moved(self, rotation: FloatArray, origin: FloatArray) -> Trimesh:
        """The mesh in the head frame: rotated, its ``origin`` [m] moved to zero."""
        mesh = self.mesh.copy()
        mesh.vertices = (self.mesh.vertices - origin) @ rotation.T
        return mesh


def read_part(path: Path, role: str, unit: str | None = None, intersecting: bool = False) -> Part:
    """A mesh file.

    Args:
        path: STL, OBJ or PLY.
        role: what an error calls it (``"shell"``).
        unit: of the file's numbers, one of ``UNITS``; unset: told by the size.
        intersecting: whether a mesh that intersects itself is told of and not refused.

    Raises:
        SetupError: no such file, no mesh, a truncated one, numbers that are not finite, a size
            that is no helmet's in the unit, or a mesh that intersects itself; names file and place.
    """
    mesh = _load(path, role)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    likely = [name for name, scale in UNITS.items() if SIZE[0] <= size * scale <= SIZE[1]]
    if unit is None:
        if not likely:
            raise SetupError.of(
                role, str(path), f"spans {size:.4g} in its own unit, which is no helmet "
                f"({SIZE[0]:g} to {SIZE[1]:g} m) in any of {', '.join(UNITS)}",
            )  # fmt: skip
        unit = likely[0]
    elif unit not in likely:
        hint = f"; its size fits {likely[0]}" if likely else ""
        raise SetupError.of(
            f"{role}.units", unit, f"{path} spans {size * UNITS[unit]:.4g} m in it, a helmet spans "
            f"{SIZE[0]:g} to {SIZE[1]:g} m{hint}",
        )  # fmt: skip
    mesh.apply_scale(UNITS[unit])  # type: ignore[no-untyped-call]
    notes = _findings(mesh, path, unit)
    if where := _crossed(mesh, unit):
        if not intersecting:
            raise SetupError.of(
                role, str(path), f"intersects itself: {where}; mend it, or take it as it is with "
                "--allow-intersections: what lies inside is hidden, thickness there may be wrong",
            )  # fmt: skip
        notes.append(f"{path.name}: intersects itself: {where}")
    return Part(path, mesh, unit, tuple(notes))


def _crossed(mesh: Trimesh, unit: str) -> str:
    """Where a mesh [m] intersects itself, in its file's unit; empty: nowhere."""
    found = crossings(mesh)
    if len(found.face) == 0:
        return ""
    numbers = np.sort([found.face[0], found.other[0]]) + 1
    place = ", ".join(f"{c / UNITS[unit]:.4g}" for c in found.place[0])
    return (
        f"triangle {numbers[0]} goes through {numbers[1]} of {len(mesh.faces)} at ({place}) "
        f"{unit}, and {len(found.face) - 1} more such places"
    )


def _load(path: Path, role: str) -> Trimesh:
    if path.suffix.lower() not in SUFFIXES:
        raise SetupError.of(role, str(path), f"must be one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise SetupError.of(role, str(path), "no such file")
    _whole(path, role)
    try:
        mesh = load_mesh(path, process=False)
    except Exception as error:  # the library raises what its parsers happen to raise
        raise SetupError.of(role, str(path), f"cannot be read: {error}") from error
    if not isinstance(mesh, Trimesh) or len(mesh.faces) == 0:
        raise SetupError.of(role, str(path), "holds no triangles")
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise SetupError.of(
            role, str(path), f"{len(bad)} vertices are not finite, the first is number {bad[0] + 1}"
        )
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    if len(mesh.faces) < 20:
        raise SetupError.of(role, str(path), f"has {len(mesh.faces)} triangles, too few")
    return mesh


def _whole(path: Path, role: str) -> None:
    """Refuse a file that ends early, where its format lets one see that."""
    content = path.read_bytes()
    if not content:
        raise SetupError.of(role, str(path), "is empty")
    if path.suffix.lower() == ".stl":
        head = content[:5].lower()
        size = 84 + 50 * int.from_bytes(content[80:84], "little") if len(content) >= 84 else -1
        if len(content) == size:
            return
        if head != b"solid":
            raise SetupError.of(
                role, str(path),
                f"is truncated: {len(content)} bytes of a binary STL, its header tells {size}"
                if size > 0 else f"is truncated: {len(content)} bytes, binary STL has 84 or more",
            )  # fmt: skip
        if b"endsolid" not in content[-400:].lower():
            raise SetupError.of(role, str(path), "is truncated: a text STL ends with 'endsolid'")


def _findings(mesh: Trimesh, path: Path, unit: str) -> list[str]:
    size = " x ".join(f"{1e3 * s:.0f}" for s in np.ptp(mesh.vertices, axis=0))
    notes = [f"{path.name}: {len(mesh.faces)} triangles, {size} mm, in {unit}"]
    if mesh.is_watertight:
        notes.append(f"{path.name}: closed, volume {1e6 * abs(mesh.volume):.0f} cm^3")
    else:
        edges = np.sort(mesh.edges, axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        notes.append(
            f"{path.name}: not closed, {int((count == 1).sum())} edges have one triangle, "
            f"{int((count > 2).sum())} more than two"
        )
    if not mesh.is_winding_consistent:
        notes.append(f"{path.name}: neighbouring triangles are wound against each other")
    return notes


def face_colors(mesh: Trimesh) -> NDArray[np.uint8] | None:
    """Colours of the triangles, (f, 3); None for a mesh without."""
    visual = mesh.visual
    if not isinstance(visual, ColorVisuals) or not visual.defined:
        return None
    colors: NDArray[np.uint8] = np.asarray(visual.face_colors)[:, :3]
    return colors
