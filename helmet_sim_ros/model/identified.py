"""The coupling spring that follows its liner: identified from flat presses of the foam columns.

Per side, F = A (exp(B d) - 1) is laid through the (force, crush) peaks of drops at four speeds
(Hyncik & Bonkowski, section 2.2), at most as fast as the liner bears without bottoming out. The
foam's law knows no rate, so the peak of a drop is where the slow press has taken up its energy, and
no impact has to be simulated. The shell's own bending on the ground, which the spring helmet adds
again, is taken off the crush.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.columns import columns, liner_rows
from helmet_sim_ros.model.force.foam import bottoming_strain, rate_factor
from helmet_sim_ros.model.force.liner import press
from helmet_sim_ros.model.helmet import Helmet, Spring, SpringLaw

#: The part of the head that each law belongs to.
SIDES = {
    "front": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "side": (0.0, 1.0, 0.0),
    "top": (0.0, 0.0, 1.0),
}
FASTEST = 10.0  # m/s, of the paper's drop tests
SPEEDS = (0.25, 0.5, 0.75, 1.0)  # of the fastest drop
HEAD_MASS = 4.5  # kg, of the drops; the law hardly depends on it
STEPS = 80  # of a press
#: Bounds of a law's initial stiffness [N/m]: the most is that of a shell on the ground.
STIFFNESS = (1.0, 1e8)
#: Bounds of its exponent [1/m]: with the least, a crush of 40 mm is on a straight line to 0.2 %.
EXPONENT = (0.1, 499.0)


def exponential(d: FloatArray, stiffness: float, exponent: float) -> FloatArray:
    """F = A (exp(B d) - 1) by its initial stiffness A B [N/m] and B [1/m]."""
    return np.asarray(stiffness / exponent * np.expm1(exponent * d))


def exponential_through(
    compression: FloatArray, force: FloatArray
) -> tuple[float, float, FloatArray]:
    """The law F = A (exp(B d) - 1) with the least squares of the relative force error.

    Args:
        compression, force: of the peaks, shape (n,) [m], [N].

    Returns:
        Initial stiffness A B [N/m], exponent B [1/m], and the covariance of the two, (2, 2).

    Raises:
        SetupError: no such law has these peaks.
    """
    from scipy.optimize import curve_fit  # half a second of imports that few processes need

    # Fitted in initial stiffness A B and B, which are far less correlated than A and B.
    start = (float(force[0] / compression[0]), 10.0)
    if not np.all(compression > 0.0) or not STIFFNESS[0] <= start[0] <= STIFFNESS[1]:
        raise SetupError.of("compression", compression.tolist(), "no spring has these peaks")
    try:
        (stiffness, exponent), covariance = curve_fit(
            exponential, compression, force, p0=start, sigma=force,
            bounds=tuple(zip(STIFFNESS, EXPONENT, strict=True)),
        )  # fmt: skip
    except RuntimeError as error:  # no convergence
        raise SetupError.of("compression", compression.tolist(), str(error)) from None
    return float(stiffness), float(exponent), covariance


@lru_cache(maxsize=64)
def identified(helmet: Helmet) -> Spring:
    """The spring of a helmet's liner. Costs some milliseconds, once per helmet and process.

    Raises:
        SetupError: a side of the liner crushes less than the shell bends on the ground, or not as
            any spring does; the key is the side's.
    """
    laws: dict[str, SpringLaw] = {}
    losses = []
    for side, axis in SIDES.items():
        compression, force, loss = _peaks(helmet, side, np.array(axis))
        compression = compression - force / helmet.shell.contact_stiffness
        try:
            stiffness, exponent, _ = exponential_through(compression, force)
        except SetupError:
            raise SetupError.of(
                side, compression.tolist(),
                "at the peaks of its drops [m], the crush beyond the shell's own bending is that "
                "of no spring",
            ) from None  # fmt: skip
        laws[side] = SpringLaw(A=stiffness / exponent, B=exponent)
        losses.append(loss)
    # What pulls the shell off the liner no drop test shows: taken as the top.
    return Spring(
        front=laws["front"],
        back=laws["back"],
        side=laws["side"],
        top=laws["top"],
        strap=laws["top"],
        energy_loss=min(float(np.mean(losses)), 0.98),
        bears=helmet.spring.bears,
        identified=True,
    )


def _peaks(helmet: Helmet, side: str, axis: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Crush [m] and force [N] at the peaks of four drops, and the mean share of energy lost."""
    liner, table = helmet.liner, columns(helmet)
    foam = liner_rows(liner, np.array([liner.zone_density(side)]))[0]
    thickness = liner.zone_thickness(side)
    if helmet.geometry is not None:  # a measured liner is as thick as it is there
        thickness = float(table.thickness[np.argmax(table.point @ axis)])
    n = len(table.area)
    largest, rest = np.zeros(n), np.full(n, -1.0)
    depth = np.linspace(0.0, bottoming_strain(foam) * thickness, STEPS)
    force = np.array([press(table, axis, d, largest, rest) for d in depth])
    energy = _work(force, depth)
    mass = HEAD_MASS + helmet.mass
    most = min(energy[-1], 0.5 * mass * FASTEST**2)
    fastest = math.sqrt(2.0 * most / mass)
    quick = np.array([rate_factor(share * fastest / thickness, foam) for share in SPEEDS])
    needed = most * np.square(SPEEDS) / quick
    turns = np.minimum(np.searchsorted(energy, needed), STEPS - 1)
    return depth[turns], quick * force[turns], _loss(helmet, axis, depth[: turns[-1] + 1])


def _loss(helmet: Helmet, axis: FloatArray, depth: FloatArray) -> float:
    """Share of the energy of a press that is not given back [-]."""
    table = columns(helmet)
    n = len(table.area)
    largest, rest = np.zeros(n), np.full(n, -1.0)
    loaded = np.array([press(table, axis, d, largest, rest) for d in depth])
    # Unloading is over within a small share of the depth, so it has to be resolved there.
    back = depth[-1] * (1.0 - np.linspace(0.0, 1.0, STEPS) ** 2)
    unloaded = np.array([press(table, axis, d, largest, rest) for d in back])
    return float(1.0 + _work(unloaded, back)[-1] / _work(loaded, depth)[-1])


def _work(force: FloatArray, depth: FloatArray) -> FloatArray:
    """Work up to each depth [J], (n,): the trapezoidal rule."""
    steps = 0.5 * (force[1:] + force[:-1]) * np.diff(depth)
    return np.concatenate([[0.0], np.cumsum(steps)])
