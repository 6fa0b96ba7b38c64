"""A protocol and a helmet become a campaign: sites that are struck once or several times."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.geometry import read_geometry
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names
from helmet_sim_ros.model.surface.scenes import load_surface
from helmet_sim_ros.study.certification.protocol import Point, Protocol, Test
from helmet_sim_ros.study.certification.sizes import remade

DURATION = 0.025  # s; the pulses of all protocols end before
#: Of a cell on the chin bar: least cosine between its normal and the struck point's direction, and
#: how far below the head's centre it is [m].
FACING, LOW = 0.85, -0.04


@dataclass(frozen=True)
class Hit:
    """One impact of a campaign.

    Attributes:
        test: name of the protocol's test.
        point: name of the struck point.
        anvil: what is struck.
        number: 1 for a new helmet, 2 for the second impact on the same spot.
        speed: of the drop [m/s].
        standard: whose limits judge it; None: nothing does.
        values: dotted names that the campaign sets.
        setup: the impact.
        size: headform that the helmet was made for, where the campaign has several; else empty.
    """

    test: str
    point: str
    anvil: str
    number: int
    speed: float
    standard: str | None
    values: Mapping[str, object]
    setup: ImpactSetup
    size: str = ""

    @property
    def name(self) -> str:
        """Short and unique within a campaign."""
        again = f" hit {self.number}" if self.number > 1 else ""
        size = f"{self.size} " if self.size else ""
        return f"{size}{self.test} {self.point} {self.anvil} {self.speed:g}{again}"


@dataclass(frozen=True)
class Campaign:
    """Everything a protocol does to a helmet.

    Attributes:
        helmet: name or path.
        name: of the protocol, or path.
        protocol: what it says.
        sites: impacts on one spot of one helmet, in order; sites are independent of each other.
        notes: what a reader should know, in words.
    """

    helmet: str
    name: str
    protocol: Protocol
    sites: tuple[tuple[Hit, ...], ...]
    notes: tuple[str, ...]

    @property
    def hits(self) -> tuple[Hit, ...]:
        """All impacts in order."""
        return tuple(hit for site in self.sites for hit in site)


def make_campaign(
    helmet: str,
    name: str,
    protocol: Protocol,
    overrides: Mapping[str, object] | None = None,
    headforms: Sequence[str] = (),
) -> Campaign:
    """The campaign of a protocol.

    Args:
        helmet: name in ``config/helmets``, or path.
        name: of the protocol.
        protocol: loaded.
        overrides: dotted names that replace values in every impact.
        headforms: sizes, names or ``all`` of the protocol's; the helmet, which is made for the
            protocol's headform, is made anew for each. Tests with a headform of their own are
            done once. Empty: the protocol's headform alone.

    Raises:
        SetupError: a refused value, or a helmet too small for a headform of the protocol.
    """
    changes = dict(overrides or {})
    own = load_helmet(helmet)
    notes = [f"{test.name}: {test.note}" for test in protocol.tests if test.note]
    sites: list[tuple[Hit, ...]] = []
    left_out: set[str] = set()
    for count, size in enumerate(_sizes(protocol, headforms)):
        made = {**changes, **_made(own, protocol, size, changes)}
        if made != changes:
            notes.append(_told(size, protocol, made))
        for test in protocol.tests:
            if test.headform is not None and count > 0:
                continue
            points = [name for name in test.points if _exists(own, protocol.points[name])]
            left_out |= {f"{test.name}: {p}" for p in test.points if p not in points}
            for number, anvil, point in product(test.speeds, test.anvils, points):
                hits = (
                    _hit(helmet, protocol, test, point, anvil, number.value, k, size, made)
                    for k in range(1, test.hits + 1)
                )
                sites.append(tuple(replace(h, size=size if headforms else "") for h in hits))
    if not sites:
        raise SetupError.of("helmet", helmet, f"has no chin bar, and {name} strikes nothing else")
    for site in sites:
        _check_size(helmet, site[0].setup)
    notes += [f"{what}: not struck, {helmet} has no chin bar" for what in sorted(left_out)]
    coupling = sites[0][0].setup.helmet_config.coupling
    if coupling == "spring":
        notes.append(
            "the helmet is its coupling spring, as if every anvil were flat: kerb and hemisphere "
            "meet a rigid shell, and it remembers no crush"
        )
    elif own.coupling == "spring":
        notes.append("the helmet is its foam liner; its file has the coupling spring as usual form")
    return Campaign(helmet, name, protocol, tuple(sites), tuple(notes))


def _hit(
    helmet: str,
    protocol: Protocol,
    test: Test,
    point: str,
    anvil: str,
    speed: float,
    number: int,
    size: str,
    changes: Mapping[str, object],
) -> Hit:
    if number > 1 and test.later_speed is not None:
        speed = test.later_speed.value
    where = protocol.points[point]
    normal, tangential, heading = along_anvil(anvil, speed)
    if test.heading_deg is not None and tangential > 0.0:
        heading = test.heading_deg
    values: dict[str, object] = {
        "helmet.name": helmet,
        "helmet.coupling": usual_form(helmet),
        "impact.rig": test.rig or protocol.rig,
        "impact.surface": anvil,
        "impact.azimuth_deg": where.azimuth_deg,
        "impact.elevation_deg": where.elevation_deg,
        "impact.normal_velocity": normal,
        "impact.tangential_velocity": tangential,
        "impact.tangential_heading_deg": heading,
        "head.form": test.headform or size,
        "sim.duration": DURATION,
        **changes,
    }
    setup = setup_from_names(values)
    return Hit(test.name, point, anvil, number, speed, test.standard, values, setup)


def _exists(helmet: Helmet, point: Point) -> bool:
    """Whether a helmet can be struck at a point: a chin bar is part of a geometry, where some cell
    below the head's centre faces the point's direction."""
    if not point.chin:
        return True
    if helmet.geometry is None:
        return False
    cells = read_geometry(helmet.geometry)
    facing = cells.normal @ direction(point.azimuth_deg, point.elevation_deg) > FACING
    return bool((facing & (cells.point[:, 2] < LOW)).any())


def direction(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """The unit vector of a point's direction, head axes, (3,)."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def _sizes(protocol: Protocol, headforms: Sequence[str]) -> tuple[str, ...]:
    """The headforms of a campaign; ``all`` are the protocol's."""
    if not headforms:
        return (protocol.headform,)
    if "all" in headforms and not protocol.sizes:
        raise SetupError.of(
            "headform", "all", f"the protocol names one headform, {protocol.headform}"
        )
    named = (n for name in headforms for n in (protocol.sizes if name == "all" else (name,)))
    return tuple(dict.fromkeys(named))


