"""A helmet from meshes: outer shell and liner become a helmet file and its array file."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from pydantic import Field
from trimesh import Trimesh

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.geometry import ZONES, Geometry, write_geometry
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.identified import identified
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.study.helmets.cells import Cells, cells_of, fitted_ellipsoid, outer_surface
from helmet_sim_ros.study.helmets.mass import MassProperties, mass_properties
from helmet_sim_ros.study.helmets.mesh import UNITS, Part, face_colors, read_part
from helmet_sim_ros.study.helmets.orientation import by_axes, by_landmarks
from helmet_sim_ros.study.helmets.regions import parsed, zone_means, zoned_cells
from helmet_sim_ros.study.helmets.thickness import (
    THINNEST,
    check_head,
    filled,
    headform,
    measured,
    to_the_head,
)

DRAWN = 2000  # triangles of the drawing in reports and replays
MOSTLY = 0.5
#: A helmet's mass over that of its shell and liner: straps, padding and visor weigh as much at
#: most, and densities that are twice too high are not those of the helmet (a choice).
WEIGHED = (0.5, 2.0)
WALL = (0.0, 0.01)  # m, that a shell's material may have


class ImportPlan(Config):
    """What the meshes do not tell."""

    units: str | None = None
    forward: str = "x"
    up: str = "z"
    landmarks: dict[str, tuple[float, float, float]] = Field(default_factory=dict)
    origin: tuple[float, float, float] | None = None
    headform: str = "J"
    thickness: float | None = quantity(
        "of the liner without an inner mesh; unset: down to the headform and its padding",
        "m", None, ge=0.01, le=0.08,
    )  # fmt: skip
    zones: tuple[str, ...] = ()
    columns: int = quantity("cells of the outer surface", "-", 1000, ge=50, le=20000)
    mass: float | None = quantity(
        "of the whole helmet, from the scale; unset: of shell and liner", "kg", None, gt=0.0, le=4.0
    )
    areal_density: float = quantity(
        "mass of the shell per area: 3 mm of glass-fibre composite (general literature value)",
        "kg/m^2", 4.5, ge=0.0, le=20.0,
    )  # fmt: skip
    density: float | None = quantity(
        "of the foam; unset: that of the base helmet", "kg/m^3", None, ge=15.0, le=120.0
    )
    base: str = "fullface"
    intersecting: bool = False


@dataclass(frozen=True)
class ImportedHelmet:
    """A helmet whose array file is not written yet.

    Attributes:
        values: of the helmet, without ``geometry``.
        geometry: its cells.
        notes: what was found and decided, in words.
    """

    values: Mapping[str, object]
    geometry: Geometry
    notes: tuple[str, ...]


def import_helmet(shell: Path, liner: Path | None, plan: ImportPlan) -> ImportedHelmet:
    """Make a helmet of a shell and the inside of its liner.

    Args:
        shell: mesh of the outer surface, or of the solid shell.
        liner: mesh of the solid liner or of its inner surface; None: see ``plan.thickness``.
        plan: what the meshes do not tell.

    Raises:
        SetupError: a mesh or value that cannot be used; names file, key and place.
    """
    parts = [read_part(shell, "shell", plan.units, plan.intersecting)]
    if liner is not None:
        parts.append(read_part(liner, "liner", plan.units or parts[0].unit, plan.intersecting))
    notes = [note for part in parts for note in part.notes]
    outer, *inner = _in_head_frame(parts, plan, notes)
    surface = outer_surface(outer, str(shell))
    if surface.turned > MOSTLY:
        notes.append(f"{shell.name}: inside out, its triangles face the head; they were turned")
    elif surface.turned > 0.0:
        notes.append(f"{shell.name}: {100 * surface.turned:.1f} % of its outer triangles were "
                     "wound inwards; they were turned")  # fmt: skip
    cells = cells_of(surface, plan.columns)
    colors = face_colors(outer)
    weight = zoned_cells(
        cells, surface, parsed(plan.zones), None if colors is None else colors[surface.source]
    )
    base = load_helmet(plan.base)
    head = headform(plan.headform)
    depths = measured(cells, outer, inner[0] if inner else None, str(liner))
    thickness = depths.liner
    if not inner:
        if plan.thickness is not None:
            thickness = np.full(len(cells.area), plan.thickness)
        else:
            thickness = to_the_head(cells, head, depths.shell, base.padding.thickness)
    thickness, missing = filled(thickness, cells)
    thin = thickness < THINNEST
    thickness = np.maximum(thickness, THINNEST)
    gap = check_head(cells, depths.shell + thickness, head, plan.headform)
    mean = float(np.average(thickness, weights=cells.area))
    axes, center = fitted_ellipsoid(surface, base.padding.lowest)
    density = base.liner.density if plan.density is None else plan.density
    weighed = mass_properties(
        cells, depths.shell, thickness, np.full(len(thickness), density), plan.areal_density
    )
    _check_mass(weighed, plan, density)
    whole = weighed if plan.mass is None else weighed.scaled(plan.mass)
    notes += _told(cells, thickness, gap, plan.headform, missing, int(thin.sum()))
    notes.append(
        f"mass: shell {weighed.shell:.3f} kg at {plan.areal_density:g} kg/m^2 and liner "
        f"{weighed.liner:.3f} kg at {density:g} kg/m^3"
        + (f", corrected to the scale's {plan.mass:g} kg" if plan.mass else
           "; straps, padding and visor are not in the meshes: give the scale's mass")
    )  # fmt: skip
    place = ", ".join(f"{1e3 * c:.0f}" for c in whole.center)
    notes.append(f"mass centre at ({place}) mm, head axes")
    drawing = _drawing(outer)
    values = base.model_dump()
    values |= {
        "description": f"Imported from {', '.join(part.path.name for part in parts)}; foam, "
        f"padding and strap of {plan.base}.",
        "mass": whole.shell + whole.liner,
        "inertia": tuple(whole.inertia.tolist()),
        "mass_center": tuple(whole.center.tolist()),
        "coupling": "foam",
    }
    values["shell"] |= {"semi_axes": tuple(axes.tolist()), "center": tuple(center.tolist())}
    solid = depths.shell[depths.shell > 0.0]
    if len(solid) > MOSTLY * len(depths.shell):
        wall = float(np.clip(np.median(solid), *WALL))
        values["shell"]["material"]["thickness"] = wall
        notes.append(f"shell {1e3 * wall:.1f} mm thick; what it is made of is that of {plan.base}")
    for zone in ZONES:
        values["liner"][zone] = dict.fromkeys(values["liner"][zone])
    values["liner"] |= {"thickness": mean, "density": density, "columns": len(cells.area)}
    geometry = Geometry(
        cells.point, cells.normal, cells.area, thickness, weight, axes, center,
        zone_means(weight, cells.area, thickness), np.array(mean),
        np.asarray(drawing.vertices, dtype=float), np.asarray(drawing.faces, dtype=np.int32),
    )  # fmt: skip
    Helmet.from_mapping(values, str(shell))
    return ImportedHelmet(values, geometry, tuple(notes))


def write_helmet_folder(imported: ImportedHelmet, folder: Path) -> Path:
    """Write ``helmet.yaml`` and its array file into a new folder; all of it or nothing.

    Returns:
        The helmet's file.

    Raises:
        SetupError: the folder exists, or cannot be written.
    """
    if folder.exists():
        raise SetupError.of("output", str(folder), "exists already; choose a new folder")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise SetupError.of("output", str(folder), f"cannot be written: {error}") from error
    try:
        array = write_geometry(imported.geometry, unfinished, "geometry")
        values = {**imported.values, "geometry": str(array)}
        helmet = Helmet.from_mapping(values, str(folder))
        values |= {"geometry": array.name, "spring": identified(helmet).model_dump()}
        text = "".join(f"# {note}\n" for note in imported.notes)
        text += yaml.safe_dump(_plain(values), sort_keys=False, allow_unicode=True)
        (unfinished / "helmet.yaml").write_text(text, encoding="utf-8")
        load_helmet(str(unfinished / "helmet.yaml"))
        unfinished.chmod(0o777 & ~_umask())
        unfinished.rename(folder)
    except OSError as error:
        raise SetupError.of("output", str(folder), f"cannot be written: {error}") from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return folder / "helmet.yaml"


def _in_head_frame(parts: list[Part], plan: ImportPlan, notes: list[str]) -> list[Trimesh]:
    """The meshes, turned and moved so that the head's centre is their origin."""
    scale = UNITS[parts[0].unit]
    if plan.landmarks:
        points = {name: np.array(point) * scale for name, point in plan.landmarks.items()}
        rotation = by_landmarks(points)
    else:
        rotation = by_axes(plan.forward, plan.up)
    if plan.origin is not None:
        origin = np.array(plan.origin) * scale
    else:
        inner = parts[-1].mesh
        low, high = inner.bounds
        origin = np.zeros(3)
        if not ((low < -0.04) & (high > 0.04)).all():
            # The head's centre of gravity: in the middle of the opening from front to back and
            # from side to side, and as far below the crown as the headform's.
            up = rotation[2]
            middle = 0.5 * (low + high)
            crown = float((inner.vertices @ up).max())
            gap = 0.0 if len(parts) > 1 else 0.045  # of a liner that is not drawn
            depth = float(headform(plan.headform)[2]) + gap
            origin = middle + (crown - depth - middle @ up) * up
            notes.append(
                "the meshes' origin lies outside the helmet: the head's centre was put at "
                f"{', '.join(f'{c / scale:.4g}' for c in origin)} {parts[0].unit};"
                " --origin moves it"
            )
    return [part.moved(rotation, origin) for part in parts]


