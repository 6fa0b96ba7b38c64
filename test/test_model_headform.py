"""Headforms as data."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.biomech import to_head_axes
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.headform import load_headform
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import setup_from_names
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study import load_scenario

FOLDER = share_directory() / "config" / "headforms"
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))


def test_the_headforms_of_the_standards_are_there() -> None:
    assert {f"en960_{size}" for size in "aejmo"} <= set(NAMES)
    assert {"hybrid_iii", "nocsae_medium", "cellbond"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_number_says_where_it_is_from(name: str) -> None:
    form = load_headform(name)
    for part in (form.mass, form.inertia, form.circumference, form.reference_plane, form.crown):
        if part is not None:
            assert len(part.source) > 20
            assert part.verified or "not" in part.source or "estimate" in part.source or (
                "general" in part.source or "human head" in part.source
            )  # fmt: skip
    assert (share_directory() / "config" / "head_surfaces" / f"{form.surface}.yaml").is_file()


@pytest.mark.parametrize("name", NAMES)
def test_inertia_is_that_of_a_head_of_this_mass(name: str) -> None:
    """Radii of gyration of heads lie from 5 to 8 cm (Beier 1980: 5.85 to 7.18)."""
    form = load_headform(name)
    for moment in form.inertia.value:
        assert 0.05 < (moment / form.mass.value) ** 0.5 < 0.08


def test_sizes_grow_with_the_letters() -> None:
    forms = [load_headform(f"en960_{size}") for size in "aejmo"]
    for values in (
        [form.mass.value for form in forms],
        [form.inertia.value[0] for form in forms],
        [form.circumference.value for form in forms if form.circumference],
        [form.reference_plane.value for form in forms if form.reference_plane],
        [form.crown.value for form in forms if form.crown],
    ):
        assert len(values) == 5 and values == sorted(set(values))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass": {"value": 47.0, "source": "x", "verified": False}}, "mass.value"),
        ({"mass": {"value": 4.7, "verified": False}}, "mass.source"),
        ({"inertia": {"value": [0.02, 0.02, 0.05], "source": "x", "verified": False}}, "sum of"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_bad_file_names_key_and_value(
    tmp_path: Path, change: dict[str, object], words: str
) -> None:
    data = yaml.safe_load((FOLDER / "en960_j.yaml").read_text())
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data | change))
    with pytest.raises(SetupError, match=words) as error:
        load_headform(str(path))
    assert "mine.yaml" in str(error.value)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(SetupError, match=r"head.form = 'en960_k'.*en960_j"):
        load_headform("en960_k")


class TestASetup:
    def test_takes_mass_inertia_and_surface_from_its_headform(self) -> None:
        for name in ("en960_a", "hybrid_iii"):
            form = load_headform(name)
            setup = ImpactSetup(rig="headform", overrides={"head.form": name})
            head = Impact(setup).model.body("head")
            assert float(head.mass[0]) == form.mass.value
            assert sorted(head.inertia) == pytest.approx(sorted(form.inertia.value))
            described = setup.described()
            assert (described["head.form"], described["head.surface"]) == (name, form.surface)
            assert setup_from_names(described).described() == described

    def test_may_give_another_surface(self) -> None:
        given = {"head.form": "hybrid_iii", "head.surface": "scalp"}
        assert ImpactSetup(rig="headform", overrides=given).described()["head.surface"] == "scalp"

    def test_a_lighter_headform_is_stopped_harder(self) -> None:
        peaks = [
            float(evaluate(simulate(ImpactSetup(
                rig="headform", direction="front", duration=0.02,
                overrides={"head.form": name, "helmet.coupling": "foam"},
            ))).peak_g)
            for name in ("en960_a", "en960_j", "en960_o")
        ]  # fmt: skip
        assert peaks == sorted(peaks, reverse=True) and peaks[0] > 1.05 * peaks[2]

    def test_refuses_what_a_headform_would_ignore(self) -> None:
        with pytest.raises(SetupError, match=r"head.form.*a rider has a head"):
            ImpactSetup(rig="rider", overrides={"head.form": "en960_j"})
        with pytest.raises(SetupError, match=r"rider.head_mass = 5.0: has no effect"):
            ImpactSetup(rig="headform", overrides={"head.form": "en960_j", "rider.head_mass": 5.0})
        with pytest.raises(SetupError, match=r"head.form = 'en960_k'"):
            setup_from_names({"impact.rig": "headform", "head.form": "en960_k"})


def test_the_oblique_bench_has_every_site_for_every_headform() -> None:
    cases = load_scenario("oblique_bench").cases
    assert len(cases) == 8 * 4 and len({case.name for case in cases}) == len(cases)
    for case in cases:
        setup = case.setup
        assert math.hypot(setup.normal_velocity, setup.tangential_velocity) == pytest.approx(8.0)
        assert setup.resolved_friction == 0.55  # abrasive paper, of the anvil
    named = {case.name: case for case in cases}
    axes = {"nod": 1, "tilt": 0, "turn": 2}  # y, x, z of the head
    for name in ("front nod hybrid_iii", "left tilt hybrid_iii", "front turn hybrid_iii"):
        (case,) = (c for n, c in named.items() if n.startswith(name.rsplit(" ", 1)[0])
                   and c.values["head.form"] == "hybrid_iii")  # fmt: skip
        record = simulate(case.setup)
        spin = np.abs(to_head_axes(record.head_angular_velocity, record.head_orientation))
        assert int(spin.max(axis=0).argmax()) == axes[name.split()[1]], name
