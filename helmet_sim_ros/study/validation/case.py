"""One case of the validation: simulated, measured, and held against what was published."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.histories import Chatter, Rating, channel_rating, chatter
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.scenario.reference import Published

RATED_FOR = 0.03  # s, interval over which histories are rated
EARLY = 5e-4  # s, how long a first-touch spike of the shell may last
#: Columns of the paper's Table 1.
PUBLISHED = ("MB", "FE", "THUMS")


@dataclass(frozen=True)
class CaseResult:
    """One simulated impact and what is said of it.

    Attributes:
        name: of the case.
        setup: its setup.
        peak_g: [g]; ``peak_time`` [s].
        force_ratio: peak tangential over peak normal ground force [-].
        peak_force: normal ground force [N].
        hic: unlimited window [-].
        peak_angular_acceleration: of the head [rad/s^2].
        early_spike: largest normal force of the first 0.5 ms over the peak [-].
        grounded: whether the helmet is on the ground at the acceleration peak.
        effective_mass: ground force over head acceleration at its peak [kg].
        added_mass: the same with the neck's share of the force taken off, less head and
            helmet [kg]: what the neck load leaves unexplained.
        neck_force: neck load along the ground's normal at that time [N].
        momentum_error: largest error of the impulse balance [-].
        energy_lost: share of the mechanical energy lost by the end [-].
        energy_growth: largest rise of mechanical energy over the initial [-]; spring only.
        wall: seconds of one core for stepping.
        published: values of the reference table, or None.
        record: the samples.
    """

    name: str
    setup: ImpactSetup
    peak_g: float
    peak_time: float
    force_ratio: float
    peak_force: float
    hic: float
    peak_angular_acceleration: float
    early_spike: float
    grounded: bool
    effective_mass: float
    added_mass: float
    neck_force: float
    momentum_error: float
    energy_lost: float
    energy_growth: float
    wall: float
    published: Published | None
    record: ImpactRecord


@dataclass(frozen=True)
class Varied:
    """What sensitivity asks of a case; see :class:`CaseResult`."""

    name: str
    peak_g: float
    force_ratio: float
    published: Published | None


def run_varied(name: str, setup: ImpactSetup, published: Published | None = None) -> Varied:
    """Simulate one case for its peaks alone: a balance takes twice as long."""
    result = evaluate(simulate(setup), criteria=("peak_g", "force_ratio"))
    return Varied(name, float(result.peak_g), float(result.force_ratio), published)


def run_case(name: str, setup: ImpactSetup, published: Published | None = None) -> CaseResult:
    """Simulate and measure one case."""
    impact = Impact(setup)
    began = time.process_time()
    impact.run()
    wall = time.process_time() - began
    record, checked = impact.record(), balance(impact)
    result = evaluate(record)
    magnitude = np.linalg.norm(record.head_acceleration, axis=1)
    i = int(magnitude.argmax())
    normal = record.ground_force[:, 2]
    early = normal[: max(1, round(EARLY / record.time_step))]
    # Along the direction in which the head accelerates.
    along = record.head_acceleration[i] / magnitude[i]
    ground = float(record.ground_force[i] @ along)
    neck = float(_world(record, record.neck_force)[i] @ along)
    own = impact.setup.helmet_config.mass + float(impact.model.body("head").mass[0])
    mechanical = checked.mechanical
    return CaseResult(
        name=name,
        setup=setup,
        peak_g=float(result.peak_g),
        peak_time=float(record.time[i]),
        force_ratio=float(result.force_ratio),
        peak_force=float(normal.max()),
        hic=float(result.hic),
        peak_angular_acceleration=float(result.peak_angular_acceleration),
        early_spike=float(early.max() / normal.max()),
        grounded=bool(normal[i] > 0.0),
        effective_mass=ground / float(magnitude[i]),
        added_mass=(ground + neck) / float(magnitude[i]) - own,
        neck_force=neck,
        momentum_error=checked.momentum_error,
        energy_lost=1.0 - float(mechanical[-1] / mechanical[0]),
        energy_growth=checked.energy_growth,
        wall=wall,
        published=published,
        record=record,
    )


@dataclass(frozen=True)
class Histories:
    """How alike the histories of one case are in two forms of the helmet.

    Attributes:
        acceleration: rating of the head acceleration over the first 30 ms (ISO/TS 18571).
        rotation: the same of the head's angular velocity.
        chatter: of the head acceleration, of the rated form and of the reference.
    """

    acceleration: Rating
    rotation: Rating
    chatter: tuple[Chatter, Chatter]


def histories(case: CaseResult, reference: CaseResult) -> Histories:
    """The histories of a case rated against those of its reference."""
    acceleration, rotation = (
        channel_rating(reference.record, case.record, channel, RATED_FOR)
        for channel in ("head_acceleration", "head_angular_velocity")
    )
    ours, others = (
        chatter(one.record.head_acceleration / STANDARD_GRAVITY, one.record.time_step)
        for one in (case, reference)
    )
    return Histories(acceleration, rotation, (ours, others))


def errors(values: Sequence[float], references: Sequence[float]) -> tuple[float, float]:
    """Mean and largest relative error [%]."""
    relative = 100.0 * np.abs(np.asarray(values) / np.asarray(references) - 1.0)
    return float(relative.mean()), float(relative.max())


def against_published(
    cases: Iterable[CaseResult | Varied], model: str, criterion: str
) -> tuple[float, float]:
    """Mean and largest error [%] of a criterion against one published column."""
    rows = [case for case in cases if case.published]
    ours = [float(getattr(case, criterion)) for case in rows]
    return errors(ours, [case.published[criterion][model] for case in rows])  # type: ignore[index]


def _world(record: ImpactRecord, vectors: np.ndarray) -> np.ndarray:
    turned: np.ndarray = Rotation.from_quat(record.head_orientation).apply(vectors)
    return turned
