"""Validation: spring against foam, both against published values, and the solver against itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.model.helmet import Padding
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.identification.drop_tests import SimulatedDrop, simulated_drops
from helmet_sim_ros.study.scenario.matrix import load_scenario
from helmet_sim_ros.study.validation.case import CaseResult, Varied, run_case, run_varied
from helmet_sim_ros.study.validation.experiments import load_experiments
from helmet_sim_ros.study.validation.findings import Finding, findings

FOAM = {"helmet.coupling": "foam"}
SPRING = {"helmet.coupling": "spring"}
#: The paper's own comparison (its Table 1): mean error of MB against FE.
PAPER_ERRORS = {"peak_g": 11.7, "force_ratio": 13.0}

#: What refinement is told by.
PEAKS = ("peak_g", "peak_normal_force", "force_ratio")
#: Of the padding of every shipped helmet [Pa].
SHEAR = Padding().shear_modulus
_BENDING = tuple(f"rider.neck.{sense}_per_level" for sense in ("flexion", "extension", "lateral"))
#: What the sensitivity table varies, in words -> overrides or setup values.
VARIATIONS: Mapping[str, Mapping[str, object]] = {
    "neck half as stiff in compression": {"rider.neck.compression_per_level": 246e3},
    "neck twice as stiff in compression": {"rider.neck.compression_per_level": 984e3},
    "neck half as stiff in bending": dict.fromkeys(_BENDING, 43.0),
    "neck twice as stiff in bending": dict.fromkeys(_BENDING, 172.0),
    "neck damped half as much": {"rider.neck.rotation_damping_per_level": 0.75},
    "body axis at 20 deg": {"impact.body_angle_deg": 20.0},
    "body axis at 40 deg": {"impact.body_angle_deg": 40.0},
    "heading 60 deg": {"impact.tangential_heading_deg": 60.0},
    "friction 0.3": {"impact.friction": 0.3},
    "friction 0.5": {"impact.friction": 0.5},
    "foam density 45 kg/m^3": {"helmet.liner.density": 45.0},
    "foam density 55 kg/m^3": {"helmet.liner.density": 55.0},
    "head fixed in the liner": {"head.friction": 2.0, "helmet.padding.shear_modulus": 1e7},
    "friction of the head 0.16": {"head.friction": 0.16},
    "friction of the head 0.75": {"head.friction": 0.75},
    "padding half as stiff in shear": {"helmet.padding.shear_modulus": 0.5 * SHEAR},
    "padding twice as stiff in shear": {"helmet.padding.shear_modulus": 2.0 * SHEAR},
}  # fmt: skip


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
    sensitivity: tuple[tuple[str, tuple[Varied, ...]], ...]
    experiments: tuple[Finding, ...]


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
        run_case(c.name, c.impact, c.reference) for c in load_scenario("oblique_paper").cases
    )
    progress("refinement of time step and columns")
    refinement = tuple(_refined(oblique, drops))
    progress("sensitivity")
    sensitivity = tuple((words, tuple(_varied(changes))) for words, changes in VARIATIONS.items())
    experiments = findings(load_experiments(), lambda what: progress(f"experiment {what}"))
    return Validation(drops, oblique, table, paper, refinement, sensitivity, experiments)


def _pairs(scenario: str) -> tuple[tuple[CaseResult, CaseResult], ...]:
    columns = []
    for overrides in (SPRING, FOAM):
        cases = load_scenario(scenario, overrides=overrides).cases
        columns.append([run_case(c.name, c.impact, c.reference) for c in cases])
    return tuple(zip(*columns, strict=True))


def _varied(changes: Mapping[str, object]) -> Iterable[Varied]:
    """Table 1 with the foam helmet and some values changed."""
    for case in load_scenario("oblique_table1", overrides={**FOAM, **changes}).cases:
        yield run_varied(case.name, case.impact, case.reference)


def _refined(
    oblique: Iterable[tuple[CaseResult, CaseResult]],
    drops: Iterable[tuple[SimulatedDrop, SimulatedDrop]],
) -> Iterable[Refinement]:
    known = [(f"oblique {case.name}", case.setup, case.record) for pair in oblique for case in pair]
    known += [
        (f"drop {d.test.direction} {d.test.normal_velocity:g} m/s", d.setup, simulate(d.setup))
        for pair in drops for d in pair
    ]  # fmt: skip
    for name, setup, record in known:
        base = _peaks(setup, record)
        finer = _peaks(setup.replaced({"time_step": 0.5 * setup.time_step}))
        columns = 0.0
        if setup.helmet_config.coupling == "foam":
            doubled = {"helmet.liner.columns": 2 * setup.helmet_config.liner.columns}
            more = ImpactSetup(
                **{**setup.model_dump(), "overrides": {**setup.overrides, **doubled}}
            )
            columns = _change(base, _peaks(more))
        yield Refinement(name, setup.helmet_config.coupling, _change(base, finer), columns)


def _peaks(setup: ImpactSetup, record: ImpactRecord | None = None) -> tuple[float, ...]:
    """Peak acceleration, peak normal force, and force ratio where there is friction at all."""
    result = evaluate(simulate(setup) if record is None else record, criteria=PEAKS)
    peaks = (float(result.peak_g), float(result.peak_normal_force))
    return (*peaks, float(result.force_ratio)) if setup.tangential_velocity else peaks


def _change(base: tuple[float, ...], other: tuple[float, ...]) -> float:
    return max(abs(b / a - 1.0) for a, b in zip(base, other, strict=True))
