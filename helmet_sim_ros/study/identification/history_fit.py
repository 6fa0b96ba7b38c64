"""From measured acceleration histories to parameters of a helmet, and what they leave open.

Every listed parameter is varied by its logarithm; the sum over all samples of all drops of the
squared difference between simulated and measured resultant acceleration is made least. Each drop
has a time shift of its own, since no laboratory triggers at the first touch. What the data cannot
tell shows in the singular values of the sensitivity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.schema import leaf_values
from helmet_sim_ros.study.identification.histories import MeasuredDrop

#: What is fitted where the user names nothing: of a foam helmet what a drop can show, of a spring
#: helmet the laws of the sides that were struck.
FOAM = ("liner.density", "liner.energy_returned")
CONFIDENCE = 0.95
#: Two parameters by whose exchange the histories change less than this share of what the best
#: determined one changes them are not told apart.
RANK = 0.01
WIDE = 0.5  # relative half-width of an interval from which on a parameter counts as open
STEP = 0.02  # relative, of the sensitivity: well above the loop's own chatter
SHIFTS = np.linspace(-2e-3, 2e-3, 81)  # s, about where the two curves reach half of their peaks
FINE = 2e-4  # s, to either side of the best of them


@dataclass(frozen=True)
class FittedParameter:
    """A fitted value with its 95 % confidence interval; ``open``: what the data do not tell."""

    name: str
    value: float
    low: float
    high: float
    open: bool


@dataclass(frozen=True)
class HistoryFit:
    """What measured histories tell of a helmet.

    Attributes:
        parameters: one each.
        helmet: with the fitted values.
        drops: the tests.
        simulated: resultant acceleration of each at its own times, shifted, (n,) [g].
        error: root mean square of the difference over the peak, per drop [-].
        rank: number of combinations of parameters that the histories determine.
        correlation: of the parameters, (p, p).
        notes: in words.
    """

    parameters: tuple[FittedParameter, ...]
    helmet: Helmet
    drops: tuple[MeasuredDrop, ...]
    simulated: tuple[FloatArray, ...]
    error: tuple[float, ...]
    rank: int
    correlation: FloatArray
    notes: tuple[str, ...]


def fit_histories(
    drops: Sequence[MeasuredDrop],
    helmet: str,
    parameters: Sequence[str] = (),
    coupling: str = "foam",
    head_mass: float | None = None,
) -> HistoryFit:
    """Fit parameters of a helmet to all drops at once.

    Args:
        drops: measured.
        helmet: name or path of the helmet to start from.
        parameters: dotted names below ``helmet.``; unset: see ``FOAM``, or the spring's laws.
        coupling: the form that is fitted, foam or spring.
        head_mass: of the headform [kg]; unset: the rider's head.

    Raises:
        SetupError: an unknown parameter, or one that is no number above 0.
    """
    first = _setup(drops[0], helmet, coupling, head_mass, {})
    values = leaf_values(first.helmet_config)
    names = tuple(parameters) or _usual(drops, coupling)
    for name in names:
        value = values.get(name)
        if not isinstance(value, float) or not value > 0.0:
            raise SetupError.of(
                f"helmet.{name}", value, "must be a number above 0 in the helmet to be fitted"
            )
    start = np.log([values[name] for name in names])

    def histories(logs: FloatArray) -> list[FloatArray]:
        changes = dict(zip(names, np.exp(logs).tolist(), strict=True))
        return [_simulated(drop, helmet, coupling, head_mass, changes) for drop in drops]

    def apart(logs: FloatArray) -> FloatArray:
        try:
            simulated = histories(logs)
        except SetupError:  # outside a range: as bad as no helmet at all
            simulated = [np.zeros_like(drop.acceleration) for drop in drops]
        return np.concatenate(_differences(simulated, drops))

    result = least_squares(apart, start, diff_step=STEP, x_scale=0.1, max_nfev=30, xtol=1e-4,
                           ftol=1e-5)  # fmt: skip
    best = result.x
    simulated = histories(best)
    differences = _differences(simulated, drops)
    jacobian = _sensitivity(apart, best)
    fitted, rank, correlation, notes = _judged(names, best, jacobian, differences)
    chosen = dict(zip(names, np.exp(best).tolist(), strict=True))
    config: Helmet = first.helmet_config.replaced(chosen)
    error = tuple(float(np.sqrt(np.mean(part**2))) for part in differences)
    return HistoryFit(
        fitted, config, tuple(drops), tuple(simulated), error, rank, correlation, notes
    )


def _differences(
    simulated: Sequence[FloatArray], drops: Sequence[MeasuredDrop]
) -> list[FloatArray]:
    """Of each drop, at its samples, in shares of the measured peak [-]."""
    return [
        (here - drop.acceleration) / float(drop.acceleration.max())
        for here, drop in zip(simulated, drops, strict=True)
    ]


def _usual(drops: Sequence[MeasuredDrop], coupling: str) -> tuple[str, ...]:
    if coupling == "foam":
        return FOAM
    sides = {"left": "side", "right": "side"}
    struck = sorted({sides.get(drop.direction, drop.direction) for drop in drops})
    return (*(f"spring.{side}.{law}" for side in struck for law in "AB"), "spring.energy_loss")


def _setup(
    drop: MeasuredDrop, helmet: str, coupling: str, head_mass: float | None,
    changes: dict[str, float],
) -> ImpactSetup:  # fmt: skip
    overrides: dict[str, object] = {f"helmet.{name}": value for name, value in changes.items()}
    overrides["helmet.coupling"] = coupling
    if head_mass is not None:
        overrides["rider.head_mass"] = head_mass
    return ImpactSetup(
        rig="headform", helmet=helmet, direction=drop.direction, normal_velocity=drop.speed,
        duration=0.03, overrides=overrides,
    )  # fmt: skip


def _simulated(
    drop: MeasuredDrop, helmet: str, coupling: str, head_mass: float | None,
    changes: dict[str, float],
) -> FloatArray:  # fmt: skip
    record = simulate(_setup(drop, helmet, coupling, head_mass, changes))
    amount = np.linalg.norm(record.head_acceleration, axis=1) / STANDARD_GRAVITY
    return shifted(record.time, amount, drop)


def shifted(time: FloatArray, amount: FloatArray, drop: MeasuredDrop) -> FloatArray:
    """A simulated history at a drop's times, moved in time to where it fits best, (n,) [g]."""
    rise = _first_half(drop.time, drop.acceleration) - _first_half(time, amount)

    def at(shift: float) -> FloatArray:
        moved: FloatArray = np.interp(drop.time - rise - shift, time, amount, left=0.0, right=0.0)
        return moved

    def misfit(shift: float) -> float:
        return float(((at(shift) - drop.acceleration) ** 2).sum())

    best = min(SHIFTS, key=misfit)
    around = np.linspace(best - FINE, best + FINE, 41)
    scores = np.array([misfit(shift) for shift in around])
    i = int(np.clip(scores.argmin(), 1, len(around) - 2))
    # The bottom of the parabola through the three lowest: smooth in the parameters.
    left, middle, right = scores[i - 1 : i + 2]
    bend = left - 2.0 * middle + right
    offset = 0.5 * (left - right) / bend if bend > 0.0 else 0.0
    return at(float(around[i] + np.clip(offset, -1.0, 1.0) * (around[1] - around[0])))


