"""The crashes that could have left a crush map, with their probabilities."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.extra import need
from helmet_sim_ros.model.force.columns import Columns, columns
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.study.reconstruction.crash import (
    DURATION,
    NAMES,
    Scene,
    residual_crush,
    scene,
    site,
)
from helmet_sim_ros.study.reconstruction.crush_map import CrushMap, interpolation
from helmet_sim_ros.study.reconstruction.emulator import Emulator, Likelihood

SPEEDS = 12  # straight blows at rising speed, for a first guess
#: Directions of sliding from which least squares go down, beside a straight blow, and the share of
#: the highest speed along. A long crush looks much alike from both ends.
DIRECTIONS, SLIDING = 6, 0.6
#: rad per m/s along: how far the first touch lies upstream of the middle of its crush (rounded,
#: from simulated crashes).
UPSTREAM = 0.045
EVALUATIONS = 8  # of each descent, each with five simulations for its slope
STEP = 0.01  # of the parameters' spans, for slopes
ROUND = 128  # simulated crashes of a round: about the most likely ones, then where samples were
ROUNDS = 8  # at most, until the sample has settled
BEYOND = 0.7  # standard deviations by which a round goes beyond the last sample
MOVED = 0.2  # standard deviations, by which a settled sample still moves
#: Difference of half the squared misfits up to which two crashes are followed both.
ALIKE = 20.0
WALKERS = 64
ROUGH = (100, 100)  # steps of the sampler in a round: until it forgets its start, and kept
STEPS = 500  # that are kept in the end
INTERVAL = 0.90
UNKNOWN = 0.8  # share of the prior's width from which on the crush does not tell a quantity
UNITS = {
    "normal_velocity": "m/s", "tangential_velocity": "m/s", "speed": "m/s", "angle": "deg",
    "azimuth": "deg", "elevation": "deg",
}  # fmt: skip


@dataclass(frozen=True)
class Reconstruction:
    """What a crush map tells of its crash.

    Attributes:
        scene: what was given.
        parameters: a sample of the posterior, (n, 5); see :data:`.crash.NAMES`.
        quantities: the same as ``UNITS`` names them, (n,) each; ``angle`` is that of the speed to
            the surface, 90 straight into it.
        told: share of the prior's interval that the posterior's takes, by name.
        misfit: root mean square of measured less most likely depth, over the noise [-]; about 1
            where the model explains the map.
        emulator_error: of the stand-in for the simulation, root mean square [m].
        simulations: how many were run.
        acceptance: of the sampler; ``steps_per_sample``: its autocorrelation time.
        notes: in words.
    """

    scene: Scene
    parameters: FloatArray
    quantities: Mapping[str, FloatArray]
    told: Mapping[str, float]
    misfit: float
    emulator_error: float
    simulations: int
    acceptance: float
    steps_per_sample: float
    notes: tuple[str, ...]

    def interval(self, name: str, share: float = INTERVAL) -> tuple[float, float, float]:
        """Lower end, median and upper end of the interval that holds a share of the sample."""
        values = self.quantities[name]
        low, middle, high = np.quantile(values, [0.5 - 0.5 * share, 0.5, 0.5 + 0.5 * share])
        return float(low), float(middle), float(high)


def reconstruct(
    crush: CrushMap,
    setup: ImpactSetup,
    noise: float = 0.5e-3,
    fastest: float = 10.0,
    along: float = 8.0,
    seed: int = 0,
) -> Reconstruction:
    """Sample the crashes that explain a crush map.

    The prior is uniform: up to ``fastest`` into the surface, up to ``along`` along it to every
    side, within 20 degrees about the middle of the crush. Measured depths scatter normally about
    the simulated ones by ``noise`` and by the stand-in's own error. The sampler is emcee's ensemble
    (Foreman-Mackey et al. 2013, doi 10.1086/670067).

    Args:
        crush: measured.
        setup: helmet (foam), headform and surface; speeds and site are found.
        noise: standard deviation of a measured depth [m].
        fastest, along: bounds of the speeds [m/s].
        seed: of every random number.

    Raises:
        SetupError: a helmet without foam.
        MissingExtraError: emcee is not installed.
        StudyError: most simulations diverged.
    """
    emcee = need("emcee", "cad")
    setup = setup.replaced({"rig": "headform", "duration": DURATION})
    if setup.helmet_config.coupling != "foam":
        raise SetupError.of("helmet.coupling", "spring", "must be foam: a spring keeps no crush")
    cells = columns(setup.helmet_config)
    whole = scene(setup, _middle(crush, cells), fastest, along)
    index, weight = interpolation(cells, crush.place)
    simulated = 0

    def at_places(points: FloatArray) -> FloatArray:
        nonlocal simulated
        simulated += len(points)
        result: FloatArray = (residual_crush(whole, points)[:, index] * weight).sum(axis=2)
        return result

    random = np.random.default_rng(seed)
    points = _about(most_likely(whole, crush.depth, noise, at_places), random)
    known, values = np.zeros((0, len(NAMES))), np.zeros((0, len(crush.depth)))
    before: FloatArray | None = None
    for n in range(1, ROUNDS + 1):
        # Each round simulates where the last one's sample was, and beyond its edge.
        points = np.clip(points, whole.low, whole.high)
        points, crushed = _kept(points, at_places(points))
        known, values = np.vstack([known, points]), np.vstack([values, crushed])
        emulator = Emulator(known, values)
        likelihood = Likelihood(emulator, crush.depth, noise)
        sampler = emcee.EnsembleSampler(
            WALKERS, len(NAMES), _log_posterior, vectorize=True,
            args=(likelihood, emulator, whole),
        )  # fmt: skip
        sampler.random_state = np.random.RandomState(seed + n).get_state()
        state = known[np.argsort(-likelihood.log(known))[:WALKERS]]
        for steps in ROUGH:
            sampler.reset()
            state = sampler.run_mcmc(state, steps, skip_initial_state_check=True)
        sample = sampler.get_chain(flat=True)
        settled = before is not None and _settled(before, sample)
        if settled:
            break
        before = sample
        some = sample[random.choice(len(sample), ROUND, replace=False)]
        root = np.linalg.cholesky(np.cov(sample.T))
        points = some + BEYOND * random.standard_normal((ROUND, len(NAMES))) @ root.T
    sampler.reset()
    sampler.run_mcmc(state, STEPS, skip_initial_state_check=True)
    sample = sampler.get_chain(flat=True)
    start = sample[int(np.argmax(sampler.get_log_prob(flat=True)))]
    tau = float(np.mean(sampler.get_autocorr_time(quiet=True, tol=0)))
    misfit = float(np.sqrt(np.mean((emulator(start[None])[0] - crush.depth) ** 2))) / noise
    result = _told(
        whole, sample, misfit, emulator, simulated, float(sampler.acceptance_fraction.mean()), tau
    )
    if settled:
        return result
    late = f"the sample still moved after {ROUNDS} rounds; its intervals may be too narrow"
    return replace(result, notes=(*result.notes, late))


def _told(
    whole: Scene, sample: FloatArray, misfit: float, emulator: Emulator, simulated: int,
    acceptance: float, tau: float,
) -> Reconstruction:  # fmt: skip
    quantities = quantities_of(whole, sample)
    flat = np.random.default_rng(0).uniform(whole.low, whole.high, (20_000, len(NAMES)))
    prior = quantities_of(whole, flat)
    ends = [0.5 - 0.5 * INTERVAL, 0.5 + 0.5 * INTERVAL]
    told = {
        name: float(np.ptp(np.quantile(values, ends)) / np.ptp(np.quantile(prior[name], ends)))
        for name, values in quantities.items()
    }
    notes = [
        f"the crush does not tell {name}: its interval is {100 * told[name]:.0f} % of what was "
        "thought possible before"
        for name in told if told[name] > UNKNOWN
    ]  # fmt: skip
    if misfit > 2.0:
        notes.append(
            f"the most likely crash misses the map by {misfit:.1f} times the noise: helmet, foam "
            "or surface are not the map's, or the noise is larger"
        )
    error = float(np.sqrt((emulator.apart**2).mean()))
    return Reconstruction(
        whole, sample, quantities, told, misfit, error, simulated, acceptance, tau, tuple(notes)
    )


def quantities_of(scene: Scene, parameters: FloatArray) -> dict[str, FloatArray]:
    """The quantities of ``UNITS`` of points of the parameter space, (n, 5); (n,) each."""
    normal, x, y, u, v = parameters.T
    tangential = np.hypot(x, y)
    azimuth, elevation = site(scene, u, v)
    middle = np.degrees(np.arctan2(scene.place[1], scene.place[0]))
    azimuth = middle + (azimuth - middle + 180.0) % 360.0 - 180.0  # no jump behind the head
    return {
        "normal_velocity": normal,
        "tangential_velocity": tangential,
        "speed": np.hypot(normal, tangential),
        "angle": np.degrees(np.arctan2(normal, tangential)),
        "azimuth": azimuth,
        "elevation": elevation,
    }


def _middle(crush: CrushMap, cells: Columns) -> FloatArray:
    """Where the crush points at: the mean place, weighted by the depths' squares, (3,)."""
    weight = np.maximum(crush.depth, 0.0) ** 2
    place: FloatArray = (weight[:, None] * crush.place).sum(axis=0) / weight.sum()
    return place / np.linalg.norm(place)


