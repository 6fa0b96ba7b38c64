"""The coupling spring's law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from helmet_sim_ros.model.force import spring as law
from helmet_sim_ros.model.helmet import Spring, SpringLaw

LAW = {"A": 16485.0, "B": 15.0}


def spring(energy_loss: float = 0.85, **sides: dict[str, float]) -> Spring:
    laws = {side: SpringLaw(**sides.get(side, LAW)) for side in set(law.SIDES)}
    return Spring(**laws, energy_loss=energy_loss)


def forces(path: np.ndarray, config: Spring) -> np.ndarray:
    """Force on the shell [N] along a displacement history (n, 3) [m]."""
    virgin, out = law.coupling_spring(config), np.zeros_like(path)
    for row, force in zip(path, out, strict=True):
        law.spring_force(virgin, row, 0.0, force)
    return out


def along(axis: int, values: np.ndarray) -> np.ndarray:
    path = np.zeros((len(values), 3))
    path[:, axis] = values
    return path


@pytest.mark.parametrize(
    ("axis", "sense", "side"),
    [
        (0, -1, "front"),
        (0, 1, "back"),
        (1, -1, "side"),
        (1, 1, "side"),
        (2, -1, "top"),
        (2, 1, "strap"),
    ],
)
def test_loading_follows_the_exponential_of_the_struck_side(
    axis: int, sense: int, side: str
) -> None:
    d = np.linspace(0.0, 0.03, 50)
    config = spring(**{side: {"A": 9000.0, "B": 33.0}})
    force = forces(along(axis, sense * d), config)
    assert force[:, axis] == pytest.approx(-sense * 9000.0 * (np.exp(33.0 * d) - 1.0))
    assert np.all(np.delete(force, axis, axis=1) == 0.0)


@given(
    loss=st.floats(0.0, 0.98),
    exponent=st.floats(1e-3, 300.0),
    peak=st.floats(1e-3, 0.05),
)
@settings(max_examples=60, deadline=None)
def test_a_cycle_loses_the_stated_share_of_its_loading_energy(
    loss: float, exponent: float, peak: float
) -> None:
    config = spring(loss, front={"A": 1000.0, "B": exponent})
    d = np.linspace(0.0, peak, 4001)
    force = forces(along(0, -np.concatenate([d, d[::-1]])), config)[:, 0]
    loaded = trapezoid(force[:4001], d)
    returned = trapezoid(force[4001:][::-1], d)
    assert 1.0 - returned / loaded == pytest.approx(loss, abs=2e-4)


def test_reloading_follows_the_unloading_path_and_then_the_loading_path() -> None:
    down, up = np.linspace(0.02, 0.012, 30), np.linspace(0.012, 0.02, 30)
    path = np.concatenate([np.linspace(0.0, 0.02, 50), down, up, np.linspace(0.02, 0.03, 20)])
    force = -forces(along(2, -path), spring())[:, 2] * -1.0
    assert force[80:110] == pytest.approx(force[50:80][::-1])
    assert force[-1] == pytest.approx(16485.0 * (np.exp(15.0 * 0.03) - 1.0))
    assert force[80] < 0.5 * 16485.0 * (np.exp(15.0 * 0.012) - 1.0)


def test_each_side_has_its_own_law_below_the_largest_compression_in_any_direction() -> None:
    path = np.concatenate(
        [np.linspace(0, 0.02, 20), np.linspace(0.02, 0, 20), np.linspace(0, -0.03, 31)]
    )
    config = spring(front={"A": 9000.0, "B": 33.0})
    force = forces(along(0, path), config)[:, 0]
    assert force[-1] == pytest.approx(9000.0 * np.expm1(33.0 * 0.03))
    at = 40 + 20  # as far to the front as it was to the back: on the loading path again
    assert force[at] == pytest.approx(9000.0 * np.expm1(33.0 * 0.02))
    assert force[at - 5] < 0.5 * 9000.0 * np.expm1(33.0 * 0.015)


def test_equal_laws_make_an_isotropic_spring() -> None:
    """Force along the displacement, its amount that of the law, in every direction and at any
    point of a loop."""
    rng = np.random.default_rng(1)
    d = np.concatenate([np.linspace(0, 0.025, 30), np.linspace(0.025, 0.015, 30)])
    reference = -forces(along(0, d), spring())[:, 0]
    for _ in range(20):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        force = forces(d[:, None] * direction, spring())
        assert force == pytest.approx(-reference[:, None] * direction, rel=1e-9, abs=1e-9)


def test_between_the_axes_each_law_counts_with_the_square_of_its_cosine() -> None:
    config = spring(front={"A": 9000.0, "B": 33.0}, side={"A": 40e3, "B": 8.0})
    d = np.linspace(0.0, 0.02, 50)
    direction = np.array([-0.6, 0.8, 0.0])
    force = forces(d[:, None] * direction, config)
    expected = 0.36 * 9000.0 * np.expm1(33.0 * d) + 0.64 * 40e3 * np.expm1(8.0 * d)
    assert -force @ direction == pytest.approx(expected)
    assert np.cross(force, direction) == pytest.approx(0.0, abs=1e-9)


def test_a_circle_at_the_largest_compression_costs_no_work() -> None:
    """Where all laws are equal: what a rotation of the displacement takes it gives back."""
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    path = 0.02 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    force = forces(np.vstack([np.zeros(3), path]), spring())[1:]
    work = (0.5 * (force[1:] + force[:-1]) * np.diff(path, axis=0)).sum()
    assert work == pytest.approx(0.0, abs=1e-6)


def test_recoverable_energy_is_the_area_that_unloading_returns() -> None:
    d = np.linspace(0.0, 0.025, 3001)
    path = along(0, -np.concatenate([d, d[::-1]]))
    config = spring(0.7)
    force = forces(path, config)[:, 0]
    virgin, out = law.coupling_spring(config), np.zeros(3)
    stored = []
    for row in path:
        law.spring_force(virgin, row, 0.0, out)
        stored.append(law.recoverable_energy(virgin, row))
    assert stored[3000] == pytest.approx(trapezoid(force[3001:][::-1], d), rel=1e-4)
    assert stored[-1] == pytest.approx(0.0, abs=1e-9)
    assert stored[3000] == pytest.approx(0.3 * trapezoid(force[:3001], d), rel=1e-4)


def held(compression: float, rolls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force over that of the law, and how far forward it is borne, at a held compression."""
    virgin, force = law.coupling_spring(spring(0.95)), np.zeros(3)
    displacement = np.array([0.0, 0.0, -compression])
    law.spring_force(virgin, displacement, 0.0, force)
    whole, out = force[2], []
    for rolled in rolls:
        forward = law.spring_force(virgin, displacement, rolled, force)
        out.append((force[2] / whole, forward))
    return np.array(out).T


