"""Foams as data and from a laboratory's tests: read, refused with the row, fitted, used."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.foams import load_foam
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.force.foam import (
    CONSTANTS,
    LIMIT,
    POINTS,
    RATE_EXPONENT,
    bottoming_strain,
    energy_between,
    foam_row,
    in_series,
    loading_stress,
    rate_factor,
    residual_strain,
    rows_of,
    table_row,
    unloading_stress,
)
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study.foams.curve import read_curves
from helmet_sim_ros.study.foams.fitting import fit_foam, write_foam

STRAIN = np.linspace(0.0, 0.8, 80)


def eps(strain: float, density: float = 60.0) -> float:
    return float(loading_stress(strain, foam_row(density, 0.05)))


def tabulated(density: float = 60.0) -> np.ndarray:
    """EPS as a table."""
    row = foam_row(density, 0.05)
    limit = 0.95 * row[LIMIT]
    stress = np.array([loading_stress(e, row) for e in np.linspace(0.0, limit, POINTS)])
    return table_row(stress, limit, row[0], 0.05)


def test_every_shipped_foam_states_its_source_and_crushes_as_foams_do() -> None:
    files = sorted((share_directory() / "config" / "foams").glob("*.yaml"))
    assert len(files) >= 5
    for path in files:
        foam = load_foam(path.stem)
        assert foam.description and foam.source, path
        row = rows_of(foam, np.array([foam.density]), 0.05)[0]
        stress = [loading_stress(e, row) for e in (0.02, 0.2, 0.5, 0.8)]
        assert 0.0 < stress[0] < stress[1] < stress[2] < stress[3], path
        assert stress[3] > 1.5 * stress[1], path


def test_the_foam_eps_is_what_a_liner_has_where_it_names_none() -> None:
    named = ImpactSetup(overrides={"helmet.coupling": "foam", "helmet.liner.foam": "eps"})
    plain = ImpactSetup(overrides={"helmet.coupling": "foam"})
    assert (columns(named.helmet_config).foam == columns(plain.helmet_config).foam).all()


def test_a_table_follows_the_law_that_it_was_made_of() -> None:
    row, table = foam_row(60.0, 0.05), tabulated()
    for e in np.linspace(0.05, 0.8, 40):
        assert loading_stress(e, table) == pytest.approx(loading_stress(e, row), rel=0.01)
    for high in (0.1, 0.4, 0.7):
        assert energy_between(0.02, high, table) == pytest.approx(
            energy_between(0.02, high, row), rel=0.01
        )
        rest = residual_strain(high, row)
        assert residual_strain(high, table) == pytest.approx(rest, abs=0.003)
        middle = 0.5 * (rest + high)
        assert unloading_stress(middle, high, rest, table) == pytest.approx(
            unloading_stress(middle, high, rest, row), rel=0.01
        )
    assert bottoming_strain(table) == pytest.approx(bottoming_strain(row), rel=0.05)


def test_a_tables_energy_is_the_integral_of_its_stress_also_beyond_it() -> None:
    table = tabulated()
    strain = np.linspace(0.1, 1.05, 200_001)
    stress = np.array([loading_stress(e, table) for e in strain[::20]])
    integral = np.trapezoid(stress, strain[::20])
    assert energy_between(0.1, 1.05, table) == pytest.approx(integral, rel=1e-5)


def test_an_impact_on_a_tabled_foam_is_that_on_the_law(tmp_path: Path) -> None:
    path = laboratory(tmp_path / "test.csv", [(None, 1.0)])
    write_foam(fit_foam(read_curves(path), 60.0), tmp_path / "mine.yaml")
    common = {"helmet.coupling": "foam", "helmet.liner.density": 60.0}
    peaks = []
    for foam in ("eps", str(tmp_path / "mine.yaml")):
        setup = ImpactSetup(rig="headform", normal_velocity=6.0,
                            overrides={**common, "helmet.liner.foam": foam})  # fmt: skip
        peaks.append(evaluate(simulate(setup)).peak_g.value)
    assert peaks[1] == pytest.approx(peaks[0], rel=0.01)


def test_a_slow_test_of_a_foam_is_brought_to_the_rate_of_an_impact(tmp_path: Path) -> None:
    share = (0.01 / 100.0) ** RATE_EXPONENT
    fit = fit_foam(read_curves(laboratory(tmp_path / "slow.csv", [(0.01, share)])), 60.0)
    assert fit.foam.rate == 0.01 and fit.foam.rate_exponent is None
    row = rows_of(fit.foam, np.array([60.0]), 0.05)[0]
    assert loading_stress(0.3, row) == pytest.approx(eps(0.3), rel=0.01)
    assert loading_stress(0.3, row) * rate_factor(0.01, row) == pytest.approx(
        float(np.interp(0.3, fit.strain, fit.stress)), rel=1e-3
    )


def test_of_several_rates_the_liner_follows_the_power_that_was_found(tmp_path: Path) -> None:
    tests = [(rate, rate**0.05) for rate in (0.01, 1.0, 10.0)]
    path = laboratory(tmp_path / "t.csv", tests)
    fit = fit_foam(read_curves(path), 60.0, rate=10.0)
    row = rows_of(fit.foam, np.array([60.0]), 0.05)[0]
    for rate, factor in tests:
        stress = loading_stress(0.3, row) * rate_factor(rate, row)
        assert stress == pytest.approx(factor * eps(0.3), rel=0.01)


def test_two_layers_bear_one_stress_and_share_the_strain() -> None:
    soft, hard = foam_row(30.0, 0.05), foam_row(90.0, 0.05)
    row = in_series(hard[None], soft, 0.4)[0]
    assert len(row) == CONSTANTS + 2 * POINTS
    for e in (0.1, 0.25, 0.45):
        stress = loading_stress(e, row)

        def strain_at(layer: np.ndarray, stress: float = stress) -> float:
            grid = np.linspace(0.0, 0.9, 40_001)
            path = np.array([loading_stress(x, layer) for x in grid])
            return float(np.interp(stress, path, grid))

        assert 0.6 * strain_at(hard) + 0.4 * strain_at(soft) == pytest.approx(e, abs=0.004)
    same = in_series(hard[None], hard, 0.5)[0]
    assert loading_stress(0.4, same) == pytest.approx(loading_stress(0.4, hard), rel=0.005)


def test_a_softer_inner_layer_softens_a_slow_blow() -> None:
    common = {"helmet.coupling": "foam", "helmet.liner.density": 80.0}
    setup = ImpactSetup(rig="headform", normal_velocity=4.0, overrides=common)
    layered = ImpactSetup(rig="headform", normal_velocity=4.0, overrides={
        **common, "helmet.liner.inner.density": 30.0, "helmet.liner.inner.share": 0.5})  # fmt: skip
    hard, soft = (evaluate(simulate(s)).peak_g.value for s in (setup, layered))
    assert soft < 0.9 * hard


def laboratory(path: Path, tests: list[tuple[float | None, float]], **how: object) -> Path:
    """A table as a laboratory writes it: one stress column per rate, each EPS times a factor."""
    names = ["stress" if rate is None else f"stress {rate:g} 1/s" for rate, _ in tests]
    unit, scale = how.get("unit", "MPa"), float(str(how.get("scale", 1e-6)))
    lines = ["strain [-];" + ";".join(f"{name} [{unit}]" for name in names)]
    for e in STRAIN:
        lines.append(
            f"{e:.5f};" + ";".join(f"{factor * eps(e) * scale:.6g}" for _, factor in tests)
        )
    text = "\n".join(lines)
    path.write_text(text.replace(".", ",") if how.get("comma") else text, encoding="utf-8")
    return path


def test_german_tables_are_read(tmp_path: Path) -> None:
    path = tmp_path / "labor.csv"
    lines = ["# Prüfbericht", "Dehnung;Spannung", "[%];[N/mm²]"]
    lines += [f"{100 * e:.3f};{1e-6 * eps(e):.6f}".replace(".", ",") for e in STRAIN]
    path.write_text("\r\n".join(lines), encoding="latin-1")
    (curve,) = read_curves(path)
    assert curve.strain == pytest.approx(STRAIN, abs=1e-5)
    assert curve.stress == pytest.approx([eps(e) for e in STRAIN], rel=1e-3, abs=1.0)


def test_a_stress_that_falls_a_little_is_smoothed_and_the_share_is_told(tmp_path: Path) -> None:
    """Two neighbours that fall become their mean: each moves by half of the fall."""
    path = laboratory(tmp_path / "t.csv", [(5.0, 1.0)], unit="Pa", scale=1.0)
    lines = path.read_text().splitlines()
    i = len(STRAIN) // 3
    strain, fallen = STRAIN[i], eps(STRAIN[i - 1]) - 3000.0
    lines[i + 1] = f"{strain:.5f};{fallen:.6g}"
    path.write_text("\n".join(lines))
    (curve,) = read_curves(path)
    assert curve.stress[i - 1] == curve.stress[i] == pytest.approx(fallen + 1500.0, rel=1e-4)
    assert curve.raised == pytest.approx(1500.0 / curve.plateau, rel=5e-3)
    told = f"smoothed by at most {100.0 * curve.raised:.1f} % of it"
    assert any(told in note for note in fit_foam([curve], 60.0).notes)


@pytest.mark.parametrize(
    ("unit", "pascals"),
    [("Pa", 1.0), ("kPa", 1e3), ("MPa", 1e6), ("N/mm2", 1e6), ("N/mm^2", 1e6), ("bar", 1e5),
     ("psi", 6894.757)],
)  # fmt: skip
def test_a_stress_is_the_same_in_every_unit(unit: str, pascals: float, tmp_path: Path) -> None:
    path = laboratory(tmp_path / "t.csv", [(None, 1.0)], unit=unit, scale=1.0 / pascals)
    (curve,) = read_curves(path)
    assert curve.stress == pytest.approx([eps(e) for e in STRAIN], rel=1e-5, abs=1e-3)


@pytest.mark.parametrize(
    ("told", "rate"), [("5 1/s", 5.0), ("2,5 s-1", 2.5), ("30 1/min", 0.5), ("0.2 1/ms", 200.0)]
)
def test_a_rate_in_a_heading_is_read_in_every_unit(told: str, rate: float, tmp_path: Path) -> None:
    path = laboratory(tmp_path / "t.csv", [(None, 1.0)])
    path.write_text(path.read_text().replace("stress", f"stress {told}"))
    (curve,) = read_curves(path)
    assert curve.rate == pytest.approx(rate)


def test_the_law_is_found_again_and_its_error_told(tmp_path: Path) -> None:
    fit = fit_foam(read_curves(laboratory(tmp_path / "t.csv", [(100.0, 1.0)])), 60.0)
    row = foam_row(60.0, 0.05)
    assert fit.law.yield_stress == pytest.approx(row[0], rel=0.01)
    assert fit.law.gas_pressure == pytest.approx(row[2], rel=0.03)
    assert fit.error < 0.01


def test_the_power_of_the_rate_is_found_again(tmp_path: Path) -> None:
    tests = [(rate, rate**0.05) for rate in (0.01, 1.0, 10.0)]
    fit = fit_foam(read_curves(laboratory(tmp_path / "t.csv", tests, comma=True)), 60.0)
    assert fit.exponent == pytest.approx(0.05, abs=1e-4)
    at_impact = float(np.interp(0.3, fit.strain, fit.stress))
    assert at_impact == pytest.approx(100.0**0.05 * eps(0.3), rel=0.01)


def test_a_rate_column_is_the_same_as_a_column_per_rate(tmp_path: Path) -> None:
    lines = ["strain [%],stress [kPa],rate [1/min]"]
    for rate, factor in ((6.0, 1.0), (600.0, 1.2)):
        lines += [f"{100 * e:.4f},{1e-3 * factor * eps(e):.5f},{rate}" for e in STRAIN]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(lines))
    one, two = read_curves(path)
    assert (one.rate, two.rate) == pytest.approx((0.1, 10.0))
    assert two.plateau == pytest.approx(1.2 * one.plateau)


def rows(path: Path) -> list[str]:
    return laboratory(path, [(None, 1.0)]).read_text().splitlines()


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda r: [*r[:40], r[40].replace(r[40].split(";")[1], "0.1"), *r[41:]], "row 41"),
        (lambda r: [*r[:20], r[10], *r[21:]], "row 21"),
        (lambda r: [*r[:30], "0.3;nan", *r[31:]], "row 31"),
        (lambda r: [*r[:30], "0.3;viel", *r[31:]], "row 31"),
        (lambda r: [*r[:30], "0.3", *r[31:]], "row 31"),
        (lambda r: [r[0].replace("[MPa]", "[kPa]"), *r[1:]], "wrong unit"),
        (lambda r: [r[0].replace("[MPa]", "[furlong]"), *r[1:]], "must be one of pa, kpa"),
        (lambda r: [r[0].replace(" [MPa]", ""), *r[1:]], "no unit"),
        (lambda r: [r[0].replace("[-]", "[%]"), *r[1:]], "ends before 0.5"),
        (lambda r: r[:40], "ends before 0.5"),
        (lambda r: [r[0].replace("stress", "force"), *r[1:]], "no column named stress"),
        (lambda r: r[1:], "must be a heading"),
        (lambda r: r[:1], "no rows"),
        (lambda r: [], "no table"),
    ],
)
def test_what_is_no_foam_curve_is_refused_with_its_place(
    change: object, named: str, tmp_path: Path
) -> None:
    assert callable(change)
    path = tmp_path / "t.csv"
    path.write_text("\n".join(change(rows(path))))
    with pytest.raises(SetupError) as caught:
        read_curves(path)
    assert named in str(caught.value) and "t.csv" in str(caught.value)


def test_strains_in_percent_without_saying_so_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    lines = ["strain [-];stress [MPa]", *(f"{100 * e:.3f};{1e-6 * eps(e):.5f}" for e in STRAIN)]
    path.write_text("\n".join(lines))
    with pytest.raises(SetupError, match=r"is the column in %"):
        read_curves(path)


def test_the_figure_of_a_foam_shows_tests_table_and_law_in_megapascals(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="the figure needs the extra 'report'")
    from helmet_sim_ros.report.figures.foam import foam_figure

    table = laboratory(tmp_path / "t.csv", [(0.01, 0.8), (50.0, 1.0)])
    fit = fit_foam(read_curves(table), density=60.0)
    (axes,) = foam_figure(fit).axes
    *tests, drawn, law = axes.lines
    for line, curve in zip(tests, fit.curves, strict=True):
        assert line.get_label() == f"test at {curve.rate:g} 1/s"
        assert line.get_xdata() == pytest.approx(100.0 * curve.strain)  # %
        assert line.get_ydata() == pytest.approx(curve.stress / 1e6)
    assert drawn.get_ydata() == pytest.approx(fit.stress / 1e6)
    assert law.get_ydata() == pytest.approx(fit.law_stress(fit.strain) / 1e6)
    assert f"{100.0 * fit.error:.1f} %" in law.get_label()
    assert axes.get_ylim() == pytest.approx((0.0, 6.0 * fit.foam.yield_stress / 1e6))
    assert axes.get_xlim()[0] == 0.0 and axes.get_ylabel() == "stress [MPa]"


def test_the_command_writes_a_foam_that_a_helmet_can_name(tmp_path: Path) -> None:
    table = laboratory(tmp_path / "t.csv", [(0.01, 0.8), (50.0, 1.0)])
    arguments = ["helmet", "foam", str(table), "--density", "60", "-o", str(tmp_path / "f.yaml"),
                 "--plot", str(tmp_path / "f.svg")]  # fmt: skip
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    assert "stress ~ rate^" in result.output and (tmp_path / "f.svg").stat().st_size > 1000
    helmet = load_helmet("fullface").replaced({"liner.foam": str(tmp_path / "f.yaml")})
    assert helmet.liner.foam_digest
    again = CliRunner().invoke(main, arguments)
    assert again.exit_code == 2 and "exists" in again.output


def test_a_foam_is_used_for_its_own_densities_only() -> None:
    with pytest.raises(SetupError, match=r"liner\.density = [0-9.]+: must be from 60 to 120"):
        load_helmet("fullface").replaced({"liner.foam": "vinyl_nitrile"})
    with pytest.raises(SetupError, match=r"liner\.foam = 'cork': must be one of"):
        load_helmet("fullface").replaced({"liner.foam": "cork"})


def test_a_changed_foam_file_is_another_helmet(tmp_path: Path) -> None:
    foam = tmp_path / "f.yaml"
    text = (share_directory() / "config" / "foams" / "epp.yaml").read_text()
    foam.write_text(text)
    setup = ImpactSetup(overrides={"helmet.liner.foam": str(foam), "helmet.coupling": "foam"})
    before = setup.helmet_config
    stress = columns(before).foam[0, 0]
    foam.write_text(text.replace("yield_stress: 0.25e6", "yield_stress: 0.5e6"))
    after = load_helmet("fullface").replaced({"liner.foam": str(foam)})
    assert after.liner.foam_digest != before.liner.foam_digest
    assert columns(after).foam[0, 0] == pytest.approx(2.0 * stress)
    told = setup.described()["helmet.liner.foam_digest"]
    with pytest.raises(SetupError, match="another one now"):
        after.replaced({"liner.foam_digest": told})
