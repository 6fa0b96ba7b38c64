"""Validation: spring against foam, both against published values, and the solver against itself."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.study.drop_tests import SimulatedDrop, simulated_drops
from helmet_sim_ros.study.reference import Published
from helmet_sim_ros.study.scenario import load_scenario

FOAM = {"helmet.coupling": "foam"}
SPRING = {"helmet.coupling": "spring"}
EARLY = 5e-4  # s, how long a first-touch spike of the shell may last
PUBLISHED = ("MB", "FE", "THUMS")
#: The paper's own comparison (its Table 1): mean error of MB against FE.
PAPER_ERRORS = {"peak_g": 11.7, "force_ratio": 13.0}

#: What the sensitivity table varies, in words -> overrides or setup values.
VARIATIONS: Mapping[str, Mapping[str, object]] = {
    "neck axial stiffness halved": {"rider.neck.axial_stiffness": 75e3},
    "neck axial stiffness doubled": {"rider.neck.axial_stiffness": 300e3},
    "neck bending stiffness halved": {"rider.neck.bending_stiffness": 10.0},
    "neck bending stiffness doubled": {"rider.neck.bending_stiffness": 40.0},
    "body axis at 20 deg": {"impact.body_angle_deg": 20.0},
    "body axis at 40 deg": {"impact.body_angle_deg": 40.0},
    "heading 60 deg": {"impact.tangential_heading_deg": 60.0},
    "friction 0.3": {"impact.friction": 0.3},
    "friction 0.5": {"impact.friction": 0.5},
    "foam density 50 kg/m^3": {"helmet.liner.density": 50.0},
    "foam density 60 kg/m^3": {"helmet.liner.density": 60.0},
    "head fixed in the liner": {"helmet.liner.padding_stiffness": 1e7,
                                "helmet.liner.head_friction": 5.0},
    "head on bare liner, friction 0.5": {"helmet.liner.padding_stiffness": 1e6},
    "soft padding and scalp (100 kN/m)": {"helmet.liner.padding_stiffness": 1e5},
    "softer padding and scalp (50 kN/m)": {"helmet.liner.padding_stiffness": 5e4},
}  # fmt: skip


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
class Refinement:
    """Largest relative change of a case's peaks on refinement [-]."""

    name: str
    helmet: str
    time_step: float
    columns: float


@dataclass(frozen=True)
class Validation:
    """Everything that docs/validation.md reports. Pairs hold spring and foam."""

    drops: tuple[tuple[SimulatedDrop, SimulatedDrop], ...]
    oblique: tuple[tuple[CaseResult, CaseResult], ...]
    table: tuple[tuple[CaseResult, CaseResult], ...]
    paper: tuple[CaseResult, ...]
    refinement: tuple[Refinement, ...]
    sensitivity: tuple[tuple[str, tuple[CaseResult, ...]], ...]


def validate(progress: Callable[[str], None] = lambda _: None) -> Validation:
    """Run the whole validation. ``progress`` hears what is being done."""
    progress("drop tests")
    drops = tuple(
        zip(simulated_drops(overrides=SPRING), simulated_drops(overrides=FOAM), strict=True)
    )
    progress("oblique impacts, 24 cases with either helmet")
    oblique = _pairs("oblique_matrix")
    progress("Table 1, six cases with either helmet")
    table = _pairs("oblique_table1")
    paper = tuple(
        run_case(c.name, c.setup, c.reference) for c in load_scenario("oblique_paper").cases
    )
    progress("refinement of time step and columns")
    refinement = tuple(_refined(oblique, drops))
    progress("sensitivity")
    sensitivity = tuple((words, tuple(_varied(changes))) for words, changes in VARIATIONS.items())
    return Validation(drops, oblique, table, paper, refinement, sensitivity)


def run_case(name: str, setup: ImpactSetup, published: Published | None = None) -> CaseResult:
    """Simulate and measure one case."""
    impact = Impact(setup)
    began = time.process_time()
    impact.advance(impact.total)
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


def errors(values: Sequence[float], references: Sequence[float]) -> tuple[float, float]:
    """Mean and largest relative error [%]."""
    relative = 100.0 * np.abs(np.asarray(values) / np.asarray(references) - 1.0)
    return float(relative.mean()), float(relative.max())


def against_published(
    cases: Iterable[CaseResult], model: str, criterion: str
) -> tuple[float, float]:
    """Mean and largest error [%] of a criterion against one published column."""
    rows = [case for case in cases if case.published]
    ours = [float(getattr(case, criterion)) for case in rows]
    return errors(ours, [case.published[criterion][model] for case in rows])  # type: ignore[index]


def _pairs(scenario: str) -> tuple[tuple[CaseResult, CaseResult], ...]:
    columns = []
    for overrides in (SPRING, FOAM):
        cases = load_scenario(scenario, overrides=overrides).cases
        columns.append([run_case(c.name, c.setup, c.reference) for c in cases])
    return tuple(zip(*columns, strict=True))


def _varied(changes: Mapping[str, object]) -> Iterable[CaseResult]:
    """Table 1 with the foam helmet and some values changed."""
    for case in load_scenario("oblique_table1", overrides={**FOAM, **changes}).cases:
        yield run_case(case.name, case.setup, case.reference)


def _refined(
    oblique: Iterable[tuple[CaseResult, CaseResult]],
    drops: Iterable[tuple[SimulatedDrop, SimulatedDrop]],
) -> Iterable[Refinement]:
    setups = [(f"oblique {case.name}", case.setup) for pair in oblique for case in pair]
    setups += [
        (f"drop {d.test.direction} {d.test.normal_velocity:g} m/s", d.setup)
        for pair in drops for d in pair
    ]  # fmt: skip
    for name, setup in setups:
        base = _peaks(setup)
        finer = _peaks(setup.replaced({"time_step": 0.5 * setup.time_step}))
        columns = 0.0
        if setup.helmet_config.coupling == "foam":
            doubled = {"helmet.liner.columns": 2 * setup.helmet_config.liner.columns}
            more = ImpactSetup(
                **{**setup.model_dump(), "overrides": {**setup.overrides, **doubled}}
            )
            columns = _change(base, _peaks(more))
        yield Refinement(name, setup.helmet_config.coupling, _change(base, finer), columns)


def _peaks(setup: ImpactSetup) -> tuple[float, ...]:
    """Peak acceleration, peak normal force, and force ratio where there is friction at all."""
    impact = Impact(setup)
    impact.advance(impact.total)
    result = evaluate(impact.record())
    peaks = (float(result.peak_g), float(result.peak_normal_force))
    return (*peaks, float(result.force_ratio)) if setup.tangential_velocity else peaks


def _change(base: tuple[float, ...], other: tuple[float, ...]) -> float:
    return max(abs(b / a - 1.0) for a, b in zip(base, other, strict=True))


def _world(record: ImpactRecord, vectors: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    turned: np.ndarray = Rotation.from_quat(record.head_orientation).apply(vectors)
    return turned