def test_strips_share_the_area_of_the_disc() -> None:
    place, squares = law.strips_of_disc(8)
    assert place == pytest.approx(-place[::-1]) and np.all(np.diff(place) > 0.0)
    assert squares.mean() == pytest.approx(0.25)  # of x^2 over a disc of radius 1
    leading, _ = law.strips_of_disc(2)
    assert place[4:].mean() == pytest.approx(leading[1]) == pytest.approx(4.0 / (3.0 * np.pi))
    x, y = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 400_000))
    x = np.sort(x[x * x + y * y < 1.0])
    parts = np.array_split(x, 8)
    assert place == pytest.approx([p.mean() for p in parts], abs=3e-3)
    assert squares == pytest.approx([(p**2).mean() for p in parts], abs=3e-3)


def test_a_held_shell_that_rolls_far_is_borne_by_what_leads_and_the_middle() -> None:
    """Trailing strips keep what lies less than their part of the patch is curved below the largest
    compression: of 20 mm at x = 0.1 r, 0.2 mm."""
    share, forward = held(0.02, np.full(2000, 1e-4))
    assert np.all(np.diff(share) <= 1e-12) and np.all(np.diff(forward) >= -1e-12)
    assert share[0] < 1.0 and forward[0] > 0.0
    assert 0.5 < share[-1] < 0.65
    assert 0.3 < forward[-1] < 4.0 / (3.0 * np.pi)