def most_likely(
    whole: Scene, depth: FloatArray, noise: float,
    at_places: Callable[[FloatArray], FloatArray],
) -> list[tuple[FloatArray, FloatArray]]:  # fmt: skip
    """The crashes whose crush is nearest, (5,) each, with their covariance, (5, 5).

    Straight blows give a first speed; from there, and from blows that slide in every direction,
    least squares go down; the best end is taken, and what is nearly as good. The covariance is that
    of a linear model and the prior's together.
    """
    span = whole.high - whole.low
    speeds = np.linspace(1.0, whole.high[0], SPEEDS)
    straight = np.column_stack([speeds, np.zeros((SPEEDS, 4))])
    apart = ((at_places(straight) - depth) ** 2).sum(axis=1)
    speed = float(speeds[int(np.nan_to_num(apart, nan=np.inf).argmin())])

    def residuals(points: FloatArray) -> FloatArray:
        return np.nan_to_num((at_places(points) - depth) / noise, nan=1e3)

    def jacobian(scaled: FloatArray) -> FloatArray:
        step = np.where(scaled < 0.5, STEP, -STEP)  # inwards
        values = residuals(whole.low + np.vstack([scaled, scaled + np.diag(step)]) * span)
        return np.asarray(((values[1:] - values[0]) / step[:, None]).T)

    def descent(start: FloatArray) -> OptimizeResult:
        return least_squares(
            lambda scaled: residuals((whole.low + scaled * span)[None])[0],
            np.clip(start, 0.01, 0.99), jac=jacobian, bounds=(0.0, 1.0),
            max_nfev=EVALUATIONS, x_scale=0.1,
        )  # fmt: skip

    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    x, y = SLIDING * whole.high[1:3, None] * [np.cos(angles), np.sin(angles)]
    sliding = np.column_stack([np.full(DIRECTIONS, speed), x, y, -UPSTREAM * y, -UPSTREAM * x])
    straight_on = [speed, 0.0, 0.0, 0.0, 0.0]
    ends = [descent((start - whole.low) / span) for start in np.vstack([straight_on, sliding])]
    best = min(float(end.cost) for end in ends)
    prior = 12.0 * np.eye(len(NAMES))  # a uniform one has the variance of its span over 12
    found = []
    for end in ends:
        if float(end.cost) < best + ALIKE:
            local = jacobian(end.x)
            covariance = np.linalg.inv(local.T @ local + prior) * np.outer(span, span)
            found.append((whole.low + end.x * span, covariance))
    return found


