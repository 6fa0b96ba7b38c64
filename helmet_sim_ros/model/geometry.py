"""The shape of a helmet that was measured or drawn: an array file beside the helmet's YAML.

``helmet-sim helmet import`` writes it from meshes. Its name ends in a digest of its content, so a
helmet's configuration, everything that is cached by it and every log tell one content from another.
"""

from __future__ import annotations

import hashlib
import io
import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.resources import find_config

DIGITS = 16  # of the digest in a file's name
NAME = re.compile(rf"-([0-9a-f]{{{DIGITS}}})\.npz$")
ZONES = ("front", "back", "side", "top")
LARGEST = 50e6  # bytes, packed and unpacked; a file of 20 000 columns and a drawing has about 3e6


class Geometry(NamedTuple):
    """A helmet's outer surface as cells, with the liner below each; head frame.

    Attributes:
        point: middle of each cell, (n, 3) [m].
        normal: outward, of the sum of its triangles' vector areas, (n, 3).
        area: the amount of that sum, (n,) [m^2].
        thickness: of the liner below it, (n,) [m].
        weight: share of the zones front, back, side and top in each cell, (n, 4).
        semi_axes, center: of the ellipsoid fitted to the cells, (3,) [m].
        zone_thickness: mean of each zone's thickness, (4,) [m]; 0 where a zone has no cell.
        mean_thickness: over the area, () [m].
        vertices: of a drawing of the outer surface, (v, 3) [m].
        faces: its triangles, (f, 3).
    """

    point: FloatArray
    normal: FloatArray
    area: FloatArray
    thickness: FloatArray
    weight: FloatArray
    semi_axes: FloatArray
    center: FloatArray
    zone_thickness: FloatArray
    mean_thickness: FloatArray
    vertices: FloatArray
    faces: NDArray[np.int32]


#: Geometries of :func:`admit`, by their digest.
_admitted: dict[str, Geometry] = {}

SHAPES = {
    "point": ("n", 3), "normal": ("n", 3), "area": ("n",), "thickness": ("n",),
    "weight": ("n", 4), "semi_axes": (3,), "center": (3,), "zone_thickness": (4,),
    "mean_thickness": (), "vertices": ("v", 3), "faces": ("f", 3),
}  # fmt: skip


def write_geometry(geometry: Geometry, folder: Path, stem: str) -> Path:
    """Write ``STEM-DIGEST.npz`` into a folder; the same content gives the same name."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **geometry._asdict())
    content = buffer.getvalue()
    path = folder / f"{stem}-{_digest(content)}.npz"
    path.write_bytes(content)
    return path


def read_geometry(path: str) -> Geometry:
    """The geometry in a file, or of :func:`admit` where there is no such file.

    Raises:
        SetupError: no such file, a content that is not the one its name tells, or not a geometry;
            names the file.
    """
    try:
        found = find_config("helmets", path, "geometry", ".npz")
    except SetupError:
        if not NAME.search(path) or geometry_digest(path) not in _admitted:
            raise
        return _admitted[geometry_digest(path)]
    try:
        status = found.stat()
    except OSError as error:
        raise SetupError.of("geometry", path, f"cannot be read: {error.strerror}") from error
    return _read(str(found), status.st_mtime_ns, status.st_size)


def geometry_digest(path: str) -> str:
    """The digest in the name of a geometry's file, which tells its content."""
    named = NAME.search(path)
    if named is None:
        raise SetupError.of(
            "geometry", path, "must be a file that 'helmet-sim helmet import' wrote, "
            f"NAME-DIGEST.npz with {DIGITS} digits",
        )  # fmt: skip
    return named[1]


def admit(name: str, content: bytes) -> None:
    """Let :func:`read_geometry` know a file that is not on this machine, but in a log.

    Args:
        name: of the file, without its folder.
        content: its bytes.

    Raises:
        SetupError: as :func:`read_geometry`.
    """
    geometry = _parsed(name, content)
    _admitted[_digest(content)] = geometry


@lru_cache(maxsize=16)
def _read(path: str, _mtime_ns: int, size: int) -> Geometry:
    if size > LARGEST:
        raise SetupError.of("geometry", path, f"has {size} bytes, at most {LARGEST:g} are read")
    return _parsed(path, Path(path).read_bytes())


def _parsed(path: str, content: bytes) -> Geometry:
    if _digest(content) != geometry_digest(path):
        raise SetupError.of(
            "geometry", path, "its content is not what its name tells: truncated or edited; "
            "import the helmet again",
        )  # fmt: skip
    try:
        with ZipFile(io.BytesIO(content)) as packed:
            size = sum(member.file_size for member in packed.infolist())
        if size > LARGEST:
            raise SetupError.of("geometry", path, f"unpacks to {size} bytes, at most {LARGEST:g}")
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            geometry = Geometry(**{name: arrays[name] for name in Geometry._fields})
    except SetupError:
        raise
    except (KeyError, ValueError, OSError, MemoryError, BadZipFile) as error:
        raise SetupError.of("geometry", path, f"is no helmet geometry: {error}") from error
    _check(geometry, path)
    for array in geometry:
        array.setflags(write=False)
    return geometry


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:DIGITS]


def _check(geometry: Geometry, path: str) -> None:
    """Refuse arrays of a wrong shape, or values that no helmet has."""
    sizes: dict[str, int] = {}
    for name, shape in SHAPES.items():
        array = getattr(geometry, name)
        fits = array.ndim == len(shape) and all(
            length == (sizes.setdefault(want, length) if isinstance(want, str) else want)
            for want, length in zip(shape, array.shape, strict=True)
        )
        if not fits:
            raise SetupError.of(f"geometry.{name}", array.shape, f"must have shape {shape}", path)
        if not np.isfinite(array).all():
            raise SetupError.of(f"geometry.{name}", "nan or infinity", "must be finite", path)
    for name in ("area", "thickness", "semi_axes"):
        if not (getattr(geometry, name) > 0.0).all():
            raise SetupError.of(f"geometry.{name}", "0 or less", "must be above 0", path)
    if not np.allclose(np.linalg.norm(geometry.normal, axis=1), 1.0, atol=1e-6):
        raise SetupError.of("geometry.normal", "other lengths", "must have length 1", path)
