"""The coupling spring's law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from helmet_sim_ros.model import coupling
from helmet_sim_ros.model.helmet import Spring, SpringLaw

LAW = {"A": 16485.0, "B": 15.0}


def spring(energy_loss: float = 0.85, **sides: dict[str, float]) -> Spring:
    laws = {side: SpringLaw(**sides.get(side, LAW)) for side in set(coupling.SIDES)}
    return Spring(**laws, energy_loss=energy_loss)


def forces(path: np.ndarray, config: Spring) -> np.ndarray:
    """Force on the shell [N] along a displacement history (n, 3) [m]."""
    state, out = coupling.new_state(), np.zeros_like(path)
    for row, force in zip(path, out, strict=True):
        coupling.spring_force(row, coupling.law_table(config), config.energy_loss, state, force)
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


def test_the_sides_of_an_axis_keep_separate_histories() -> None:
    path = np.concatenate(
        [np.linspace(0, 0.02, 20), np.linspace(0.02, 0, 20), np.linspace(0, -0.02, 20)]
    )
    force = forces(along(1, path), spring())[:, 1]
    assert force[-1] == pytest.approx(-force[19])


def test_recoverable_energy_is_the_area_that_unloading_returns() -> None:
    d = np.linspace(0.0, 0.025, 3001)
    path = along(0, -np.concatenate([d, d[::-1]]))
    config = spring(0.7)
    force = forces(path, config)[:, 0]
    stored = coupling.recoverable_energy(path, config)
    assert stored[3000] == pytest.approx(trapezoid(force[3001:][::-1], d), rel=1e-4)
    assert stored[-1] == pytest.approx(0.0, abs=1e-9)
    assert stored[3000] == pytest.approx(0.3 * trapezoid(force[:3001], d), rel=1e-4)


def test_the_share_is_continuous_where_its_series_takes_over() -> None:
    below, above = coupling.exponential_share(1e-2 - 1e-9), coupling.exponential_share(1e-2 + 1e-9)
    assert below == pytest.approx(above, abs=1e-9)
