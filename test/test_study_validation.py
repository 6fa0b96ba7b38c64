"""The validation run: what docs/validation.md claims holds, and the report says it."""

from pathlib import Path

import numpy as np
import pytest

from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.report.validation.document import write_validation
from helmet_sim_ros.study.validation.case import against_published, errors
from helmet_sim_ros.study.validation.validate import VARIATIONS, Validation, validate


@pytest.fixture(scope="module")
def result() -> Validation:
    return validate()


def test_errors_are_the_mean_and_the_largest_in_percent() -> None:
    assert errors([110.0, 40.0, 30.0], [100.0, 50.0, 30.0]) == pytest.approx((10.0, 20.0))


def test_the_spring_agrees_with_its_foam_better_than_the_papers_did(result: Validation) -> None:
    spring, foam = zip(*result.oblique, strict=True)
    assert len(spring) == 24
    assert (
        errors([s.peak_g for s in spring], [f.peak_g for f in foam])[0] < 7.5
    )  # 7.0 %; the paper's 11.7
    assert errors([s.force_ratio for s in spring], [f.force_ratio for f in foam])[0] < 7.5  # 6.5
    assert max(s.early_spike for s in spring) < 0.4
    assert all(case.grounded for case in (*spring, *foam))


def test_the_spring_reproduces_its_drop_tests(result: Validation) -> None:
    for what in ("peak_force", "peak_g"):
        mean, worst = errors(
            [getattr(s.test, what) for s, _ in result.drops],
            [getattr(f.test, what) for _, f in result.drops],
        )
        assert mean < 2.0 and worst < 5.0  # 1.3 and 3.5 %


def test_the_foam_helmet_s_peaks_come_closer_to_fe_than_the_papers_spring(
    result: Validation,
) -> None:
    foam = [f for _, f in result.table]
    assert against_published(foam, "FE", "peak_g")[0] < 5.5  # 4.8 %; the paper's spring: 11.7
    assert against_published(foam, "THUMS", "peak_g")[0] < 9.5  # 8.7 %
    # Not so the ratio of forces: 13.6 %, the paper's spring 13.0.
    assert against_published(foam, "FE", "force_ratio")[0] < 14.5
    assert against_published(foam, "THUMS", "force_ratio")[0] < 10.0  # 9.2 %


def test_the_calibrated_preset_is_near_the_papers_spring(result: Validation) -> None:
    """It was calibrated with a head fixed in its helmet: 1.5 % then, 9.9 % with a padding."""
    assert against_published(result.paper, "MB", "peak_g")[0] < 10.5
    for case in result.paper:
        assert case.published
        assert abs(case.force_ratio - case.published["force_ratio"]["MB"]) < 0.06  # 0.053


def test_peaks_are_refined_and_balances_close(result: Validation) -> None:
    assert len(result.refinement) == 2 * (24 + 16)
    assert max(r.time_step for r in result.refinement) < 0.01
    # 3.5 % of a force ratio, where the liner's shear yields; all drops within 1.1 %.
    assert max(r.columns for r in result.refinement) < 0.04
    drops = [r.columns for r in result.refinement if r.name.startswith("drop")]
    assert max(drops) < 0.015
    cases = [case for pair in (*result.oblique, *result.table) for case in pair]
    assert max(case.momentum_error for case in cases) < 0.01
    assert max(s.energy_growth for s, _ in result.table) < 1e-3


def test_the_neck_explains_what_the_body_adds(result: Validation) -> None:
    for pair in result.table:
        for case in pair:
            assert case.effective_mass > 6.3  # 6.39; head and helmet weigh 5.85 kg
            assert abs(case.added_mass) < 0.1  # 0.06


def test_more_friction_raises_the_ratio_and_more_foam_the_acceleration(result: Validation) -> None:
    base = [f for _, f in result.table]
    sensitivity = dict(result.sensitivity)
    assert set(sensitivity) == set(VARIATIONS)

    def mean(words: str, what: str) -> float:
        pairs = zip(sensitivity[words], base, strict=True)
        return float(np.mean([getattr(c, what) / getattr(b, what) for c, b in pairs]))

    assert mean("friction 0.3", "force_ratio") < 0.9 < 1.1 < mean("friction 0.5", "force_ratio")
    assert mean("foam density 45 kg/m^3", "peak_g") < 1.0 < mean("foam density 55 kg/m^3", "peak_g")


def test_the_report_holds_the_tables_and_figures(result: Validation, tmp_path: Path) -> None:
    text = write_validation(result, tmp_path).read_text()
    foam = [f for _, f in result.table]
    assert f"**{against_published(foam, 'FE', 'peak_g')[0]:.1f} %" in text
    assert text.count("\n| vn7.5 vt10 |") >= 2 and "calibrated" in text
    for spring, dropped in result.drops:
        test, other = spring.test, dropped.test
        force = f"{test.peak_force / 1e3:.2f} / {other.peak_force / 1e3:.2f}"  # kN
        crush = f"{test.peak_compression * 1e3:.1f} / {other.peak_compression * 1e3:.1f}"  # mm
        assert f"| {test.direction} | {test.normal_velocity:g} | {force} | {crush} |" in text
    assert any(10.0 < f.test.peak_compression * 1e3 < 50.0 for _, f in result.drops)
    head = float(Impact(foam[0].setup).model.body("head").mass[0])
    own = foam[0].setup.helmet_config.mass + head
    assert f"head and helmet alone weigh {own:.2f} kg" in text
    figures = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert figures == ["drop_loops.svg", "drop_peaks.svg", "oblique_histories.svg"]
    for name in figures:
        assert f"figures/{name}" in text
