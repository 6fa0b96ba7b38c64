"""The surface of a head in its helmet, as data and as what it does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup, simulate
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.fit import padding_of
from helmet_sim_ros.model.head_surface import HeadSurface, load_head_surface
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.setup import setup_from_names
from helmet_sim_ros.resources import share_directory

SHIPPED = sorted(p.stem for p in (share_directory() / "config" / "head_surfaces").glob("*.yaml"))


def test_the_surfaces_of_heads_and_headforms_are_shipped() -> None:
    assert {"scalp", "hybrid_iii", "en960", "nocsae", "cellbond", "coupling_paper"} <= set(SHIPPED)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_surface_says_where_its_numbers_are_from(name: str) -> None:
    surface = load_head_surface(name)
    assert surface.description and len(surface.source) > 20
    assert 0.1 < surface.friction < 1.0
    assert (surface.thickness > 0.0) == (surface.shear_modulus is not None)


def test_the_published_order_of_friction_is_kept() -> None:
    """Trotta et al. 2018: magnesium, scalp, vinyl."""
    friction = {name: load_head_surface(name).friction for name in SHIPPED}
    assert friction["en960"] < friction["scalp"] < friction["nocsae"] < friction["hybrid_iii"]


def test_a_rider_has_a_scalp_and_a_headform_its_own_surface() -> None:
    assert ImpactSetup().head_surface_name == "scalp"
    assert ImpactSetup(rig="headform").head_surface_name == "en960"
    given = {"impact.rig": "headform", "head.form": "hybrid_iii"}
    assert setup_from_names(given).head_surface_name == "hybrid_iii"
    assert setup_from_names(given | {"head.surface": "scalp"}).head_surface_name == "scalp"


def test_a_friction_of_the_setup_s_own_changes_friction_alone() -> None:
    scalp = load_head_surface("scalp")
    setup = ImpactSetup(overrides={"head.friction": 0.05})
    assert setup.head_surface == scalp.replaced({"friction": 0.05})
    assert setup.described()["head.friction"] == 0.05
    assert ImpactSetup().described()["head.friction"] == scalp.friction
    with pytest.raises(SetupError, match=r"head\.friction = -1"):
        ImpactSetup(overrides={"head.friction": -1.0})


def test_an_unknown_surface_is_refused_with_the_known_ones() -> None:
    with pytest.raises(SetupError, match=r"head\.surface = 'hair'.*scalp"):
        setup_from_names({"head.surface": "hair"})


def test_any_file_is_a_surface_by_its_path(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("friction: 0.4\nthickness: 2e-3\nshear_modulus: 5e4\n")
    assert setup_from_names({"head.surface": str(mine)}).head_surface.thickness == 2e-3
    mine.write_text("friction: 0.4\nthickness: 0.5\n")
    with pytest.raises(SetupError, match=r"mine\.yaml.*thickness = 0\.5"):
        setup_from_names({"head.surface": str(mine)})
    mine.write_text("thickness: 0.001\n")
    with pytest.raises(SetupError, match=r"mine\.yaml.*friction"):
        setup_from_names({"head.surface": str(mine)})


def test_a_skin_shears_and_a_bare_headform_does_not() -> None:
    helmet = load_helmet("fullface")
    assert padding_of(helmet, load_head_surface("en960")).skin == 0.0
    scalp = load_head_surface("scalp")
    assert scalp.shear_modulus is not None
    skin = padding_of(helmet, scalp).skin
    assert skin == pytest.approx(scalp.thickness / scalp.shear_modulus)
    assert padding_of(helmet, HeadSurface(friction=0.1, thickness=2e-3)).skin == 0.0


def test_a_rougher_head_is_turned_more_by_an_oblique_blow() -> None:
    """All else equal; Hybrid III's vinyl is known to exaggerate rotation (Trotta et al. 2018)."""

    def spin(surface: str) -> float:
        record = simulate(ImpactSetup(
            rig="headform", direction="front", tangential_velocity=6.0, duration=0.025,
            tangential_heading_deg=0.0, overrides={"helmet.coupling": "foam",
                                                   "head.surface": surface},
        ))  # fmt: skip
        return float(np.linalg.norm(record.head_angular_velocity, axis=1).max())

    spins = [spin(name) for name in ("en960", "scalp", "hybrid_iii")]
    assert spins[0] < spins[1] < spins[2]
