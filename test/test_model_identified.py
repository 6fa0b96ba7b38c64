"""The coupling spring that follows its liner."""

from __future__ import annotations

import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import Spring, SpringLaw, load_helmet
from helmet_sim_ros.model.identified import SIDES, exponential, exponential_through, identified
from helmet_sim_ros.model.setup import setup_from_names

HELMETS = ("fullface", "bicycle")


@pytest.mark.parametrize("name", HELMETS)
def test_the_laws_in_a_helmet_s_file_are_those_of_its_liner(name: str) -> None:
    helmet = load_helmet(name)
    found = identified(helmet)
    assert helmet.spring.identified and found.identified
    for side in (*SIDES, "strap"):
        stored, fresh = getattr(helmet.spring, side), getattr(found, side)
        assert pytest.approx((stored.A, stored.B), rel=1e-4) == (fresh.A, fresh.B), side
    assert helmet.spring.energy_loss == pytest.approx(found.energy_loss, rel=1e-4)


def test_the_present_spring_has_no_say_in_it() -> None:
    helmet, law = load_helmet("fullface"), SpringLaw(A=1.0, B=1.0)
    other = Spring(front=law, back=law, side=law, top=law, strap=law, energy_loss=0.0)
    assert identified(helmet.model_copy(update={"spring": other})) == identified(helmet)


def test_a_known_law_is_found_again() -> None:
    compression = np.linspace(0.005, 0.03, 4)
    force = 3e4 * np.expm1(14.0 * compression)
    stiffness, exponent, _ = exponential_through(compression, force)
    assert (stiffness / exponent, exponent) == pytest.approx((3e4, 14.0), rel=1e-5)
    assert exponential(compression, stiffness, exponent) == pytest.approx(force, rel=1e-5)


def test_a_liner_as_stiff_as_is_allowed_has_a_spring() -> None:
    """Its law is nearly straight: it was refused, for an A above 1e9 N that nobody had given."""
    setup = ImpactSetup(overrides={"helmet.liner.front.density": 120.0})
    law = setup.helmet_config.spring.front
    assert law.B < 1.0 and 1e6 < law.A * law.B < 1e8


@pytest.mark.parametrize(
    "changes",
    [
        {"shell.contact_stiffness": 1.1e4},  # bends further than the liner crushes
        {"liner.inner.share": 0.91, "shell.contact_stiffness": 3.6e5},
    ],
)
def test_a_liner_that_no_spring_follows_is_told_by_what_was_changed(
    changes: dict[str, float],
) -> None:
    given = {f"helmet.{name}": value for name, value in changes.items()}
    with pytest.raises(SetupError, match="no spring follows this liner") as caught:
        setup_from_names(given)
    assert {problem.key: problem.value for problem in caught.value.problems} == given


@pytest.mark.parametrize("speed", [5.0, 7.5])
@pytest.mark.parametrize("side", SIDES)
def test_a_drop_with_the_spring_is_a_drop_with_its_foam(side: str, speed: float) -> None:
    common = {"rig": "headform", "direction": side, "normal_velocity": speed, "duration": 0.03}
    found = []
    for form in ("spring", "foam"):
        record = simulate(ImpactSetup(overrides={"helmet.coupling": form}, **common))
        result = evaluate(record)
        rebound = float(record.head_velocity[-1, 2]) / speed
        found.append((float(result.peak_g), float(result.hic), rebound))
    (peak, hic, rebound), (foam_peak, foam_hic, foam_rebound) = found
    assert peak == pytest.approx(foam_peak, rel=0.03)
    assert hic == pytest.approx(foam_hic, rel=0.09)  # 7.8 % at most, front at 7.5 m/s
    assert rebound == pytest.approx(foam_rebound, abs=0.06)
