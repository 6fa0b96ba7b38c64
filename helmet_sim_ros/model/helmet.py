"""Helmet configuration: shell, coupling spring, foam liner; read from ``config/helmets``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.model.foams import foam_digest, load_foam
from helmet_sim_ros.model.geometry import read_geometry
from helmet_sim_ros.resources import find_config, is_path
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.yaml_file import read_yaml

Vector = tuple[float, float, float]

NO_HELMET = "none"  # name of the bare head


class ShellMaterial(Config):
    """What the shell is made of, for its bending on anything that is not flat.

    Modulus and strength are general literature values of the material, the thickness is the
    helmet's.
    """

    name: str = Field("", description="what it is, and where its values come from")
    thickness: float = quantity("thickness", "m", 0.0, ge=0.0, le=0.01)
    modulus: float = quantity(
        "flexural modulus; 0: no bending stiffness", "Pa", 0.0, ge=0.0, le=3e11
    )
    poisson: float = quantity("Poisson ratio", "-", 0.3, ge=0.0, le=0.49)
    strength: float = quantity("flexural strength or yield stress", "Pa", 1e8, ge=1e6, le=5e9)

    @property
    def bending_stiffness(self) -> float:
        """D = E t^3 / (12 (1 - nu^2)) [N m]."""
        return self.modulus * self.thickness**3 / (12.0 * (1.0 - self.poisson**2))

    @property
    def strongest_curvature(self) -> float:
        """Curvature [1/m] at which the moment strength t^2 / 6 would be reached elastically."""
        if self.bending_stiffness == 0.0:
            return 1.0
        return self.strength * self.thickness**2 / (6.0 * self.bending_stiffness)


class Shell(Config):
    """The outer shell: an ellipsoid, rigid where it is not the foam that deforms."""

    semi_axes: Vector = quantity("ellipsoid semi-axes x, y, z of the outer surface", "m")
    center: Vector = quantity("ellipsoid centre in the head frame", "m", (0.0, 0.0, 0.0))
    effective_mass: float = quantity(
        "part of the helmet mass that stops with the struck shell; the rest moves with the head",
        "kg", gt=0.0, le=3.0,
    )  # fmt: skip
    contact_stiffness: float = quantity(
        "normal stiffness of the shell on the ground (local bending of the shell)",
        "N/m", 2e6, ge=1e4, le=1e8,
    )  # fmt: skip
    contact_damping: float = quantity(
        "damping c of the normal force k d (1 + c d')", "s/m", 0.15, ge=0.0, le=5.0
    )
    material: ShellMaterial = Field(default_factory=ShellMaterial)
    cell: float = quantity(
        "grid on which the bending of the shell is computed", "m", 0.006, ge=0.002, le=0.02
    )

    contact_returned: float = quantity(
        "share of the energy of the shell's bending that unloading gives back",
        "-", 0.2, ge=0.02, le=1.0,
    )  # fmt: skip

    @model_validator(mode="after")
    def _plausible(self) -> Shell:
        for value in self.semi_axes:
            if not 0.05 <= value <= 0.3:
                raise SetupError.of("semi_axes", self.semi_axes, "each must be from 0.05 to 0.3 m")
        for value in self.center:
            if not -0.05 <= value <= 0.05:
                raise SetupError.of("center", self.center, "each must be from -0.05 to 0.05 m")
        return self


class SpringLaw(Config):
    """Loading path F = A (exp(B d) - 1) of one direction (paper, section 2.2)."""

    A: float = quantity("force scale of the loading path", "N", gt=0.0, le=1e9)
    B: float = quantity("exponent of the loading path", "1/m", gt=0.0, le=500.0)


class Spring(Config):
    """The coupling spring between head and shell, one law per side of the head."""

    front: SpringLaw
    back: SpringLaw
    side: SpringLaw
    top: SpringLaw
    strap: SpringLaw = Field(
        description="helmet pulled off the head upwards: chin strap and cheek pads"
    )
    energy_loss: float = quantity(
        "share of the loading energy that unloading does not give back", "-", ge=0.0, le=0.98
    )
    bears: Literal["patch", "point"] = Field(
        "patch",
        description="where the spring bears: over the patch of the crushed shell, so that rolling "
        "leaves crushed liner behind, or at a point",
    )
    identified: bool = Field(
        False,
        description="whether the laws were identified from drop tests of this helmet's liner: a "
        "change of the liner then identifies them afresh",
    )


class Zone(Config):
    """A zone of the liner that differs from the rest of it."""

    density: float | None = quantity(
        "foam density; unset: the liner's", "kg/m^3", None, ge=15.0, le=120.0
    )
    thickness: float | None = quantity(
        "liner thickness; unset: the liner's", "m", None, ge=0.01, le=0.08
    )


class Layer(Config):
    """The inner layer of a liner of two densities; it lies on the head's side."""

    density: float | None = quantity(
        "density of the same foam; unset: there is one layer", "kg/m^3", None, ge=10.0, le=300.0
    )
    share: float = quantity("share of the liner's thickness", "-", 0.5, ge=0.05, le=0.95)


