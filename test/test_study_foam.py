"""The foam law against published compression data."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force import foam
from helmet_sim_ros.report.validation.foam import foam_section
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study.validation.foam import (
    density_exponents,
    foam_findings,
    load_foam_reference,
)

REFERENCE = load_foam_reference()
FOUND = foam_findings(REFERENCE)


def test_the_law_is_near_the_dynamic_values_of_helmet_liners() -> None:
    dynamic = [one for one in FOUND if one.data.name == "dynamic"]
    assert {one.point.density for one in dynamic} == {40.0, 62.0, 80.0}
    for one in dynamic:
        assert one.at_rate == one.law  # at its own rate
        assert abs(one.difference) < 0.25


def test_at_the_densities_of_helmets_the_law_lies_above_static_minima() -> None:
    static = [one for one in FOUND if one.data.name == "static" and one.point.strain > 0.02]
    assert len(static) == 12
    for one in static:
        assert one.law > one.point.stress
        factor = (one.data.rate / foam.RATE) ** foam.RATE_EXPONENT
        assert one.at_rate == pytest.approx(one.law * factor)
        assert one.difference == pytest.approx(one.at_rate / one.point.stress - 1.0)


def test_exponents_are_those_of_a_power_law() -> None:
    exponents = density_exponents(FOUND)
    published, law = exponents["static", 0.10]
    assert published == pytest.approx(1.54, abs=0.03)  # 40 kPa at 11.2, 276 kPa at 38.4 kg/m^3
    assert law < published


def test_the_section_shows_every_point(tmp_path: Path) -> None:
    text = foam_section(REFERENCE)
    assert text.startswith("## Foam against compression data\n")
    for one in FOUND:
        start = f"| {one.point.density:g} | {one.point.strain:g} | {one.point.stress / 1e3:.0f} |"
        assert start in text


def test_bad_data_are_told(tmp_path: Path) -> None:
    path = share_directory() / "config" / "references" / "eps.yaml"
    data = yaml.safe_load(path.read_text())
    data["data"][0]["points"][2]["strain"] = 1.5
    mine = tmp_path / "mine.yaml"
    mine.write_text(yaml.safe_dump(data))
    with pytest.raises(SetupError, match=r"mine.yaml: data\[1\].points\[3\].strain = 1.5"):
        load_foam_reference(mine)
