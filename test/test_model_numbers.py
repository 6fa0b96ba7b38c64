"""Another rider's numbers in a compiled model: bit for bit what is compiled anew."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.world import Kind, Plan, Structure, _structure, numbered, specified

#: Riders of each form and rig; 500 take a minute.
RIDERS = int(os.environ.get("RIDERS", "10"))


def plans(rig: str, form: str) -> Iterator[Plan]:
    random = np.random.default_rng(0)
    for i in range(RIDERS):
        overrides = {
            "helmet.coupling": form,
            "helmet.mass": random.uniform(1.0, 2.0),
            "rider.height": random.uniform(1.5, 2.0),
            "rider.mass": random.uniform(45.0, 120.0),
        }
        if rig == "rider":
            overrides["rider.sex"] = ("male", "female")[i % 2]
            overrides["rider.posture.hip_flexion_deg"] = random.uniform(0.0, 90.0)
        setup = ImpactSetup(rig=rig, overrides=overrides)  # type: ignore[arg-type]
        yield Plan(
            setup.rig, setup.rider, setup.helmet_config, 0.0, random.uniform(9.0, 10.0),
            random.uniform(1e-5, 5e-5), setup.surface_config, setup.headform, setup.posing,
        )  # fmt: skip


def numbers(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Every number of a model that anything is computed from, by name."""
    found = {}
    for part in (model, model.opt):
        for name in dir(part):
            value = None if name.startswith("_") else getattr(part, name, None)
            if isinstance(value, int | float | np.ndarray):
                found[f"{type(part).__name__}.{name}"] = np.array(value)
    return found


def structure_of(plan: Plan) -> Structure:
    return _structure(Kind(plan.rig, plan.helmet.coupling, plan.surface, plan))


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize("rig", ["rider", "headform", "monorail"])
def test_a_written_model_is_the_compiled_one(rig: str, form: str) -> None:
    first, *others = plans(rig, form)
    structure_of(first)
    for plan in others:
        compiled = numbers(specified(plan).compile())
        written = numbers(numbered(structure_of(plan), plan))
        assert compiled.keys() == written.keys() and len(compiled) > 300
        assert any((compiled["MjModel.body_mass"] != structure_of(plan).model.body_mass).tolist())
        for name, value in compiled.items():
            np.testing.assert_array_equal(written[name], value, err_msg=name)


def test_data_are_used_again_once_their_impact_is_gone() -> None:
    setup = ImpactSetup(rig="headform")
    impact, other = Impact(setup), Impact(setup)
    data, last = impact._data, other._data
    assert data is not last
    data.qvel[:] = 5.0
    del impact
    gc.collect()
    again = Impact(setup)
    assert again._data is data
    np.testing.assert_array_equal(again._data.qvel, last.qvel)
