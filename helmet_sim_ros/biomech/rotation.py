"""Brain-injury criteria of the rotation of the head. Head axes: x forward, y left, z up."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from helmet_sim_ros.biomech.hic import Hic, maximum_window
from helmet_sim_ros.biomech.pulse import FloatArray, finite_array, magnitude, positive, same_length
from helmet_sim_ros.biomech.recursion import recursion, weighted
from helmet_sim_ros.errors import PulseError

Peaks = tuple[float, float, float]

#: Critical angular velocities x, y, z [rad/s] of BrIC (Takhounts et al., "Development of brain
#: injury criteria (BrIC)", Stapp Car Crash Journal 57, 2013): from the maximum principal strain,
#: from the cumulative strain damage measure, and their average.
BRIC_CRITICAL: dict[str, tuple[float, float, float]] = {
    "average": (66.25, 56.45, 42.87),
    "mps": (66.30, 53.80, 41.50),
    "csdm": (66.20, 59.10, 44.25),
}

#: Critical angular velocities, peak to peak [rad/s], and accelerations [rad/s^2] x, y, z of UBrIC
#: for the maximum principal strain (Gabler, Crandall, Panzer, "Development of a metric for
#: predicting brain strain responses using head kinematics", Ann. Biomed. Eng. 46, 2018).
UBRIC_VELOCITY = (211.0, 171.0, 115.0)
UBRIC_ACCELERATION = (20000.0, 10300.0, 7760.0)

#: DAMAGE (Gabler, Crandall, Panzer, "Development of a second-order system for rapid estimation of
#: maximum brain strain", Ann. Biomed. Eng. 47, 2019): unit masses, stiffnesses [N/m], damping as
#: a share of the stiffness [s], and the scale from displacement to strain [1/m].
DAMAGE_STIFFNESS = (32142.0, 23493.0, 16935.0)
DAMAGE_STIFFNESS_XZ = 1636.3
DAMAGE_DAMPING = 5.9148e-3
DAMAGE_SCALE = 2.9903

#: Head axes of this package against those of SAE J211 (x forward, y right, z down), in which the
#: coupling of DAMAGE between x and z is given.
SAE_SIGN = np.array([1.0, -1.0, -1.0])

#: Longest window of RIC [s] (Kimpara and Iwamoto, "Mild traumatic brain injury predictors based
#: on angular accelerations during impacts", Ann. Biomed. Eng. 40, 2012).
RIC_WINDOW = 0.036


def to_head_axes(vectors: ArrayLike, orientation: ArrayLike, name: str = "vectors") -> FloatArray:
    """World vectors in the axes of the head.

    Args:
        vectors: world axes, shape (n, 3).
        orientation: head to world, unit quaternions x, y, z, w, shape (n, 4).
        name: what to call the vectors in an error.

    Raises:
        PulseError: wrong shapes, not finite, or not unit quaternions.
    """
    v = finite_array(name, vectors, 3)
    q = finite_array("head_orientation", orientation, 4)
    if len(v) != len(q):
        raise PulseError(f"head_orientation: {len(q)} samples, but {name} has {len(v)}")
    refuse_no_rotation(q)
    return turned_back(v, q)


def refuse_no_rotation(q: FloatArray) -> None:
    """Refuse finite quaternions x, y, z, w, shape (n, 4), unless each is a unit quaternion.

    Raises:
        PulseError: one is not, by more than 1e-3 of its squared length.
    """
    error = np.abs((q * q).sum(axis=1) - 1.0)
    worst = int(error.argmax())
    if error[worst] > 1e-3:
        raise PulseError(f"head_orientation: not a unit quaternion at sample {worst}: {q[worst]}")


def turned_back(v: FloatArray, q: FloatArray) -> FloatArray:
    """:func:`to_head_axes` of checked vectors, (n, 3), and unit quaternions, (n, 4)."""
    x, y, z, w = q.T
    a, b, c = v.T
    # v' = v + 2 w (v x u) + 2 (v x u) x u, the inverse rotation, with u = (x, y, z)
    p, r, s = b * z - c * y, c * x - a * z, a * y - b * x
    head = np.empty_like(v)
    head[:, 0] = a + 2.0 * (w * p + r * z - s * y)
    head[:, 1] = b + 2.0 * (w * r + s * x - p * z)
    head[:, 2] = c + 2.0 * (w * s + p * y - r * x)
    return head


def matrices(orientation: FloatArray) -> FloatArray:
    """Rotation matrices, shape (n, 3, 3), of unit quaternions x, y, z, w, shape (n, 4)."""
    x, y, z, w = orientation.T
    m = np.empty((3, 3, len(orientation)))
    m[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    m[0, 1] = 2.0 * (x * y - z * w)
    m[0, 2] = 2.0 * (x * z + y * w)
    m[1, 0] = 2.0 * (x * y + z * w)
    m[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    m[1, 2] = 2.0 * (y * z - x * w)
    m[2, 0] = 2.0 * (x * z - y * w)
    m[2, 1] = 2.0 * (y * z + x * w)
    m[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return m.transpose(2, 0, 1)


def rotation_vectors(orientation: FloatArray) -> FloatArray:
    """Rotation vectors, at most pi long, shape (n, 3) [rad], of unit quaternions x, y, z, w,
    shape (n, 4)."""
    q = np.where(orientation[:, 3:] < 0.0, -orientation, orientation)
    sine = np.sqrt((q[:, :3] ** 2).sum(axis=1))
    small = sine < 1e-12
    angle = 2.0 * np.arctan2(sine, q[:, 3])
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, sine))
    return factor[:, None] * q[:, :3]


def quaternions(vectors: FloatArray) -> FloatArray:
    """Unit quaternions x, y, z, w, shape (n, 4), of rotation vectors, shape (n, 3) [rad]."""
    angle = np.sqrt((vectors**2).sum(axis=1))
    half = 0.5 * np.sinc(0.5 * angle / np.pi)  # sin(angle / 2) / angle
    return np.column_stack([half[:, None] * vectors, np.cos(0.5 * angle)])


def bric(
    angular_velocity: ArrayLike, critical: Literal["average", "mps", "csdm"] = "average"
) -> float:
    """Brain Injury Criterion: the 2-norm of max |w_i| / w_ic.

    Args:
        angular_velocity: head axes, shape (n, 3) [rad/s].
        critical: which set of critical values.

    Raises:
        PulseError: bad signal, or an unknown set.
    """
    if not isinstance(critical, str) or critical not in BRIC_CRITICAL:
        raise PulseError(f"critical = {critical!r}: must be one of {', '.join(BRIC_CRITICAL)}")
    return bric_of(axis_peaks(finite_array("angular_velocity", angular_velocity, 3)), critical)


def axis_peaks(signal: FloatArray) -> Peaks:
    """The largest amount on each axis of a checked signal, (n, 3)."""
    x, y, z = np.abs(signal).max(axis=0).tolist()
    return x, y, z


def bric_of(peaks: Peaks, critical: str) -> float:
    """:func:`bric` of the peaks of the axes for a known set of critical values."""
    x, y, z = (peak / limit for peak, limit in zip(peaks, BRIC_CRITICAL[critical], strict=True))
    return math.sqrt(x * x + y * y + z * z)


def ubric(angular_velocity: ArrayLike, angular_acceleration: ArrayLike) -> float:
    """Universal Brain Injury Criterion, for the maximum principal strain.

    Per axis w + (a - w) exp(-a / w), with w = peak-to-peak velocity and a = peak acceleration,
    each over its critical value; then the 2-norm over the axes.

    Args:
        angular_velocity: head axes, shape (n, 3) [rad/s].
        angular_acceleration: head axes, shape (n, 3) [rad/s^2].

    Raises:
        PulseError: bad signal.
    """
    omega = finite_array("angular_velocity", angular_velocity, 3)
    alpha = finite_array("angular_acceleration", angular_acceleration, 3)
    same_length(angular_velocity=omega, angular_acceleration=alpha)
    return ubric_of(omega, alpha)


def ubric_of(omega: FloatArray, alpha: FloatArray) -> float:
    """:func:`ubric` of checked signals, each (n, 3)."""
    w = (omega.max(axis=0) - omega.min(axis=0)) / UBRIC_VELOCITY
    a = np.divide(axis_peaks(alpha), UBRIC_ACCELERATION)
    turning = w > 0.0  # the limit for w -> 0 is 0
    w, a = w[turning], a[turning]
    scaled = w + (a - w) * np.exp(-a / w)
    return math.sqrt(float(scaled @ scaled))


def damage(angular_acceleration: ArrayLike, time_step: float) -> float:
    """DAMAGE: the largest displacement of three coupled oscillators, scaled to brain strain.

    M x'' + C x' + K x = M alpha, at rest at the first sample; exact for an acceleration that is
    linear between samples (first-order hold in modal coordinates, C being proportional to K).

    Args:
        angular_acceleration: head axes, shape (n, 3) [rad/s^2].
        time_step: sampling interval [s].

    Raises:
        PulseError: bad signal or time step.
    """
    alpha = finite_array("angular_acceleration", angular_acceleration, 3)
    return brain_strain(alpha, positive("time_step", time_step))


def brain_strain(alpha: FloatArray, time_step: float) -> float:
    """:func:`damage` of a checked acceleration, (n, 3)."""
    modes, feedback, weights, start = _damage_filters(time_step)
    drive = modes.T @ alpha.T
    driven = weighted(weights, drive)
    driven[:, :2] += start[:, : len(alpha)] * drive[:, :1]
    answer = np.stack([recursion(*each) for each in zip(feedback, driven, strict=True)])
    # The modes are orthonormal, so the length of x is the length of the modal displacement.
    return DAMAGE_SCALE * float(magnitude(answer.T).max())


def ric(angular_acceleration: ArrayLike, time_step: float) -> Hic:
    """Rotational Injury Criterion: HIC's formula on the angular acceleration [rad/s^2], 36 ms.

    Args:
        angular_acceleration: any axes, shape (n, 3), or its amount, shape (n,) [rad/s^2].
        time_step: sampling interval [s].

    Raises:
        PulseError: bad signal or time step.
    """
    alpha = magnitude(finite_array("angular_acceleration", angular_acceleration, 0, 3))
    return maximum_window(alpha, positive("time_step", time_step), RIC_WINDOW)


def klc(peak_angular_velocity: float, hic36: float) -> float:
    """Kleiven's linear combination, 0.004718 max |w| + 0.000224 HIC36.

    S. Kleiven, "Predictors for traumatic brain injuries evaluated through accident
    reconstructions", Stapp Car Crash Journal 51, 2007 (general literature value).

    Args:
        peak_angular_velocity: peak of the resultant [rad/s].
        hic36: HIC with a 36 ms window.
    """
    return 0.004718 * peak_angular_velocity + 0.000224 * hic36


def damage_stiffness() -> FloatArray:
    """The stiffness matrix of DAMAGE in SAE J211 axes, shape (3, 3) [N/m]."""
    kx, ky, kz = DAMAGE_STIFFNESS
    k = DAMAGE_STIFFNESS_XZ
    return np.array([[kx + k, 0.0, -k], [0.0, ky, 0.0], [-k, 0.0, kz + k]])


class _Oscillators(NamedTuple):
    """DAMAGE as recursions of the displacements of its three modes, one row each, (3, 3).

    Attributes:
        modes: their shapes in head axes, one column each.
        feedback, weights: of the recursion and of its drive.
        start: what the first two samples lack for a first drive of 1, (3, 2).
    """

    modes: FloatArray
    feedback: FloatArray
    weights: FloatArray
    start: FloatArray


@lru_cache(maxsize=32)
def _damage_filters(time_step: float) -> _Oscillators:
    """With state s = (x, x') and drive u, s1 = Phi s0 + G0 u0 + G1 u1 exactly for a linear u. Its
    first component obeys x2 = tr Phi x1 - det Phi x0 + b0 u2 + b1 u1 + b2 u0. What must be
    added at the first two samples for x0 = 0 and x1 = G0 u0 + G1 u1 comes for u0 = 1.
    """
    stiffness, modes = np.linalg.eigh(damage_stiffness())
    feedback, weights, start = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 2))
    for i, k in enumerate(stiffness):
        # exponential of the state, the drive and its slope together
        system = np.zeros((4, 4))
        system[0, 1] = system[1, 2] = system[2, 3] = 1.0
        system[1, :2] = -k, -DAMAGE_DAMPING * k
        step = expm(system * time_step)
        phi, level, slope = step[:2, :2], step[:2, 2], step[:2, 3] / time_step
        g0, g1 = level - slope, slope
        rest = np.array([[-phi[1, 1], phi[0, 1]], [phi[1, 0], -phi[0, 0]]])  # -adjugate
        weights[i] = g1[0], g0[0] + rest[0] @ g1, rest[0] @ g0
        feedback[i] = 1.0, -np.trace(phi), np.linalg.det(phi)
        start[i] = -weights[i, 0], g0[0] - weights[i, 1]
    return _Oscillators(SAE_SIGN[:, None] * modes, feedback, weights, start)
