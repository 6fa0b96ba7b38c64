"""The grid of the shell's plate: statics in closed form, balance, the step that it bears."""

from __future__ import annotations

import numpy as np
import pytest

from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.force.plate import (
    COLUMNS,
    MASS,
    REAL,
    ROWS,
    STIFFEST,
    Plate,
    bend,
    flies,
    free_nodes,
    height_at,
    move,
    plate,
    pull_back,
    rests,
    soften,
)
from helmet_sim_ros.model.helmet import load_helmet

N = 33  # rows and columns of the windows here


def grid(**material: float) -> Plate:
    """The plate of ``fullface``, of another material if told, high above any anvil."""
    helmet = load_helmet("fullface")
    shell = helmet.shell
    changed = shell.material.model_copy(update=material)
    own = plate(shell.model_copy(update={"material": changed}), columns(helmet))
    own.window[ROWS], own.window[COLUMNS] = N, N
    own.anvil[:] = -1.0
    own.free[:] = 1.0
    return own


def inside(a: np.ndarray) -> np.ndarray:
    """The nodes of the window, (..., N, N), without the ring around them."""
    whole = (N + 2) ** 2
    return a[..., :whole].reshape(*a.shape[:-1], N + 2, N + 2)[..., 1:-1, 1:-1]


def shaken(own: Plate) -> Plate:
    inside(own.height)[:] = 1e-3 * np.random.default_rng(1).standard_normal((N, N))
    return own


def test_the_plates_own_forces_add_up_to_no_force_and_no_moment() -> None:
    own = shaken(grid())
    soften(own)
    assert inside(own.softened)[:, 1:-1, 1:-1].min() < 0.5  # its strength is reached
    pull_back(own, own.longest)
    pull = inside(own.pull).astype(float)
    x = np.arange(N)[:, None] * np.ones((1, N))
    size, exact = np.abs(pull).sum(), np.finfo(REAL).eps
    assert size > 0.0
    assert abs(pull.sum()) < exact * size
    assert abs((pull * x).sum()) < exact * size * N
    assert abs((pull * x.T).sum()) < exact * size * N
    move(own, own.longest, np.inf)  # smoothed, they still add up to none
    speed = inside(own.speed).astype(float)
    assert abs(speed.sum()) < exact * np.abs(speed).sum()


def test_a_plane_plate_does_not_resist() -> None:
    own = grid()
    x = np.arange(N)[:, None] * 2.0**-10  # of which sums have no rounding
    inside(own.height)[:] = x + 2.0 * x.T
    soften(own)
    bend(own)
    assert np.abs(inside(own.moments)).max() < 1e-2  # of 10 at its strength


def test_beyond_the_window_it_goes_on_straight_and_then_level() -> None:
    own = grid()
    x = np.arange(N)[:, None] * 1e-3
    inside(own.height)[:] = x + 2.0 * x.T
    far = own.overhang
    assert 2.0 < far < 8.0
    assert height_at(own, own.height, 3.25, 7.5) == pytest.approx(18.25e-3, abs=1e-8)
    assert height_at(own, own.height, -2.0, 5.0) == pytest.approx(8e-3, abs=1e-8)
    assert height_at(own, own.height, 5.0, N + 1.0) == pytest.approx(7e-2 + 3e-3, abs=1e-8)
    for away in (far + 1.0, far + 20.0):
        height = height_at(own, own.height, -away, 0.0)
        assert height == pytest.approx(-far * 1e-3, abs=1e-8)


@pytest.mark.parametrize("turned", [False, True])
def test_a_strip_on_two_supports_sags_as_beam_theory_says(turned: bool) -> None:
    """5 q L^4 / (384 D) in the middle, without inertia, smoothing or damping."""
    own = grid(poisson=0.0, strength=5e9)
    height, anvil, pressed = (
        inside(a).T if turned else inside(a) for a in (own.height, own.anvil, own.pressed)
    )  # fmt: skip
    middle, half = len(height) // 2, 10
    anvil[middle - half] = anvil[middle + half] = 0.0
    pressure, span = 2e4, 2 * half * own.cell
    pressed[middle - half : middle + half + 1] = pressure * own.cell**2
    sag = 5.0 * pressure * span**4 / (384.0 * own.stiffness)
    for step in range(8000):
        if step % 20 == 0:
            soften(own)
            free_nodes(own)
        move(own, own.longest, np.inf)
        own.speed[:] *= 0.99  # comes to rest soon
    assert np.abs(inside(own.speed)).max() < 1e-3
    assert -height[middle] == pytest.approx(sag, rel=0.01)
    assert height[middle - half] == pytest.approx(0.0, abs=1e-8)


def largest_eigenvalue(own: Plate, held: np.ndarray) -> float:
    """Of the smoothed stiffness [D / cell^4], with nodes held by the anvil."""
    own = own._replace(lag=0.0)
    for a in (own.height, own.speed, own.slow, own.pressed):
        a[:] = 0.0
    soften(own)  # flat: nothing is softened
    inside(own.anvil)[:] = np.where(held, 0.0, -1.0)
    inside(own.pressed)[:] = np.where(held, 1e6, 0.0)
    free_nodes(own)
    shape = np.random.default_rng(2).standard_normal(held.shape) * ~held
    step, value = 1e-12, 0.0
    for _ in range(400):
        inside(own.height)[:] = 1e-6 * shape / np.abs(shape).max()
        own.speed[:] = own.slow[:] = 0.0
        before = inside(own.height).astype(float)
        move(own, step, np.inf)
        shape = -inside(own.speed).astype(float) * MASS / step * ~held
        value = float((shape * before).sum() / (before * before).sum())
    return value * own.cell**4 / own.stiffness


def test_no_wave_is_stiffer_than_the_step_allows() -> None:
    own = grid()
    x, y = np.meshgrid(range(N), range(N), indexing="ij")
    c = N // 2
    ring = np.round(np.hypot(x - c, y - c)) == 5
    few, many = (np.random.default_rng(3).random((N, N)) < share for share in (0.1, 0.4))
    held = {
        "none": np.zeros((N, N), bool), "line": x == c, "diagonal": x == y, "ring": ring,
        "patch": np.hypot(x - c, y - c) < 4, "few": few, "many": many, "every other": x % 2 == 0,
        "chess": (x + y) % 2 == 0,
    }  # fmt: skip
    worst = {name: largest_eigenvalue(own, nodes) for name, nodes in held.items()}
    assert max(worst.values()) < STIFFEST, worst
    assert worst["none"] > 0.8 * STIFFEST  # no step is given away


def test_it_rests_as_long_as_what_presses_it_lies_on_the_anvil() -> None:
    own = grid()
    inside(own.anvil)[5:9, 5:9] = 0.0
    inside(own.steepness)[6, 6] = 1e5
    assert rests(own)
    inside(own.steepness)[9, 6] = 1e5
    assert not rests(own)


def test_it_flies_when_nothing_is_below_it() -> None:
    own = grid()
    assert flies(own, 0.01)
    inside(own.anvil)[-1, -1] = -0.009
    assert not flies(own, 0.01)


def test_what_the_anvil_bears_does_not_pull_the_next_nodes_down() -> None:
    own = grid()
    c = N // 2
    inside(own.anvil)[c, c] = 0.0
    inside(own.pressed)[c, c] = 1e3
    soften(own)
    for _ in range(50):
        move(own, own.longest, np.inf)
    assert np.abs(inside(own.height)).max() == 0.0