def _first_half(time: FloatArray, amount: FloatArray) -> float:
    return float(time[int(np.argmax(amount >= 0.5 * amount.max()))])


def _sensitivity(apart: Callable[[FloatArray], FloatArray], best: FloatArray) -> FloatArray:
    """Central differences of the residuals by the logarithms, (samples, p)."""
    columns = []
    for i in range(len(best)):
        step = np.zeros(len(best))
        step[i] = STEP
        columns.append((apart(best + step) - apart(best - step)) / (2.0 * STEP))
    return np.column_stack(columns)


def _judged(
    names: tuple[str, ...], best: FloatArray, jacobian: FloatArray, differences: list[FloatArray]
) -> tuple[tuple[FittedParameter, ...], int, FloatArray, tuple[str, ...]]:
    """Intervals, rank, correlation, and in words what stays open.

    Neighbouring residuals are alike, so a sample of n counts as n (1 - r) / (1 + r), with r their
    correlation at one step (as of an autoregressive process).
    """
    residual = np.concatenate(differences)
    alike = np.mean([_alike(part) for part in differences])
    independent = len(residual) * (1.0 - alike) / (1.0 + alike)
    freedom = max(independent - len(names), 1.0)
    variance = float((residual**2).sum()) / (len(residual) - len(names))
    _, weight, axes = np.linalg.svd(jacobian, full_matrices=False)
    known = weight > RANK * max(float(weight[0]), 1e-12)
    rank = int(known.sum())
    inverse = axes.T @ np.diag(1.0 / np.maximum(weight, 1e-12) ** 2) @ axes
    covariance = variance * len(residual) / independent * inverse
    deviation = np.sqrt(np.diag(covariance))
    reach = float(student.ppf(0.5 + 0.5 * CONFIDENCE, freedom)) * deviation
    # A parameter with a part in an undetermined combination is open.
    loose = (axes[~known] ** 2).sum(axis=0) > 0.05 if rank < len(names) else np.zeros(len(names))
    parameters = []
    for i, name in enumerate(names):
        width = min(float(reach[i]), 50.0)
        value = float(np.exp(best[i]))
        open_ = bool(loose[i]) or width > WIDE
        parameters.append(
            FittedParameter(
                name, value, value * float(np.exp(-width)), value * float(np.exp(width)), open_
            )
        )
    notes = []
    for row in axes[~known]:
        part = " and ".join(names[i] for i in np.argsort(-np.abs(row)) if abs(row[i]) > 0.3)
        notes.append(f"the histories do not tell {part} (sensitivity below {100 * RANK:g} %)")
    notes += [
        f"{p.name} is open: its interval is wider than +-{100 * WIDE:g} %"
        for p, told in zip(parameters, loose, strict=True) if p.open and not told
    ]  # fmt: skip
    spread = np.outer(deviation, deviation)
    return tuple(parameters), rank, covariance / np.where(spread > 0, spread, 1.0), tuple(notes)


def _alike(part: FloatArray) -> float:
    spread = float((part**2).sum())
    r = float((part[1:] * part[:-1]).sum()) / spread if spread > 0.0 else 0.0
    return min(max(r, 0.0), 0.999)
