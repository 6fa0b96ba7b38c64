"""Rotational criteria against independent integration and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech import bric, damage, hic, klc, ric, to_head_axes, ubric
from helmet_sim_ros.biomech.rotation import matrices, quaternions, rotation_vectors

Array = NDArray[np.float64]


def wandering(seed: int, samples: int = 300, scale: float = 300.0) -> Array:
    return np.cumsum(np.random.default_rng(seed).normal(size=(samples, 3)), axis=0) * scale


def integrated_damage(alpha: Array, step: float) -> float:
    """The published equations of motion, in SAE axes, by a general solver."""
    time = np.arange(len(alpha)) * step
    sae = alpha * [1, -1, -1]
    kxx, kyy, kzz, kxy, kyz, kxz = 32142.0, 23493.0, 16935.0, 0.0, 0.0, 1636.3
    stiffness = np.array([
        [kxx + kxy + kxz, -kxy, -kxz],
        [-kxy, kxy + kyy + kyz, -kyz],
        [-kxz, -kyz, kxz + kyz + kzz],
    ])  # fmt: skip

    def motion(t: float, state: Array) -> Array:
        drive = np.array([np.interp(t, time, sae[:, i]) for i in range(3)])
        x, v = state[:3], state[3:]
        return np.concatenate((v, drive - stiffness @ x - 5.9148e-3 * stiffness @ v))

    solution = solve_ivp(
        motion, (0, time[-1]), np.zeros(6), t_eval=time, rtol=1e-8, atol=1e-12, max_step=step
    )
    return float(2.9903 * np.linalg.norm(solution.y[:3], axis=0).max())


@pytest.mark.parametrize("seed", [1, 2])
def test_damage_agrees_with_an_independent_integration(seed: int) -> None:
    alpha = wandering(seed)
    assert damage(alpha, 1e-4) == pytest.approx(integrated_damage(alpha, 1e-4), rel=1e-5)


def test_damage_with_an_acceleration_that_starts_at_once() -> None:
    alpha = np.tile([4000.0, -2500.0, 3000.0], (60, 1))
    assert damage(alpha, 5e-4) == pytest.approx(integrated_damage(alpha, 5e-4), rel=1e-5)


def test_a_lasting_acceleration_settles_at_the_static_displacement() -> None:
    """About y, which is not coupled: x = alpha / k, with an overshoot below 100 %."""
    value = damage(np.tile([0.0, 1000.0, 0.0], (40000, 1)), 1e-4)
    static = 2.9903 * 1000 / 23493.0
    ratio = 0.5 * 5.9148e-3 * np.sqrt(23493.0)  # of critical damping
    overshoot = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    assert value == pytest.approx(static * (1 + overshoot), rel=1e-6)


def test_damage_is_linear_and_converges_with_the_time_step() -> None:
    alpha = wandering(3)
    assert damage(-2.5 * alpha, 1e-4) == pytest.approx(2.5 * damage(alpha, 1e-4), rel=1e-12)
    time, fine = np.arange(300) * 1e-4, np.arange(2991) * 1e-5
    refined = np.stack([np.interp(fine, time, alpha[:, i]) for i in range(3)], axis=1)
    # The same straight lines: only the peak is seen more finely.
    assert damage(refined, 1e-5) == pytest.approx(damage(alpha, 1e-4), rel=2e-4)
    assert damage(alpha[:2], 1e-4) > 0


def test_the_coupling_of_damage_knows_the_sense_of_z() -> None:
    together = np.tile([3000.0, 0.0, -3000.0], (400, 1))  # same sign in SAE axes: spring between
    apart = np.tile([3000.0, 0.0, 3000.0], (400, 1))  # them slack when equal, else it stiffens
    assert damage(together, 1e-4) > damage(apart, 1e-4) * 1.05


def test_bric_is_the_norm_over_the_axes_whenever_the_peaks_occur() -> None:
    omega = np.zeros((10, 3))
    omega[2, 0], omega[5, 1], omega[7, 2] = 66.25, -56.45, 42.87
    assert bric(omega) == pytest.approx(np.sqrt(3))
    assert bric(omega * [1, 0, 0], "mps") == pytest.approx(66.25 / 66.30)
    assert bric(omega * [0, 1, 0], "csdm") == pytest.approx(56.45 / 59.10)
    assert bric(np.zeros((10, 3))) == 0.0


@pytest.mark.parametrize(
    ("critical", "values"),
    [
        ("average", (66.25, 56.45, 42.87)),
        ("mps", (66.30, 53.80, 41.50)),
        ("csdm", (66.20, 59.10, 44.25)),
    ],
)
def test_bric_is_1_at_each_published_critical_velocity(
    critical: str, values: tuple[float, ...]
) -> None:
    for axis, value in enumerate(values):
        omega = np.zeros((5, 3))
        omega[3, axis] = -value
        assert bric(omega, critical) == pytest.approx(1.0, rel=1e-12)  # type: ignore[arg-type]


def test_bric_and_ubric_agree_with_an_independent_library() -> None:
    injury = pytest.importorskip("dynars").injury
    omega, alpha = np.abs(wandering(4, scale=3.0)), wandering(5)
    omega[0] = 0.0  # one-sided from 0: peak to peak is the peak, which that library takes
    axes = [np.ascontiguousarray(a) for a in omega.T]
    assert bric(omega) == pytest.approx(injury.bric(*axes, 66.25, 56.45, 42.87))
    axes += [np.ascontiguousarray(a) for a in alpha.T]
    expected = injury.ubric(*axes, 211.0, 171.0, 115.0, 20000.0, 10300.0, 7760.0)
    assert ubric(omega, alpha) == pytest.approx(expected)


def test_ubric_has_its_two_limits() -> None:
    """A short pulse is judged by velocity, w*, a long one by acceleration, 2 a*."""
    time = np.linspace(0, 1, 201)
    for length, limit in ((1e-5, "velocity"), (10.0, "acceleration")):
        omega = np.zeros((201, 3))
        alpha = np.zeros((201, 3))
        omega[:, 1] = 50.0 * np.sin(np.pi * time) ** 2
        alpha[:, 1] = 50.0 * np.pi / length * np.sin(2 * np.pi * time)
        w, a = 50.0 / 171.0, 50.0 * np.pi / length / 10300.0
        assert ubric(omega, alpha) == pytest.approx(w if limit == "velocity" else 2 * a, rel=1e-2)


def test_ubric_of_velocity_and_its_integrated_acceleration() -> None:
    """The velocity from integrating the acceleration gives the same value as the exact one."""
    time = np.arange(801) * 5e-5
    alpha = np.stack([3000 * np.sin(2 * np.pi * f * time) for f in (25, 50, 100)], axis=1)
    exact = np.stack(
        [3000 * (1 - np.cos(2 * np.pi * f * time)) / (2 * np.pi * f) for f in (25, 50, 100)], axis=1
    )
    integrated = solve_ivp(
        lambda t, _: 3000 * np.sin(2 * np.pi * np.array([25, 50, 100]) * t),
        (0, time[-1]), np.zeros(3), t_eval=time, rtol=1e-10, atol=1e-10, max_step=1e-3,
    ).y.T  # fmt: skip
    assert ubric(integrated, alpha) == pytest.approx(ubric(exact, alpha), rel=1e-6)


def test_a_constant_offset_of_the_velocity_does_not_count_in_ubric() -> None:
    omega, alpha = wandering(6, scale=2.0), wandering(7)
    assert ubric(omega + np.array([30, -20, 10]), alpha) == pytest.approx(ubric(omega, alpha))


def test_ric_is_the_formula_of_hic() -> None:
    alpha = np.abs(wandering(8, scale=0.5))
    assert ric(alpha, 1e-4).value == pytest.approx(hic(alpha, 1e-4, 0.036).value)
    big = ric(1e4 * alpha, 1e-4)  # no unit check: thousands of rad/s^2 are usual
    assert big.value == pytest.approx(1e10 * ric(alpha, 1e-4).value, rel=1e-9)


def test_klc_is_linear() -> None:
    assert klc(40.0, 1000.0) == pytest.approx(0.004718 * 40 + 0.224)


def test_head_axes_are_those_of_the_orientation() -> None:
    random = np.random.default_rng(1)
    turn, vectors = Rotation.from_quat(random.normal(size=(50, 4))), random.normal(size=(50, 3))
    assert to_head_axes(vectors, turn.as_quat()) == pytest.approx(turn.inv().apply(vectors))
    # Head turned to the left by 90 deg: what points to world x comes from the head's right.
    quarter = Rotation.from_euler("z", 90, degrees=True).as_quat()
    right = to_head_axes([[1.0, 0.0, 0.0]] * 2, [quarter] * 2)
    assert right[0] == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)


def test_rotation_vectors_quaternions_and_matrices_are_those_of_a_library() -> None:
    turns = Rotation.random(500, random_state=3)
    q, v = turns.as_quat(), turns.as_rotvec()
    assert rotation_vectors(q) == pytest.approx(v, abs=1e-12)
    assert rotation_vectors(-q) == pytest.approx(v, abs=1e-12)  # the same rotation
    assert matrices(q) == pytest.approx(turns.as_matrix(), abs=1e-12)
    assert matrices(quaternions(v)) == pytest.approx(turns.as_matrix(), abs=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-13, 1e-9, 1e-4, np.pi - 1e-9])
def test_a_rotation_of_any_size_comes_back(size: float) -> None:
    vector = size * np.array([[0.6, -0.64, 0.48]])
    assert rotation_vectors(quaternions(vector)) == pytest.approx(vector, rel=1e-6, abs=1e-18)
