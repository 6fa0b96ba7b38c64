"""A helmet with values changed: what has no effect is refused, what follows follows."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.forms import worn
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.identified import SIDES
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names
from helmet_sim_ros.resources import share_directory

FULLFACE = load_helmet("fullface")
FOAM = {"coupling": "foam"}


def own_spring(tmp_path: Path) -> Helmet:
    """A helmet whose file gives a spring of the user's."""
    path = share_directory() / "config" / "helmets" / "fullface.yaml"
    data = yaml.safe_load(path.read_text())
    data["spring"]["identified"] = False
    mine = tmp_path / "mine.yaml"
    mine.write_text(yaml.safe_dump(data))
    return load_helmet(str(mine))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("spring.side.A", 7e4),
        ("spring.energy_loss", 0.5),
        ("shell.contact_stiffness", 3e6),
        ("shell.contact_damping", 0.3),
        ("shell.contact_returned", 0.5),
    ],
)
def test_a_foam_helmet_refuses_values_of_the_spring(name: str, value: float) -> None:
    with pytest.raises(SetupError, match=rf"{name} = .*no effect.*coupling is foam"):
        worn(FULLFACE, {**FOAM, name: value})
    with pytest.raises(SetupError, match=rf"^helmet\.{name} = .*no effect") as refused:
        setup_from_names({"helmet.coupling": "foam", f"helmet.{name}": value})
    assert "overrides" not in str(refused.value)
    assert worn(FULLFACE, {name: value}).coupling == "spring"


@pytest.mark.parametrize("name", ["shell.material.thickness", "shell.cell"])
def test_a_spring_helmet_refuses_what_bends_the_shell(tmp_path: Path, name: str) -> None:
    """Its shell is rigid on whatever it strikes."""
    value = 0.004
    for helmet in (FULLFACE, own_spring(tmp_path)):
        with pytest.raises(SetupError, match=rf"{name} = .*no effect.*coupling is spring"):
            worn(helmet, {name: value})
        assert worn(helmet, {**FOAM, name: value}).coupling == "foam"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("liner.density", 60.0),
        ("liner.energy_returned", 0.1),
        ("liner.columns", 500),
        ("liner.front.density", 60.0),
    ],
)
def test_a_spring_of_the_user_s_own_refuses_values_of_the_foam(
    tmp_path: Path, name: str, value: float
) -> None:
    helmet = own_spring(tmp_path)
    with pytest.raises(SetupError, match=rf"{name} = .*no effect.*its own spring"):
        worn(helmet, {name: value})
    assert worn(helmet, {**FOAM, name: value}).coupling == "foam"
    assert worn(FULLFACE, {name: value}).spring.identified


def test_every_refused_name_is_told_and_a_value_that_changes_nothing_is_none() -> None:
    changes = {**FOAM, "spring.side.A": 7e4, "shell.contact_damping": 0.3}
    with pytest.raises(SetupError) as refused:
        worn(FULLFACE, changes)
    assert [p.key for p in refused.value.problems] == ["spring.side.A", "shell.contact_damping"]
    same = {**FOAM, "spring.side.A": FULLFACE.spring.side.A}
    assert worn(FULLFACE, same) == FULLFACE.replaced(FOAM)


def test_the_identified_spring_follows_the_density_of_its_liner() -> None:
    springs = [worn(FULLFACE, {"liner.density": d}).spring for d in (35.0, 50.0, 75.0)]
    for side in SIDES:
        forces = [getattr(s, side).A * getattr(s, side).B for s in springs]
        assert forces == sorted(forces), side
        assert forces[2] > 1.4 * forces[0]
        assert getattr(springs[1], side) == getattr(FULLFACE.spring, side)
    assert all(s.identified for s in springs)


def test_a_zone_changes_the_law_of_its_own_side_most() -> None:
    changed = worn(FULLFACE, {"liner.front.density": 80.0}).spring
    ratio = {side: getattr(changed, side).A * getattr(changed, side).B
             / getattr(FULLFACE.spring, side).A / getattr(FULLFACE.spring, side).B
             for side in SIDES}  # fmt: skip
    assert ratio["front"] == max(ratio.values()) and ratio["front"] > 1.2
    assert ratio["back"] == pytest.approx(1.0, rel=0.01)


def test_a_spring_value_given_beside_a_liner_s_is_kept() -> None:
    made = worn(FULLFACE, {"liner.density": 70.0, "spring.energy_loss": 0.6})
    assert made.spring.energy_loss == 0.6
    assert made.spring.side.A > FULLFACE.spring.side.A


def test_what_concerns_neither_leaves_the_spring_alone() -> None:
    made = worn(FULLFACE, {"padding.modulus": 80e3, "strap.slack": 0.01, "inertia": (0.02,) * 3})
    assert made.spring == FULLFACE.spring
    assert made.padding.modulus == 80e3


@pytest.mark.parametrize(
    "overrides",
    [
        {},
        {"helmet.coupling": "foam", "helmet.liner.density": 63.0, "helmet.padding.modulus": 70e3},
        {"helmet.liner.density": 63.0},
        {"helmet.liner.front.thickness": 0.03, "helmet.spring.energy_loss": 0.7},
        {"helmet.name": "bicycle"},
        {"helmet.name": "fullface_paper"},
        {"head.friction": 0.3, "head.surface": "hybrid_iii"},
    ],
)
def test_the_description_of_a_setup_gives_back_its_helmet(overrides: dict[str, object]) -> None:
    """What a log keeps: all constants, those of an identified spring among them."""
    setup = ImpactSetup(overrides=overrides)
    again = setup_from_names(setup.described())
    assert again.helmet_config == setup.helmet_config
    assert again.described() == setup.described()
    assert again.head_surface == setup.head_surface


@pytest.mark.parametrize("coupling", ["spring", "foam"])
@pytest.mark.parametrize("mass", [0.18, 0.5, 1.35])
def test_a_helmet_weighs_what_it_is_said_to(coupling: str, mass: float) -> None:
    values = {"helmet.coupling": coupling, "helmet.mass": mass, "head.form": "en960_j"}
    model = Impact(ImpactSetup(rig="headform", overrides=values)).model
    assert model.body_mass.sum() == pytest.approx(4.7 + mass, rel=1e-12)


@pytest.mark.parametrize("coupling", ["spring", "foam"])
def test_a_helmet_lighter_than_what_is_struck_of_it_is_refused(coupling: str) -> None:
    with pytest.raises(SetupError) as refused:
        ImpactSetup(overrides={"helmet.coupling": coupling, "helmet.mass": 0.15})
    assert {"helmet.mass", "helmet.shell.effective_mass", "helmet.liner.effective_mass"} == {
        problem.key for problem in refused.value.problems
    }
