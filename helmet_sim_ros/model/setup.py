"""The impact setup: everything that defines one simulated impact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, TypeVar

from pydantic import Field, model_validator

from helmet_sim_ros.errors import Problem, SetupError, did_you_mean
from helmet_sim_ros.model.forms import BARE, worn
from helmet_sim_ros.model.head_surface import Head, HeadSurface, load_head_surface
from helmet_sim_ros.model.headform import Headform, load_headform
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.rider.posing import Posing
from helmet_sim_ros.model.rider.properties import RETIRED, Rider, refuse_retired
from helmet_sim_ros.model.state import read_state
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.scenes import SCENE, load_surface
from helmet_sim_ros.schema import Config, Leaf, leaf_values, leaves, quantity
from helmet_sim_ros.views import show

Rig = Literal["rider", "headform", "monorail"]
Rates = Literal["several", "single"]
Direction = Literal["front", "back", "left", "right", "top"]
Named = TypeVar("Named", bound=Config)

#: What places a rider whose state is not given.
PLACING = ("direction", "body_angle_deg", "tangential_heading_deg")
#: Flexion of the neck that the rider reaches [deg] (facts: flexion 50 to 60 deg).
MAX_NECK_FLEXION_DEG = 60.0
#: Share of a liner's thickness that a blow crushes at most before it has bottomed out.
CRUSHED = 0.9


class ImpactSetup(Config):
    """One impact, complete. A headform rig uses the head of ``rider`` and ignores its body.

    Raises:
        SetupError: any refused value, named with its key and the allowed range.
    """

    rig: Rig = Field(
        "rider",
        description="whole rider; head and helmet alone, in free fall; or on a monorail, which "
        "does not let the head turn",
    )
    direction: Direction = Field(
        "left", description="part of the helmet that strikes the surface (side = left)"
    )
    azimuth_deg: float | None = quantity(
        "without a rider: where around the head it is struck, 0 front, 90 left; unset: as "
        "direction",
        "deg", None, ge=-180.0, le=180.0,
    )  # fmt: skip
    elevation_deg: float | None = quantity(
        "without a rider: how high on the head it is struck, 90 is the crown; unset: as direction",
        "deg", None, ge=-90.0, le=90.0,
    )  # fmt: skip
    normal_velocity: float = quantity(
        "speed into the surface at first touch", "m/s", 5.0, gt=0.0, le=30.0
    )
    tangential_velocity: float = quantity(
        "speed along the surface at first touch", "m/s", 0.0, ge=0.0, le=60.0
    )
    tangential_heading_deg: float = quantity(
        "heading of the tangential speed along the surface, from the body axis (feet to head), "
        "counter-clockwise seen from outside",
        "deg", 90.0, ge=-360.0, le=360.0,
    )  # fmt: skip
    body_angle_deg: float = quantity(
        "angle between body axis and surface, head down", "deg", 30.0, ge=0.0, le=90.0
    )
    neck_flexion_deg: float | None = quantity(
        "head bent towards the chest at first touch; unset: 0, and for direction top what turns "
        "the crown to the ground, at most 60",
        "deg", None, ge=-60.0, le=MAX_NECK_FLEXION_DEG,
    )  # fmt: skip
    state: tuple[float, ...] | None = Field(
        None,
        description="how a rider moves at the touch, as head_strikes(...).setup() gives it; unset: "
        "placed by direction, body_angle_deg and neck_flexion_deg, all moving as one",
    )
    surface: str = Field(
        "ground",
        description="what is struck: name in config/surfaces, path to a YAML file, or scene:NAME "
        "for a scene",
    )
    friction: float | None = quantity(
        "friction of shell on surface; unset: the surface's", "-", None, ge=0.0, le=2.0
    )
    gravity: float = quantity("gravity, downwards", "m/s^2", 9.80665, ge=0.0, le=30.0)
    helmet: str = Field("fullface", description="name in config/helmets, or path to a YAML file")
    rider: Rider = Field(default_factory=Rider)
    head: Head = Field(default_factory=Head)
    duration: float = quantity("simulated time from the first touch", "s", 0.04, ge=1e-3, le=2.0)
    time_step: float = quantity(
        "sampling step; also the integration step, or a whole multiple of it where stability needs "
        "a smaller one (5e-5 s or less)",
        "s", 5e-5, ge=1e-6, le=1e-3,
    )  # fmt: skip
    rates: Rates = Field(
        "single",
        description="several: the body at a large step, head and helmet at the integration step; "
        "single: all at the integration step, as a reference",
    )
    overrides: dict[str, Any] = Field(
        default_factory=dict, description="dotted names of rider, helmet, impact or sim values"
    )

    @model_validator(mode="before")
    @classmethod
    def _normalise(cls, data: Any) -> Any:
        data = with_overrides(data, _SETUP_KEYS)
        if isinstance(data, dict) and data.get("direction") == "side":
            data["direction"] = "left"
        return data

    @model_validator(mode="after")
    def _resolvable(self) -> ImpactSetup:
        if self.duration < 10 * self.time_step:
            raise SetupError.of("duration", self.duration, "must be at least 10 time steps")
        if self.headform is not None:
            self._refuse_two_heads()
        for key in ("azimuth_deg", "elevation_deg"):
            if self.rig == "rider" and getattr(self, key) is not None:
                raise SetupError.of(
                    key, getattr(self, key),
                    "must be unset for rig rider: direction, body_angle_deg and neck_flexion_deg "
                    "place the head",
                )  # fmt: skip
        if self.state is not None:
            self._refuse_beside_state(self.state)
        # Refuse a bad file now, not when it runs.
        _ = self.head_surface
        self._refuse_thin(self.helmet_config, self.surface_config)
        if self.rates == "several" and (
            self.state is not None or self.helmet_config.coupling == "none"
        ):
            raise SetupError.of(
                "sim.rates", self.rates, "must be single for a bare head and for a strike of a fall"
            )
        return self

    def _refuse_beside_state(self, state: tuple[float, ...]) -> None:
        if self.rig != "rider":
            raise SetupError.of("state", f"{len(state)} numbers", "must be unset without a rider")
        for key in PLACING:
            if getattr(self, key) != type(self).model_fields[key].default:
                raise SetupError.of(
                    key, getattr(self, key), "has no effect: state says how the rider moves"
                )
        read_state(state)

    def _refuse_thin(self, helmet: Helmet, surface: SurfaceConfig) -> None:
        """Single columns know the nearest face only, and would pass a plate thinner than a liner;
        a shell that bends lies on top of it."""
        alone = helmet.coupling == "foam" and helmet.shell.material.bending_stiffness == 0.0
        alone = alone and not self.surface.startswith(SCENE)  # what a fall met, it meets alone too
        if alone and surface.half_thickness < CRUSHED * helmet.liner.thickness:
            raise SetupError.of(
                "impact.surface", self.surface,
                f"is only {2e3 * surface.half_thickness:.3g} mm thick, and the columns of a liner "
                "without a shell would pass; give helmet.shell.material.modulus and .thickness",
            )  # fmt: skip

    def _refuse_two_heads(self) -> None:
        if self.rig == "rider":
            raise SetupError.of(
                "head.form", self.head.form, "must be unset: a rider has a head of his own"
            )
        if self.rider.head_mass is not None:
            raise SetupError.of(
                "rider.head_mass", self.rider.head_mass,
                f"has no effect: the mass is that of head.form = {self.head.form!r}",
            )  # fmt: skip

    @cached_property
    def headform(self) -> Headform | None:
        """What takes the place of the head; None: nothing does."""
        return None if self.head.form is None else load_headform(self.head.form)

    @cached_property
    def helmet_config(self) -> Helmet:
        """The helmet with its overrides applied."""
        return overridden_helmet(self.helmet, self.overrides)

    @cached_property
    def surface_config(self) -> SurfaceConfig:
        """What is struck."""
        return load_surface(self.surface)

    @cached_property
    def head_surface(self) -> HeadSurface:
        """The surface of the head in the liner."""
        return surface_of_head(self.head_surface_name, self.head)

    @property
    def head_surface_name(self) -> str:
        """The head surface that is used."""
        if self.head.surface is not None:
            return self.head.surface
        if self.headform is not None:
            return self.headform.surface
        return "scalp" if self.rig == "rider" else "en960"

    @property
    def resolved_friction(self) -> float | None:
        """The friction of the shell on what it meets first [-]; None: each shape of a scene has its
        own."""
        if self.surface.startswith(SCENE):
            return self.friction
        return self.surface_config.friction if self.friction is None else self.friction

    @property
    def posing(self) -> Posing | None:
        """Where the joints rest; None: in the posture that the rider was made with."""
        if self.state is None:
            return None
        state = read_state(self.state)
        return Posing(
            (), all_rests=tuple(state.joint_rests), all_factors=tuple(state.joint_factors)
        )  # fmt: skip

    @property
    def closing_speed(self) -> float:
        """Speed at which the helmet meets the surface [m/s]."""
        return self.normal_velocity

    @property
    def samples(self) -> int:
        """Number of samples of the record."""
        return round(self.duration / self.time_step) + 1

    @property
    def resolved_neck_flexion_deg(self) -> float:
        """The neck flexion that is used [deg]."""
        if self.neck_flexion_deg is not None:
            return self.neck_flexion_deg
        if self.direction == "top":
            return min(90.0 - self.body_angle_deg, MAX_NECK_FLEXION_DEG)
        return 0.0

    def _repr_html_(self) -> str:
        from helmet_sim_ros.model.helmet import Helmet

        described, default = self.described(), ImpactSetup().described()
        every = [*setup_leaves(), *leaves(Helmet, "helmet.")]
        units = {leaf.name: leaf.unit for leaf in every}
        changed = [name for name, value in described.items() if value != default[name]]
        return str(show("setup_html", described, units, changed))

    def described(self) -> dict[str, Any]:
        """Every value by its dotted name, as plain JSON data, for logs and provenance."""
        values = {name: getattr(self, field) for name, field in _SETUP_KEYS.items()}
        if self.state is None:
            del values["impact.state"]
        else:
            for key in PLACING:
                del values[f"impact.{key}"]
        values["impact.neck_flexion_deg"] = self.resolved_neck_flexion_deg
        values["impact.friction"] = self.resolved_friction
        values |= {f"rider.{k}": v for k, v in leaf_values(self.rider).items()}
        values["head.form"] = self.head.form
        values["head.surface"] = self.head_surface_name
        values["head.friction"] = self.head_surface.friction
        values["helmet.name"] = self.helmet
        values |= told_helmet(self.helmet_config)
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}


def _setup_keys() -> dict[str, str]:
    """Dotted name -> field of ImpactSetup, for the values it holds itself."""
    names = {}
    for leaf in leaves(ImpactSetup):
        if "." in leaf.name or leaf.name == "helmet":
            continue
        group = "sim" if leaf.name in ("duration", "time_step", "rates") else "impact"
        names[f"{group}.{leaf.name}"] = leaf.name
    return names


def with_overrides(data: Any, keys: Mapping[str, str]) -> Any:
    """Fields of a setup as given, their ``overrides`` folded in by :func:`fold_overrides`; what is
    no mapping is left to the schema to refuse."""
    if not isinstance(data, Mapping):
        return data
    overrides = data.get("overrides", {})
    if not isinstance(overrides, Mapping):
        return dict(data)
    return fold_overrides(dict(data), overrides, keys)


def fold_overrides(
    data: dict[str, Any], overrides: Mapping[str, Any], keys: Mapping[str, str]
) -> dict[str, Any]:
    """Fold ``rider.*``, ``head.*`` and the names of ``keys`` into the fields; ``helmet.*`` stays.

    Args:
        data: fields of a setup.
        overrides: dotted names to values.
        keys: dotted name -> field, for the values that the setup holds itself.

    Raises:
        SetupError: unknown name, or a refused value.
    """
    kept: dict[str, Any] = {}
    changes: dict[str, dict[str, Any]] = {name: {} for name in GROUPS}
    for key, value in overrides.items():
        group, _, name = str(key).partition(".")
        if key == "helmet.name":
            data["helmet"] = value
        elif group == "helmet" and name:
            kept[key] = tuple(value) if isinstance(value, list) else value
        elif group in GROUPS and name:
            changes[group][name] = value
        elif key in keys:
            data[keys[key]] = value
        else:
            raise SetupError.of(
                f"overrides.{key}", value,
                "unknown name; use helmet.*, rider.*, head.* or one of " + ", ".join(keys)
                + did_you_mean(key, keys),
            )  # fmt: skip
    for group, named in changes.items():
        if not named:
            continue
        kind = GROUPS[group]
        present = data.get(group, kind())
        present = present if isinstance(present, kind) else kind.from_mapping(present)
        try:
            if group == "rider":
                refuse_retired(named, "neck.")
            data[group] = present.replaced(named)
        except SetupError as error:
            raise SetupError(
                [Problem(f"{group}.{p.key}", p.value, p.allowed) for p in error.problems]
            ) from None
    return data | {"overrides": kept}


def overridden_helmet(name: str, overrides: Mapping[str, Any]) -> Helmet:
    """The helmet of a name, with the ``helmet.*`` of a setup's overrides applied.

    Raises:
        SetupError: the helmet's file, or a value in the overrides, is refused.
    """
    prefix = "helmet."
    changes = {k[len(prefix) :]: v for k, v in overrides.items() if k.startswith(prefix)}
    try:
        return worn(load_helmet(name), changes)
    except SetupError as error:
        if error.source:  # the helmet file itself is bad
            raise
        raise SetupError(
            [Problem(_prefixed(prefix, p.key), p.value, p.allowed) for p in error.problems]
        ) from None


def told_helmet(helmet: Helmet) -> dict[str, Any]:
    """Every value of a helmet by its dotted name; of a bare head those that have an effect."""
    values = leaf_values(helmet)
    if helmet.coupling == "none":
        values = {k: v for k, v in values.items() if k.startswith((*BARE, "coupling"))}
    return {f"helmet.{k}": v for k, v in values.items()}


def surface_of_head(name: str, head: Head) -> HeadSurface:
    """A head surface, with the friction that was set for the head."""
    surface = load_head_surface(name)
    if head.friction is None:
        return surface
    return surface.replaced({"friction": head.friction})  # type: ignore[no-any-return]


def _prefixed(prefix: str, key: str) -> str:
    return key if key.startswith(prefix) or key == "helmet" else prefix + key


#: Groups of values that have a record of their own.
GROUPS: dict[str, type[Rider] | type[Head]] = {"rider": Rider, "head": Head}
_SETUP_KEYS = _setup_keys()


def setup_from_names(values: Mapping[str, Any]) -> ImpactSetup:
    """An impact setup from dotted names: ``impact.*``, ``rider.*``, ``helmet.*``, ``sim.*``.

    ``helmet.name`` selects the helmet, every other ``helmet.*`` changes a value in it.
    The one way from scenario files, ROS parameters, sweeps and the command line to a setup.

    Raises:
        SetupError: unknown name, or a refused value.
    """
    return from_names(ImpactSetup, values, _SETUP_KEYS)


def from_names(kind: type[Named], values: Mapping[str, Any], keys: Mapping[str, str]) -> Named:
    """A setup of any kind from dotted names, by which it also tells what is refused.

    Args:
        kind: of the setup.
        values: by dotted name.
        keys: dotted name -> field, for the values that the setup holds itself.

    Raises:
        SetupError: unknown name, or a refused value.
    """
    try:
        return kind(overrides=dict(values))
    except SetupError as error:
        names = {field: name for name, field in keys.items()} | {"helmet": "helmet.name"}
        problems = [
            Problem(names.get(p.key, p.key.removeprefix("overrides.")), p.value, p.allowed)
            for p in error.problems
        ]
        raise SetupError(problems, error.source) from None


def setup_from_log(values: Mapping[str, Any]) -> tuple[ImpactSetup, tuple[str, ...]]:
    """The setup of a logged impact, also of one that an earlier version logged.

    Only for showing what was recorded: a neck of version 0.1 is replaced by today's.

    Returns:
        The setup, and what it leaves out, in words.

    Raises:
        SetupError: unknown name, or a refused value.
    """
    retired = sorted({f"rider.neck.{name}" for name in RETIRED} & values.keys())
    setup = setup_from_names({k: v for k, v in values.items() if k not in retired})
    if not retired:
        return setup, ()
    return setup, (f"logged with another neck model; left out: {', '.join(retired)}",)


def setup_leaves() -> list[Leaf]:
    """Every ``impact.*``, ``sim.*``, ``rider.*`` and ``head.*`` value, with its dotted name."""
    return named_leaves(ImpactSetup, _SETUP_KEYS)


def named_leaves(kind: type[Config], keys: Mapping[str, str]) -> list[Leaf]:
    """The values that a setup holds itself (``keys``: dotted name -> field), then those of the
    records in it, each with its dotted name."""
    names = {field: name for name, field in keys.items()}
    own = [replace(leaf, name=names[leaf.name]) for leaf in leaves(kind) if leaf.name in names]
    return own + [leaf for group, inner in GROUPS.items() for leaf in leaves(inner, f"{group}.")]
