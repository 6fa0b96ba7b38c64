"""A fast stand-in for the simulation: residual crush at the measured places, interpolated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.linalg import solve_triangular

from helmet_sim_ros.biomech.record import FloatArray

KEPT = 1e-4  # share of the variance that may be left out of the principal components
FOLDS = 5
KERNEL = "thin_plate_spline"


class Emulator:
    """Radial basis functions (thin plates) over the parameters, in principal components.

    Attributes:
        mean: of the crush at each place, (places,) [m].
        axes: principal components, (k, places).
        apart: errors at each place by cross-validation, (n, places) [m].
    """

    def __init__(self, points: FloatArray, crush: FloatArray) -> None:
        """Learn from simulated crashes.

        Args:
            points: parameters, (n, p).
            crush: at the places, (n, places) [m].
        """
        self._middle = points.mean(axis=0)
        self._to_unit = np.linalg.inv(np.linalg.cholesky(np.cov(points.T))).T
        self.mean: FloatArray = crush.mean(axis=0)
        _, weight, axes = np.linalg.svd(crush - self.mean, full_matrices=False)
        share = np.cumsum(weight**2) / max(float((weight**2).sum()), 1e-30)
        self.axes: FloatArray = axes[: int(np.searchsorted(share, 1.0 - KEPT)) + 1]
        scaled = self._scaled(points)
        self._low, self._high = scaled.min(axis=0), scaled.max(axis=0)
        components = (crush - self.mean) @ self.axes.T
        self._surface = RBFInterpolator(scaled, components, kernel=KERNEL)
        self.apart: FloatArray = np.empty_like(crush)
        for k in range(FOLDS):
            held = np.arange(len(points)) % FOLDS == k
            partial = RBFInterpolator(scaled[~held], components[~held], kernel=KERNEL)
            self.apart[held] = self.mean + partial(scaled[held]) @ self.axes - crush[held]

    def components(self, points: FloatArray) -> FloatArray:
        """Along ``axes``, (n, k) [m]."""
        along: FloatArray = self._surface(self._scaled(points))
        return along

    def __call__(self, points: FloatArray) -> FloatArray:
        """Crush at the places, (n, places) [m]."""
        crush: FloatArray = self.mean + self.components(points) @ self.axes
        return crush

    def _scaled(self, points: FloatArray) -> FloatArray:
        scaled: FloatArray = (points - self._middle) @ self._to_unit
        return scaled

    def knows(self, points: FloatArray) -> NDArray[np.bool_]:
        """Whether points lie among those that it has learnt from, (n,)."""
        scaled = self._scaled(points)
        inside: NDArray[np.bool_] = ((scaled >= self._low) & (scaled <= self._high)).all(axis=1)
        return inside


class Likelihood:
    """Probability of a measured map for points of the parameter space.

    Measured depths scatter by the noise, each for itself, and by the emulator's error, whose
    covariance over the places is that of its cross-validation.
    """

    def __init__(self, emulator: Emulator, depth: FloatArray, noise: float) -> None:
        """Of depths, (places,) [m], with a standard deviation [m]."""
        covariance = emulator.apart.T @ emulator.apart / len(emulator.apart)
        covariance[np.diag_indices_from(covariance)] += noise**2
        root = np.linalg.cholesky(covariance)
        whitened = solve_triangular(root, emulator.axes.T, lower=True)
        offset = solve_triangular(root, emulator.mean - depth, lower=True)
        # Only what lies along the components depends on the parameters.
        basis, self._scale = np.linalg.qr(whitened)
        self._offset = basis.T @ offset
        self._emulator = emulator

    def log(self, points: FloatArray) -> FloatArray:
        """Its logarithm up to a constant, (n,)."""
        apart = self._offset + self._emulator.components(points) @ self._scale.T
        logs: FloatArray = -0.5 * (apart**2).sum(axis=1)
        return logs
