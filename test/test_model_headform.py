"""Headforms as data."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.headform import load_headform
from helmet_sim_ros.resources import share_directory

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
