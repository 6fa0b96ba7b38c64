"""A fall that can be: everything that defines one, and a start that is clear of all around."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import model_validator

from helmet_sim_ros.biomech.record import is_fall
from helmet_sim_ros.model.fall.values import FALL_KEYS, FallValues
from helmet_sim_ros.model.setup import ImpactSetup, from_names, named_leaves, setup_from_names
from helmet_sim_ros.schema import Leaf


class Fall(FallValues):
    """One fall, complete: gravity does the rest.

    The rider starts over the origin of the scene, faces its heading and moves along it.

    Raises:
        SetupError: any refused value, named with its key and the allowed range; a rider who starts
            inside the ground or anything else of the scene.
    """

    @model_validator(mode="after")
    def _starts_clear(self) -> Fall:
        from helmet_sim_ros.model.world import build  # loads the compiler

        build(self, self.helmet_config)
        return self


def fall_from_names(values: Mapping[str, Any]) -> Fall:
    """A fall from dotted names: ``fall.*``, ``rider.*``, ``helmet.*``, ``head.*``, ``sim.*``.

    Raises:
        SetupError: unknown name, or a refused value.
    """
    return from_names(Fall, values, FALL_KEYS)


def setup_or_fall(values: Mapping[str, Any]) -> ImpactSetup | Fall:
    """An impact or a fall from dotted names: a fall where any of them is ``fall.*``.

    Raises:
        SetupError: unknown name, or a refused value.
    """
    return fall_from_names(values) if is_fall(values) else setup_from_names(values)


def fall_leaves() -> list[Leaf]:
    """Every ``fall.*``, ``sim.*``, ``rider.*`` and ``head.*`` value, with its dotted name."""
    return named_leaves(Fall, FALL_KEYS)
