"""The names that the packages offer: typed, listed, loaded on first use."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

FACADES = [
    "helmet_sim_ros",
    "helmet_sim_ros.biomech",
    "helmet_sim_ros.mcap_log",
    "helmet_sim_ros.study",
]


@pytest.mark.parametrize("name", FACADES)
def test_the_stub_types_exactly_the_names_that_are_offered(name: str):
    package = importlib.import_module(name)
    stub = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text(encoding="utf-8"))
    typed: dict[str, str] = {}
    for statement in stub.body:
        if isinstance(statement, ast.ImportFrom):
            typed |= {str(alias.asname): str(statement.module) for alias in statement.names}
    assert set(typed) == set(package.__all__)
    for offered, module in typed.items():
        assert getattr(package, offered) is getattr(importlib.import_module(module), offered)


@pytest.mark.parametrize("name", FACADES)
def test_dir_lists_what_is_offered_and_nothing_of_how(name: str):
    package = importlib.import_module(name)
    listed = set(dir(package))
    assert set(package.__all__) <= listed
    assert not listed & {"Any", "TYPE_CHECKING", "lazy_names", "annotations"}


@pytest.mark.parametrize("name", FACADES)
def test_a_package_has_no_other_names(name: str):
    assert not hasattr(importlib.import_module(name), "nonsense")


def test_a_verb_stays_a_function_when_the_rooms_are_loaded():
    """A room of the same name would take its place."""
    study = importlib.import_module("helmet_sim_ros.study")
    for room in Path(str(study.__file__)).parent.iterdir():
        if room.is_dir() and room.name != "__pycache__":
            importlib.import_module(f"helmet_sim_ros.study.{room.name}")
    assert callable(study.sweep)
    assert callable(study.optimise)


def test_importing_the_package_loads_no_library():
    code = "import sys, helmet_sim_ros, helmet_sim_ros.study; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    heavy = {"numpy", "scipy", "pydantic", "mujoco", "numba", "mcap"}
    assert not heavy & set(run.stdout.split())
