"""Optimisation of a helmet that was made of meshes."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from helmet_meshes import INNER, OUTER, ellipsoid, opened, written

from helmet_sim_ros import evaluate, optimise, simulate
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.geometry import read_geometry
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.setup import setup_from_names
from helmet_sim_ros.study.helmets.importing import ImportPlan, import_helmet, write_helmet_folder
from helmet_sim_ros.study.optimisation.design import DesignRules, make_design

STUDY = """
common:
  helmet: {name: mine/helmet.yaml}
  impact: {rig: headform, normal_velocity: 6.0}
  sim.duration: 0.015
product: {impact.direction: [top]}
variables:
  helmet.liner.thickness: [0.036, 0.044]
  helmet.liner.top.density: [40.0, 70.0]
objectives: [{minimise: helmet_mass}]
constraints: [{of: worst peak_g, at_most: 400.0}]
trials: 3
batch: 3
sampler: random
best: 1
"""


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A helmet file of an open shell whose liner is thickest in front."""
    folder = tmp_path_factory.mktemp("mine")
    inner = ellipsoid(INNER, 4)
    inner.apply_translation([-0.005, 0.0, 0.0])
    shell = written(opened(ellipsoid(OUTER, 5)), folder / "shell.stl")
    imported = import_helmet(shell, written(inner, folder / "inner.stl"), ImportPlan(columns=400))
    return write_helmet_folder(imported, folder / "mine")


def test_a_zone_as_thick_as_it_was_measured_changes_nothing(mine: Path) -> None:
    helmet = load_helmet(str(mine))
    front, back, side, top = read_geometry(str(helmet.geometry)).zone_thickness.tolist()
    assert front > back + 2e-3
    design = make_design(helmet, {"liner.front.thickness": front}, DesignRules())
    assert design.helmet.shell.semi_axes == pytest.approx(helmet.shell.semi_axes)
    assert design.quantities["helmet_mass"] == pytest.approx(helmet.mass)
    assert design.quantities["max_thickness"] == pytest.approx(max(front, back, side, top))


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 1, 0), (-1, 0, 0)])
def test_a_thicker_liner_leaves_the_head_its_room(mine: Path, axis: tuple[int, int, int]) -> None:
    helmet = load_helmet(str(mine))
    thicker = {"liner.thickness": 1.1 * helmet.liner.thickness}
    design = make_design(helmet, thicker, DesignRules())

    def inside(cells) -> float:
        where = int((cells.normal @ axis).argmax())
        return float(cells.point[where] @ axis - cells.thickness[where])

    before, after = columns(helmet), columns(design.helmet)
    assert after.thickness == pytest.approx(1.1 * before.thickness)
    # Where the liner differs from its zone's mean, by a tenth of that.
    assert inside(after) == pytest.approx(inside(before), abs=6e-4)
    assert design.helmet.mass > helmet.mass + 0.03


def test_the_best_design_is_a_helmet_that_needs_no_other_folder(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(mine.parent, tmp_path / "mine")
    (tmp_path / "study.yaml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    result = optimise("study.yaml", tmp_path / "out", workers=0)
    assert len(result.trials) == 3 and all(trial.error is None for trial in result.trials)
    best = min((t for t in result.trials if t.feasible), key=lambda t: t.responses["helmet_mass"])
    assert result.best == (best,)
    shutil.rmtree(tmp_path / "mine")
    (tmp_path / "out" / "designs").rename(tmp_path / "elsewhere")
    file = tmp_path / "elsewhere" / result.helmet_file(best).name
    values = {**result.plan.impacts.row(0).values, "helmet.name": str(file)}
    peak = evaluate(simulate(setup_from_names(values))).peak_g.value
    assert peak == best.responses["worst peak_g"]
    helmet = load_helmet(str(file))
    assert helmet.mass == best.responses["helmet_mass"]
    assert np.ptp(columns(helmet).thickness) > 5e-3