def test_roll_the_other_way_is_the_mirror() -> None:
    ahead, back = held(0.02, np.full(50, 1e-4)), held(0.02, np.full(50, -1e-4))
    assert back[0] == pytest.approx(ahead[0]) and back[1] == pytest.approx(-ahead[1])
    assert np.abs(back[1]).min() > 0.0


def test_across_the_pressure_the_spring_is_as_soft_as_foam_in_shear() -> None:
    """Secant modulus over 2 (1 + nu), with nu = 0.1; one that bears at a point is isotropic."""
    for bears, softer in (("patch", 2.2), ("point", 1.0)):
        virgin, force = law.coupling_spring(spring().replaced({"bears": bears})), np.zeros(3)
        virgin.normal[:] = 0.0, 0.6, 0.8
        law.spring_force(virgin, np.array([0.001, -0.012, -0.016]), 0.0, force)
        pressed = 16485.0 * np.expm1(15.0 * 0.02)
        assert force @ virgin.normal == pytest.approx(pressed, rel=0.005)
        assert -force[0] == pytest.approx(pressed / 0.02 * 0.001 / softer, rel=0.005)
        assert 0.8 * force[1] == pytest.approx(0.6 * force[2])


def test_compressions_of_a_history_are_those_that_the_spring_counts() -> None:
    rng = np.random.default_rng(3)
    shells, pressed = rng.normal(0.0, 0.01, (6, 3)), rng.normal(0.0, 1e3, (6, 3))
    pressed[[0, 3]] = 0.0  # not yet, and no longer
    for bears in ("patch", "point"):
        config = spring().replaced({"bears": bears})
        virgin, expected = law.coupling_spring(config), []
        for shell, force in zip(shells, pressed, strict=True):
            if force.any():
                virgin.normal[:] = force / np.linalg.norm(force)
            expected.append(np.linalg.norm(law.counting(virgin, shell)))
        assert law.compressions(config, shells, pressed) == pytest.approx(expected, rel=1e-12)


def test_what_comes_down_faster_than_roll_raises_it_bears_as_if_it_did_not_roll() -> None:
    virgin, force = law.coupling_spring(spring()), np.zeros(3)
    for d in np.linspace(2e-4, 0.02, 100):  # 0.2 mm each
        forward = law.spring_force(virgin, np.array([0.0, 0.0, -d]), 1.5e-4, force)
        assert forward == 0.0 and force[2] == pytest.approx(16485.0 * np.expm1(15.0 * d))


def test_the_patch_of_a_sphere_has_the_radius_of_its_cap() -> None:
    ball = law.coupling_spring(spring(), (0.14, 0.14, 0.14))
    ball.normal[:] = 0.6, 0.0, 0.8
    expected = np.sqrt(2.0 * 0.14 * 0.02)
    assert law.patch_radius(ball, 0.02) == pytest.approx(expected, rel=1e-12)


def test_the_local_radius_of_an_ellipsoid_is_that_of_its_gaussian_curvature() -> None:
    a, b, c = 0.15, 0.13, 0.14
    shell = law.coupling_spring(spring(), (a, b, c))
    # On the axis x the principal radii are b^2 / a and c^2 / a.
    shell.normal[0] = 1.0
    expected = np.sqrt(2.0 * (b * c / a) * 0.02)
    assert law.patch_radius(shell, 0.02) == pytest.approx(expected, rel=1e-12)


@given(loss=st.floats(0.0, 0.98), x=st.floats(1e-4, 40.0))
@settings(max_examples=200, deadline=None)
def test_the_unloading_exponent_gives_the_share_that_it_was_asked_for(
    loss: float, x: float
) -> None:
    u = law.unloading_exponent(x / 0.03, 0.03, loss) * 0.03
    asked = (1.0 - loss) * law.exponential_share(x)
    assert law.exponential_share(u) == pytest.approx(asked, rel=1e-9)


def test_the_share_is_continuous_where_its_series_takes_over() -> None:
    below, above = law.exponential_share(1e-2 - 1e-9), law.exponential_share(1e-2 + 1e-9)
    assert below == pytest.approx(above, abs=1e-9)