def _about(
    ends: Sequence[tuple[FloatArray, FloatArray]], random: np.random.Generator
) -> FloatArray:
    """Crashes about the most likely ones, twice as wide as a normal posterior, (n, 5)."""
    share = ROUND // len(ends) + 1
    return np.vstack(
        [
            middle + 2.0 * random.standard_normal((share, len(NAMES))) @ np.linalg.cholesky(c).T
            for middle, c in ends
        ]
    )


def _settled(before: FloatArray, sample: FloatArray) -> bool:
    """Whether a sample has moved and spread by less than ``MOVED`` standard deviations."""
    spread = before.std(axis=0)
    moved = np.abs(sample.mean(axis=0) - before.mean(axis=0)) / spread
    widened = np.abs(sample.std(axis=0) / spread - 1.0)
    return bool(moved.max() < MOVED and widened.max() < MOVED)


def _kept(points: FloatArray, crush: FloatArray) -> tuple[FloatArray, FloatArray]:
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(crush).all(axis=1))
    if finite.mean() < 0.8:
        raise StudyError(f"{int((~finite).sum())} of {len(finite)} simulations diverged")
    return points[finite], crush[finite]


def _log_posterior(
    points: FloatArray, likelihood: Likelihood, emulator: Emulator, scene: Scene
) -> FloatArray:
    inside = ((points >= scene.low) & (points <= scene.high)).all(axis=1)
    inside &= emulator.knows(points)
    logs = np.full(len(points), -np.inf)
    if inside.any():
        logs[inside] = likelihood.log(points[inside])
    return logs


def write_sample(result: Reconstruction, path: Path) -> None:
    """The sample's quantities as CSV, a crash per row.

    Raises:
        SetupError: cannot be written.
    """
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([f"{name} [{unit}]" for name, unit in UNITS.items()])
            rows = np.column_stack([result.quantities[name] for name in UNITS])
            writer.writerows([[f"{value:.6g}" for value in row] for row in rows])
    except OSError as error:
        raise SetupError.of("samples", str(path), f"cannot be written: {error.strerror}") from error
