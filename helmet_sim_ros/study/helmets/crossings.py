"""Where a mesh passes through itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from trimesh import Trimesh

from helmet_sim_ros.biomech.record import FloatArray

DEPTH = 1e-5  # m, by which both ends of an edge lie off a triangle that it pierces: less is a touch
CLEAR = 1e-4  # share of an edge that is left out at either end, where it meets its neighbours
SIZE = 100.0  # extent of the mesh in the numbers of single precision that Embree works with
ROUNDING = 2e-5  # of these numbers: some units in the last place of 50


class Crossings(NamedTuple):
    """Edges that pierce triangles; row i of each belongs to one of them.

    Attributes:
        face: a triangle with the edge, (n,).
        other: the triangle that it pierces, (n,).
        place: where, (n, 3) [m].
    """

    face: NDArray[np.int64]
    other: NDArray[np.int64]
    place: FloatArray


def crossings(mesh: Trimesh) -> Crossings:
    """Every edge of a mesh that goes through one of its triangles.

    Two triangles that intersect without lying in one plane do so at an edge of one of them, so a
    mesh without such edges does not intersect itself, but for parts that cover each other exactly.
    Embree finds the triangles along each edge; the test of each is in double precision.

    Args:
        mesh: vertices merged [m].
    """
    edges, (corner, normal) = mesh.edges_unique, (mesh.triangles[:, 0], mesh.face_normals)
    scale = SIZE / mesh.scale
    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, (mesh.vertices * scale).astype(np.float32), mesh.faces.astype(np.int32))
    start = mesh.vertices[edges[:, 0]]
    way = mesh.vertices[edges[:, 1]] - start
    length = np.linalg.norm(way, axis=1)
    live = np.flatnonzero(length > 2.0 * DEPTH)
    at, step = np.full(len(edges), CLEAR), ROUNDING / (scale * np.maximum(length, DEPTH))
    pairs = []
    # A ray along an edge may also meet the triangles that share it: go on behind each hit.
    while len(live):
        origin = (start[live] + at[live, None] * way[live]) * scale
        rest = 1.0 - CLEAR - at[live]
        hit = scene.run(
            origin.astype(np.float32), (way[live] * scale).astype(np.float32),
            rest.astype(np.float32), output=True,
        )  # fmt: skip
        met = (hit["primID"] >= 0) & (hit["primID"] < len(mesh.faces))
        edge, face = live[met], hit["primID"][met].astype(np.int64)
        apart = ~(mesh.faces[face][:, :, None] == edges[edge][:, None, :]).any(axis=(1, 2))
        pairs.append(np.column_stack([edge[apart], face[apart]]))
        at[edge] += np.maximum(hit["tfar"][met], 0.0) + step[edge]
        live = edge[at[edge] < 1.0 - CLEAR]
    edge, other = np.unique(np.concatenate([np.zeros((0, 2), int), *pairs]), axis=0).T
    before = np.einsum("ij,ij->i", start[edge] - corner[other], normal[other])
    after = before + np.einsum("ij,ij->i", way[edge], normal[other])
    through = (before * after < 0.0) & (np.minimum(abs(before), abs(after)) > DEPTH)
    edge, other, before, after = edge[through], other[through], before[through], after[through]
    place = start[edge] + (before / (before - after))[:, None] * way[edge]
    with_edge = np.empty(len(edges), dtype=np.int64)
    with_edge[mesh.edges_unique_inverse] = mesh.edges_face
    return Crossings(with_edge[edge], other, place)
