"""Triangle meshes of what a scene consists of, and of a helmet with its openings."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.scene import shell_mesh

#: A helmet below this mass [kg] is drawn without a chin bar (a choice for the picture alone).
OPEN_FACE_MASS = 0.7
#: Half widths of the eye port of a full-face helmet and its middle, azimuth and elevation [deg],
#: and how square it is; how far down shell and liner reach [share of the vertical semi-axis];
#: thickness of the wall, and how far the visor lies inside [share of the radius]; how flat the ends
#: of a part of the trunk are. Choices for the picture alone.
_PORT, _PORT_MIDDLE, _SQUARENESS = (72.0, 21.0), 4.0, 4.0
_RIM_FULL, _RIM_OPEN = -0.86, -0.22
_OPEN_FACE_RISE = 0.34
_FLAT = 0.55
_WALL, _SUNK = 0.08, 0.02


class Mesh(NamedTuple):
    """Vertices (n, 3) [m] and faces (m, 3), counter-clockwise seen from outside."""

    vertices: FloatArray
    faces: NDArray[np.int64]


def sphere(rows: int = 18, columns: int = 28) -> Mesh:
    """The unit sphere."""
    elevation = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rows + 1)
    azimuth = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    e, a = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
    vertices = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return Mesh(vertices, _quads(rows, columns))


def ellipsoid(axes: tuple[float, float, float]) -> Mesh:
    """An ellipsoid with these semi-axes [m]."""
    unit = sphere()
    return Mesh(unit.vertices * np.array(axes), unit.faces)


def rounded(axes: tuple[float, float, float]) -> Mesh:
    """An ellipsoid with flatter ends, so that a trunk of several reads as one body."""
    unit = sphere()
    x, y, z = unit.vertices.T
    level = np.sign(z) * np.abs(z) ** _FLAT
    across = np.sqrt(np.clip(1.0 - np.abs(level) ** (2.0 / _FLAT), 0.0, 1.0)) ** _FLAT
    share = across / np.maximum(np.hypot(x, y), 1e-9)
    return Mesh(np.column_stack([x * share, y * share, level]) * np.array(axes), unit.faces)


def capsule(radius: float, half_length: float) -> Mesh:
    """A capsule along z."""
    unit = sphere(12, 18)
    shift = np.where(unit.vertices[:, 2:] > 0.0, half_length, -half_length)
    shift[np.abs(unit.vertices[:, 2]) < 1e-12] = 0.0  # the middle row joins both halves
    vertices = radius * unit.vertices
    vertices[:, 2:] += shift
    return Mesh(vertices, unit.faces)


def box(half: tuple[float, float, float]) -> Mesh:
    """A box with these half edges [m]."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
             [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    return Mesh(signs * np.array(half), np.array(faces))


def cylinder(radius: float, half_length: float, columns: int = 36) -> Mesh:
    """A cylinder along z."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    rings = [(0.0, -1.0), (1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (1.0, 1.0), (0.0, 1.0)]
    vertices = [
        np.column_stack(
            [radius * r * np.cos(azimuth), radius * r * np.sin(azimuth),
             np.full(columns, half_length * z)]
        ) for r, z in rings
    ]  # fmt: skip
    return Mesh(np.vstack(vertices), _quads(len(rings) - 1, columns))


class HelmetMesh(NamedTuple):
    """A helmet about the origin of its frame: shell with its inside, visor, and the edges.

    ``visor`` has no faces for an open helmet.
    """

    shell: Mesh
    visor: Mesh


def helmet_mesh(helmet: Helmet) -> HelmetMesh:
    """A helmet of its own geometry; or with the semi-axes of its shell, and openings that are drawn
    and not simulated."""
    axes, center = np.array(helmet.shell.semi_axes), np.array(helmet.shell.center)
    own = shell_mesh(helmet)
    if own is not None:
        nothing = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
        return HelmetMesh(Mesh(own.vertices + center, own.faces.astype(np.int64)), nothing)
    parts = _unit_helmet(helmet.mass < OPEN_FACE_MASS)
    return HelmetMesh(*(Mesh(part.vertices * axes + center, part.faces) for part in parts))


@lru_cache(maxsize=2)
def _unit_helmet(open_face: bool) -> HelmetMesh:
    """A helmet whose shell has semi-axes of 1."""
    unit = sphere(48, 72)
    x, y, z = unit.vertices.T
    if open_face:
        # Higher over the face than over the nape.
        kept = z - (_RIM_OPEN + _OPEN_FACE_RISE * np.clip(x + 0.1, 0.0, None))
        inside_port = np.full(len(z), -1.0)
    else:
        azimuth = np.degrees(np.arctan2(y, x))
        elevation = np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))) - _PORT_MIDDLE
        port = (np.abs(azimuth) / _PORT[0]) ** _SQUARENESS
        port += (np.abs(elevation) / _PORT[1]) ** _SQUARENESS
        kept, inside_port = np.minimum(port - 1.0, z - _RIM_FULL), 1.0 - port
    outer = _clipped(unit, kept)
    vertices = np.vstack([outer.vertices, outer.vertices * (1.0 - _WALL)])
    edges, n = np.array(_open_edges(outer.faces)), len(outer.vertices)
    # The rim has vertices of its own, so that its edges are drawn sharp.
    border = np.vstack([vertices[edges.ravel()], vertices[edges.ravel() + n]])
    m, count = len(vertices), edges.size
    a = m + np.arange(0, count, 2)
    rim = np.vstack(
        [np.column_stack([a + 1, a, a + count]), np.column_stack([a + 1, a + count, a + 1 + count])]
    )
    faces = np.vstack([outer.faces, outer.faces[:, ::-1] + n, rim])
    vertices = np.vstack([vertices, border])
    glass = _clipped(unit, inside_port)
    return HelmetMesh(Mesh(vertices, faces), Mesh(glass.vertices * (1.0 - _SUNK), glass.faces))


def disc(columns: int = 12) -> Mesh:
    """The unit disc, its normal along z."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    ring = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(columns)])
    faces = [[0, 1 + i, 1 + (i + 1) % columns] for i in range(columns)]
    return Mesh(np.vstack([np.zeros((1, 3)), ring]), np.array(faces))


def _quads(rows: int, columns: int) -> NDArray[np.int64]:
    """Triangles of a grid whose columns close to a ring."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    k = (j + 1) % columns
    a, b, c, d = i * columns + j, i * columns + k, (i + 1) * columns + k, (i + 1) * columns + j
    faces: NDArray[np.int64] = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return faces


def _clipped(mesh: Mesh, kept: FloatArray) -> Mesh:
    """The part of a mesh where ``kept`` (n,) is above 0, cut along the line where it is 0."""
    vertices = list(mesh.vertices)
    cuts: dict[tuple[int, int], int] = {}
    faces: list[tuple[int, int, int]] = []

    def cut(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in cuts:
            share = kept[a] / (kept[a] - kept[b])
            point = mesh.vertices[a] + share * (mesh.vertices[b] - mesh.vertices[a])
            vertices.append(point / np.linalg.norm(point))
            cuts[key] = len(vertices) - 1
        return cuts[key]

    inside = kept > 0.0
    for face in mesh.faces[inside[mesh.faces].any(axis=1)].tolist():
        ring: list[int] = []
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            if inside[a]:
                ring.append(a)
            if inside[a] != inside[b]:
                ring.append(cut(a, b))
        faces += [(ring[0], ring[i], ring[i + 1]) for i in range(1, len(ring) - 1)]
    used = np.unique(np.array(faces, dtype=int).reshape(-1, 3))
    number = np.zeros(len(vertices), dtype=int)
    number[used] = np.arange(len(used))
    return Mesh(
        np.array(vertices)[used].reshape(-1, 3), number[np.array(faces, dtype=int).reshape(-1, 3)]
    )


def _open_edges(faces: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Edges that belong to one face only, in the sense of this face."""
    edges = [(a, b) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)]
    count = Counter((min(edge), max(edge)) for edge in edges)
    return [(a, b) for a, b in edges if a != b and count[min(a, b), max(a, b)] == 1]