class Liner(Config):
    """Crushable EPS liner of the foam helmet; see model/foam.py for the law."""

    density: float = quantity("foam density", "kg/m^3", ge=15.0, le=120.0)
    foam: str | None = Field(
        None,
        description="what it is made of: name in config/foams, or path to a YAML file; unset: eps",
    )
    foam_digest: str | None = Field(
        None, exclude=True, description="digest of the foam's file, told and not chosen"
    )
    thickness: float = quantity("liner thickness", "m", ge=0.01, le=0.08)
    energy_returned: float = quantity(
        "share of the crushing energy that unloading gives back", "-", 0.05, ge=0.005, le=0.5
    )
    effective_mass: float = quantity(
        "part of the liner's mass that stops with its struck part; the rest moves with the head",
        "kg", 0.1, gt=0.0, le=1.0,
    )  # fmt: skip
    inner: Layer = Field(default_factory=Layer)
    columns: int = quantity("foam columns over the whole shell", "-", 1000, ge=50, le=20000)
    front: Zone = Field(default_factory=Zone)
    back: Zone = Field(default_factory=Zone)
    side: Zone = Field(default_factory=Zone)
    top: Zone = Field(default_factory=Zone)

    @model_validator(mode="before")
    @classmethod
    def _tell_digest(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not isinstance(data.get("foam"), str):
            return data
        try:
            digest, told = foam_digest(data["foam"]), data.get("foam_digest")
            load_foam(data["foam"])
        except SetupError as error:  # the file's own keys say nothing to who named it here
            named = error.problems[0].key == "foam"
            why = error.problems[0].allowed if named else str(error)
            raise SetupError.of("foam", data["foam"], why) from None
        if told not in (None, digest):
            raise SetupError.of(
                "foam_digest", told, f"the file of {data['foam']} is another one now, {digest}"
            )
        return {**data, "foam_digest": digest}

    @model_validator(mode="after")
    def _within_the_foam(self) -> Liner:
        if self.foam is None:
            if self.foam_digest is not None:
                raise SetupError.of("foam_digest", self.foam_digest, "needs a foam")
            return self
        low, high = load_foam(self.foam).densities
        if self.inner.density is not None and not low <= self.inner.density <= high:
            raise SetupError.of(
                "inner.density", self.inner.density,
                f"must be from {low:g} to {high:g} kg/m^3 for {self.foam}",
            )  # fmt: skip
        for zone in ("front", "back", "side", "top"):
            density = self.zone_density(zone)
            if not low <= density <= high:
                own = getattr(self, zone).density is not None
                raise SetupError.of(
                    f"{zone}.density" if own else "density", density,
                    f"must be from {low:g} to {high:g} kg/m^3 for {self.foam}",
                )  # fmt: skip
        return self

    def zone_thickness(self, zone: str) -> float:
        """Thickness of a zone [m]."""
        own: float | None = getattr(self, zone).thickness
        return self.thickness if own is None else own

    def zone_density(self, zone: str) -> float:
        """Density of a zone [kg/m^3]."""
        own: float | None = getattr(self, zone).density
        return self.density if own is None else own


class Padding(Config):
    """Comfort padding between head and liner; see model/force/fit.py for the law. General
    literature values of soft polyurethane foam; not measured for this model."""

    thickness: float = quantity("thickness at rest", "m", 0.004, ge=1e-3, le=0.03)
    modulus: float = quantity("initial modulus in compression", "Pa", 40e3, ge=1e3, le=1e7)
    densification: float = quantity(
        "strain at which the pores are closed", "-", 0.9, ge=0.3, le=0.98
    )
    energy_returned: float = quantity(
        "share of the energy of compression that is given back", "-", 0.2, ge=0.05, le=0.5
    )
    damping: float = quantity(
        "damping c of the pressure p + c v min(p, modulus)", "s/m", 1.0, ge=0.0, le=5.0
    )
    shear_modulus: float = quantity("initial modulus in shear", "Pa", 15e3, ge=1e2, le=1e8)
    relaxation: float = quantity("damping over stiffness in shear", "s", 1e-3, ge=0.0, le=1e-2)
    preload: float = quantity(
        "compression on the head at rest; below 0: a gap", "m", 0.0, ge=-0.01, le=0.005
    )
    lowest: float = quantity(
        "height down to which the padding covers the head, head frame", "m", -0.06, ge=-0.15, le=0.1
    )
    patches: int = quantity("patches over the whole head", "-", 64, ge=16, le=2000)


class Strap(Config):
    """Chin strap; each side pulls from an anchor on the helmet to the chin. The positions are
    design choices of the generic helmets."""

    anchor: Vector = quantity("left anchor in the helmet frame", "m", (0.0, 0.075, -0.05))
    chin: Vector = quantity("where the strap meets the chin, head frame", "m", (0.055, 0.0, -0.115))
    slack: float = quantity("elongation before it pulls", "m", 0.005, ge=0.0, le=0.05)
    stiffness: float = quantity("of each side in tension", "N/m", 30e3, ge=0.0, le=1e6)
    damping: float = quantity("of each side in tension", "N s/m", 50.0, ge=0.0, le=1e4)


class Helmet(Config):
    """A complete helmet. ``coupling`` selects the spring or the foam liner."""

    description: str = Field("", description="what it represents and where its numbers come from")
    mass: float = quantity("total mass", "kg", ge=0.0, le=4.0)
    inertia: Vector = quantity(
        "moments of inertia of the whole helmet about its centre, head axes", "kg m^2"
    )
    mass_center: Vector | None = quantity(
        "centre of mass in the head frame; unset: the shell's centre", "m", None
    )
    shell: Shell
    coupling: Literal["spring", "foam", "none"] = Field(
        "spring",
        description="what joins head and shell: coupling spring or foam liner; none: a bare head, "
        "whose skin and skull the shell stands for",
    )
    spring: Spring
    liner: Liner
    padding: Padding = Field(default_factory=Padding)
    strap: Strap = Field(default_factory=Strap)
    geometry: str | None = Field(
        None,
        description="array file with the outer surface and the liner's thickness, written by "
        "'helmet-sim helmet import', beside the helmet's file; unset: the shell's ellipsoid",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Helmet:
        if self.coupling == "none":
            return self
        if self.mass == 0.0:
            raise SetupError.of("mass", self.mass, "must be above 0 kg and at most 4 kg")
        struck, inside = self.shell.effective_mass, self.liner.effective_mass
        if struck + inside > self.mass:
            beside = "with that of the {} must not exceed the helmet's mass, {:g} kg"
            raise SetupError(
                [
                    Problem("mass", self.mass, "must hold that of the struck shell and liner"),
                    Problem("shell.effective_mass", struck,
                            beside.format("liner", self.mass)),
                    Problem("liner.effective_mass", inside,
                            beside.format("shell", self.mass)),
                ]
            )  # fmt: skip
        i = sorted(self.inertia)
        if i[0] <= 0.0 or i[2] > 1.0 or i[0] + i[1] < i[2]:
            raise SetupError.of(
                "inertia", self.inertia,
                "each must be above 0 and at most 1 kg m^2, none above the sum of the others",
            )  # fmt: skip
        if self.mass_center is not None and max(map(abs, self.mass_center)) > 0.1:
            raise SetupError.of("mass_center", self.mass_center, "each must be from -0.1 to 0.1 m")
        if self.geometry is not None:
            cells = len(read_geometry(self.geometry).area)
            if self.liner.columns != cells:
                raise SetupError.of(
                    "liner.columns", self.liner.columns, f"must be {cells}: {self.geometry}"
                )  # fmt: skip
        return self

    @property
    def fitted_mass(self) -> float:
        """What lies next to the padding and moves against the head [kg]: of a spring helmet the
        liner's inside, of a foam helmet what is struck as well."""
        struck = 0.0 if self.coupling == "spring" else self.shell.effective_mass
        return struck + self.liner.effective_mass


@lru_cache(maxsize=64)
def _load(path: Path, _mtime_ns: int) -> Helmet:
    data = read_yaml(path, "helmet")
    if isinstance(data, dict) and isinstance(data.get("geometry"), str):
        data["geometry"] = str(path.parent.resolve() / data["geometry"])
    liner = data.get("liner") if isinstance(data, dict) else None
    foam = liner.get("foam") if isinstance(liner, dict) else None
    if isinstance(liner, dict) and isinstance(foam, str) and is_path(foam):
        liner["foam"] = str(path.parent.resolve() / foam)
    return Helmet.from_mapping(data, str(path))  # type: ignore[no-any-return]


def load_helmet(name_or_path: str) -> Helmet:
    """The helmet of ``config/helmets/NAME.yaml``, or of any YAML file by path; ``none``: a bare
    head.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    kind = "bare_head" if name_or_path == NO_HELMET else "helmets"
    path = find_config(kind, name_or_path, "helmet")
    return _load(path, path.stat().st_mtime_ns)
