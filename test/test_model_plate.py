"""The grid of the shell's plate: statics in closed form, balance, the step that it bears."""

from __future__ import annotations

import numpy as np
import pytest

from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.force.plate import (
    MASS,
    SHARE,
    STIFFEST,
    Plate,
    bend,
    move,
    plate,
    pull_back,
    rests,
    soften,
)
from helmet_sim_ros.model.helmet import load_helmet


def grid(**material: float) -> Plate:
    """The plate of ``fullface``, of another material if told, high above any anvil."""
    helmet = load_helmet("fullface")
    shell = helmet.shell
    changed = shell.material.model_copy(update=material)
    own = plate(shell.model_copy(update={"material": changed}), columns(helmet))
    own.anvil[:] = -1.0
    return own


def shaken(own: Plate) -> Plate:
    own.height[:] = 1e-3 * np.random.default_rng(1).standard_normal(own.height.shape)
    return own


def test_the_plates_own_forces_add_up_to_no_force_and_no_moment() -> None:
    own = shaken(grid())
    soften(own)
    assert own.softened[:, 1:-1, 1:-1].min() < 0.5  # its strength is reached
    pull_back(own, own.longest)
    n = len(own.pull)
    x = np.arange(n)[:, None] * np.ones((1, n))
    size = np.abs(own.pull).sum()
    assert size > 0.0
    assert abs(own.pull.sum()) < 1e-9 * size
    assert abs((own.pull * x).sum()) < 1e-9 * size * n
    assert abs((own.pull * x.T).sum()) < 1e-9 * size * n
    move(own, own.longest, np.inf)  # smoothed, they still add up to none
    assert abs(own.speed.sum()) < 1e-9 * np.abs(own.speed).sum()


def test_a_plane_plate_does_not_resist() -> None:
    own = grid()
    x = np.arange(len(own.height))[:, None] * 1e-3
    own.height[:] = x + 2.0 * x.T
    soften(own)
    bend(own)
    assert np.abs(own.bent).max() < 1e-9


@pytest.mark.parametrize("turned", [False, True])
def test_a_strip_on_two_supports_sags_as_beam_theory_says(turned: bool) -> None:
    """5 q L^4 / (384 D) in the middle, without inertia, smoothing or damping."""
    own = grid(poisson=0.0, strength=5e9)
    height, anvil, pressed = (
        a.T if turned else a for a in (own.height, own.anvil, own.pressed)
    )  # fmt: skip
    middle, half = len(height) // 2, 10
    anvil[middle - half] = anvil[middle + half] = 0.0
    pressure, span = 2e4, 2 * half * own.cell
    pressed[middle - half : middle + half + 1] = pressure * own.cell**2
    sag = 5.0 * pressure * span**4 / (384.0 * own.stiffness)
    for step in range(8000):
        if step % 20 == 0:
            soften(own)
        move(own, own.longest, np.inf)
        own.speed[:] *= 0.99  # comes to rest soon
    assert np.abs(own.speed).max() < 1e-3
    assert -height[middle] == pytest.approx(sag, rel=0.01)
    assert height[middle - half] == pytest.approx(0.0, abs=1e-12)


def largest_eigenvalue(own: Plate, free: np.ndarray) -> float:
    """Of the smoothed stiffness [D / cell^4], with the nodes that are not free held."""
    own = own._replace(lag=0.0)
    soften(own)  # flat: nothing is softened
    shape = np.random.default_rng(2).standard_normal(free.shape) * free
    step, value = 1e-12, 0.0
    for _ in range(400):
        own.height[:] = 1e-6 * shape / np.abs(shape).max()
        own.speed[:] = own.slow[:] = 0.0
        before = own.height.copy()
        move(own, step, np.inf)
        shape = -own.speed * MASS / step * free
        value = float((shape * before).sum() / (before * before).sum())
    return value * own.cell**4 / own.stiffness


def test_no_wave_is_stiffer_than_the_step_allows() -> None:
    own = grid()
    n = len(own.height)
    x, y = np.meshgrid(range(n), range(n), indexing="ij")
    c = n // 2
    ring = np.round(np.hypot(x - c, y - c)) == 5
    few, many = (np.random.default_rng(3).random((n, n)) < share for share in (0.1, 0.4))
    held = {
        "none": np.zeros((n, n), bool), "line": x == c, "diagonal": x == y, "ring": ring,
        "patch": np.hypot(x - c, y - c) < 4, "few": few, "many": many,
    }  # fmt: skip
    worst = {name: largest_eigenvalue(own, ~nodes) for name, nodes in held.items()}
    assert max(worst.values()) < 1.05 * STIFFEST, worst
    assert largest_eigenvalue(own, (x + y) % 2 == 1) < STIFFEST / SHARE**2
    assert worst["none"] > 0.6 * STIFFEST  # no step is given away


def test_it_rests_as_long_as_what_presses_it_lies_on_the_anvil() -> None:
    own = grid()
    own.anvil[5:9, 5:9] = 0.0
    own.steepness[6, 6] = 1e5
    assert rests(own)
    own.steepness[9, 6] = 1e5
    assert not rests(own)


def test_what_the_anvil_bears_does_not_pull_the_next_nodes_down() -> None:
    own = grid()
    c = len(own.height) // 2
    own.anvil[c, c] = 0.0
    own.pressed[c, c] = 1e3
    soften(own)
    for _ in range(50):
        move(own, own.longest, np.inf)
    assert np.abs(own.height).max() == 0.0