def _made(
    own: Helmet, protocol: Protocol, size: str, changes: Mapping[str, object]
) -> dict[str, object]:
    """What the size of a helmet changes, by dotted name."""
    if size == protocol.headform:
        return {}
    start = len("helmet.")
    mine = {k[start:]: v for k, v in changes.items() if k.startswith("helmet.")}
    found = remade(own.replaced(mine), protocol.headform, size)
    return {f"helmet.{name}": value for name, value in found.items()}


def _told(size: str, protocol: Protocol, made: Mapping[str, object]) -> str:
    axes = made["helmet.shell.semi_axes"]
    assert isinstance(axes, tuple)
    return (
        f"{size}: the helmet, made for {protocol.headform}, was made anew around it, with the same "
        f"liner: shell of {' x '.join(f'{2e3 * a:.0f}' for a in axes)} mm, "
        f"{made['helmet.mass']:.2f} kg"
    )


def usual_form(helmet: str) -> str:
    """The form in which a helmet is certified: ``foam``, unless its file gives its own spring."""
    own = load_helmet(helmet)
    given = own.coupling == "spring" and not own.spring.identified
    return "spring" if given else "foam"


def along_anvil(anvil: str, speed: float) -> tuple[float, float, float]:
    """Normal and tangential part [m/s] of a vertical drop on an anvil, and heading [deg]."""
    _, frame = load_surface(anvil).frame
    down = frame.T @ np.array([0.0, 0.0, -1.0])
    across = float(math.hypot(down[0], down[1]))
    if across < 1e-9:
        return speed, 0.0, 90.0
    normal, along = -float(down[2]) * speed, across * speed
    return round(normal, 6), round(along, 6), round(math.degrees(math.atan2(down[1], down[0])), 6)


def inner_circumference(helmet: Helmet) -> float:
    """Circumference of the liner's inside at the height of the shell's centre [m].

    Perimeter of an ellipse after Ramanujan (1914).
    """
    liner, axes = helmet.liner, helmet.shell.semi_axes
    a = axes[0] - 0.5 * (liner.zone_thickness("front") + liner.zone_thickness("back"))
    b = axes[1] - liner.zone_thickness("side")
    root = math.sqrt((3.0 * a + b) * (a + 3.0 * b))
    return math.pi * (3.0 * (a + b) - root)


def _check_size(helmet: str, setup: ImpactSetup) -> None:
    """Refuse a headform that does not go into the helmet even with the padding pressed flat."""
    form, inside = setup.headform, inner_circumference(setup.helmet_config)
    if form is None or form.circumference is None or form.circumference.value <= inside:
        return
    raise SetupError.of(
        "headform", setup.head.form,
        f"is {form.circumference.value * 1e3:.0f} mm around, the liner of {helmet} only "
        f"{inside * 1e3:.0f} mm: too small for it; choose a smaller headform or a larger helmet",
    )  # fmt: skip