def _check_mass(parts: MassProperties, plan: ImportPlan, density: float) -> None:
    """Refuse a mass of the scale that shell and liner, as told, cannot have."""
    low, high = (share * (parts.shell + parts.liner) for share in WEIGHED)
    if plan.mass is not None and not low <= plan.mass <= high:
        raise SetupError.of(
            "mass", plan.mass,
            f"must be from {low:.2f} to {high:.2f} kg, half to twice what the meshes weigh: "
            f"{parts.shell:.2f} kg of shell with areal_density = {plan.areal_density:g} and "
            f"{parts.liner:.2f} kg of liner with density = {density:g}; give those of the helmet",
        )  # fmt: skip


def _told(
    cells: Cells, thickness: FloatArray, gap: float, size: str, missing: int, thin: int
) -> list[str]:
    low, middle, high = (1e3 * float(q) for q in np.quantile(thickness, (0.05, 0.5, 0.95)))
    notes = [
        f"{len(cells.area)} cells of {1e4 * cells.area.mean():.1f} cm^2, outer area "
        f"{1e4 * cells.area.sum():.0f} cm^2",
        f"liner {low:.1f} / {middle:.1f} / {high:.1f} mm thick (5, 50, 95 % of the cells)",
        f"headform {size}: {1e3 * gap:.0f} mm between it and the liner at the tightest place",
    ]
    if missing:
        notes.append(f"{missing} cells have no liner below them and take their neighbour's")
    if thin:
        notes.append(f"{thin} cells had less than {1e3 * THINNEST:g} mm of liner and count with it")
    return notes


def _drawing(mesh: Trimesh) -> Trimesh:
    if len(mesh.faces) <= DRAWN:
        return mesh
    return mesh.simplify_quadric_decimation(face_count=DRAWN)


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [float(item) for item in value] if isinstance(value, tuple) else value


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
