"""Protocols: which points a test house strikes, on which anvils, how fast, within which limits."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from helmet_sim_ros.biomech.standards import load_standard
from helmet_sim_ros.config_file import load_config
from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.model.headform import load_headform
from helmet_sim_ros.model.surface.scenes import load_surface
from helmet_sim_ros.schema import Config, quantity


class Number(Config):
    """A number of a protocol with its origin."""

    value: float = quantity("the number", "")
    source: str = Field(description="document that states it, or what cites it")
    verified: bool = Field(description="whether the primary text was read")


class Point(Config):
    """A point of the helmet, seen from the centre of the headform."""

    azimuth_deg: float = quantity("0 front, 90 left, 180 rear", "deg", ge=-180.0, le=180.0)
    elevation_deg: float = quantity("above the horizontal", "deg", ge=-90.0, le=90.0)
    words: str = Field("", description="where that is")
    chin: bool = Field(
        False, description="on the chin bar: only helmets whose geometry has one are struck there"
    )
    source: str = Field(description="document that states it, or that it is our choice")
    verified: bool = Field(False, description="whether the primary text was read")


class Test(Config):
    """Impacts of one kind: every point on every anvil."""

    name: str = Field(description="as in a report")
    points: tuple[str, ...] = Field(description="names of the protocol's points")
    anvils: tuple[str, ...] = Field(description="names in config/surfaces, or paths")
    speeds: tuple[Number, ...] = Field(description="of the drop [m/s], one impact each")
    hits: int = quantity("impacts in a row on the same spot of the same helmet", "-", 1, ge=1, le=5)
    later_speed: Number | None = Field(None, description="of the second hit on; unset: the same")
    heading_deg: float | None = quantity(
        "sense of the tangential speed on an inclined anvil; 0 is towards the crown; unset: as the "
        "anvil's slope has it",
        "deg", None, ge=-360.0, le=360.0,
    )  # fmt: skip
    rig: Literal["headform", "monorail"] | None = Field(None, description="unset: the protocol's")
    headform: str | None = Field(None, description="unset: the protocol's")
    standard: str | None = Field(
        None, description="limits: name in config/standards, or path; unset: it has none"
    )
    note: str = Field("", description="what differs from the document, or is our choice")

    @model_validator(mode="after")
    def _has_impacts(self) -> Test:
        for key in ("points", "anvils", "speeds"):
            if not getattr(self, key):
                raise SetupError.of(key, (), "must hold at least one")
        for number in (*self.speeds, *((self.later_speed,) if self.later_speed else ())):
            if not 0.0 < number.value <= 30.0:
                raise SetupError.of(
                    "speeds", number.value, "must be a number from above 0 to 30 m/s"
                )
        return self


class Protocol(Config):
    """What a test house does to a helmet, as far as it can be simulated."""

    title: str = Field(description="document")
    description: str = Field("", description="what is tested, and how it is read here")
    source: str = Field(description="where its structure is from")
    verified: bool = Field(description="whether the primary text was read")
    rig: Literal["headform", "monorail"] = Field(
        "headform", description="headform: free fall; monorail: guided, the head does not turn"
    )
    headform: str = Field(
        description="name in config/headforms, or path: the size that a helmet's file is for"
    )
    sizes: tuple[str, ...] = Field(
        (), description="all headforms of the document, each for a helmet of its size"
    )
    sizes_source: str = Field("", description="document that states them, or what cites it")
    sizes_verified: bool = Field(False, description="whether the primary text was read")
    points: dict[str, Point] = Field(description="by name")
    tests: tuple[Test, ...] = Field(description="in order")
    rating: str = Field("", description="how a rating follows, or why none is given")
    not_modelled: tuple[str, ...] = Field((), description="parts of the document left out")

    @model_validator(mode="after")
    def _names_known(self) -> Protocol:
        if not self.tests:
            raise SetupError.of("tests", (), "must hold at least one")
        problems: list[Problem] = []
        for index, test in enumerate(self.tests):
            where = f"tests[{index}]"
            for point in test.points:
                if point not in self.points:
                    allowed = "must be one of the protocol's points: " + ", ".join(self.points)
                    problems.append(Problem(f"{where}.points", point, allowed))
            for anvil in test.anvils:
                problems += _refused(load_surface, anvil, f"{where}.anvils")
            if test.standard is not None:
                problems += _refused(load_standard, test.standard, f"{where}.standard")
            if test.headform is not None:
                problems += _refused(load_headform, test.headform, f"{where}.headform")
        problems += _refused(load_headform, self.headform, "headform")
        for index, size in enumerate(self.sizes):
            problems += _refused(load_headform, size, f"sizes[{index}]")
        if problems:
            raise SetupError(problems)
        return self


def _refused(load: object, name: str, key: str) -> list[Problem]:
    try:
        load(name)  # type: ignore[operator]
    except SetupError as error:
        if error.source:  # it exists, but something in it is wrong
            return [Problem(f"{key}: {error.source}: {p.key}", p.value, p.allowed)
                    for p in error.problems]  # fmt: skip
        return [Problem(key, p.value, p.allowed) for p in error.problems]
    return []


def load_protocol(name_or_path: str | Path) -> Protocol:
    """The protocol of ``config/protocols/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it: an unknown anvil,
            point, headform or criterion among them.
    """
    return load_config(Protocol, "protocols", str(name_or_path), "protocol")
