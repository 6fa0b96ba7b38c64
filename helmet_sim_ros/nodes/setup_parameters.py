"""The parameters of the simulation node: a whole impact setup and how it is shown live."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from rclpy.node import Node

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names, setup_leaves
from helmet_sim_ros.nodes.parameters import Parameters, renamed, without_prefix
from helmet_sim_ros.schema import Config, Leaf, leaf_values, leaves, quantity


class LiveSettings(Config):
    """How fast an impact runs and how densely it is shown; no influence on its result."""

    real_time_factor: float = quantity(
        "simulated time per wall time; 0: as fast as possible, 0.01: slow motion",
        "-", 0.0, ge=0.0, le=100.0,
    )  # fmt: skip
    publish_rate: float = quantity(
        "messages of each live topic per simulated second", "Hz", 1000.0, ge=1.0, le=1e6
    )


@dataclass(frozen=True)
class SimulationConfig:
    """What the parameters of the simulation node say."""

    setup: ImpactSetup
    live: LiveSettings


#: Says where a helmet file's values come from. No parameter: prose does not survive
#: ``ros2 param load``, which reads every text as YAML.
NOT_A_PARAMETER = "helmet.description"


def simulation_leaves() -> list[Leaf]:
    """Every parameter; those of the helmet with the values of the default helmet."""
    own = list(setup_leaves())
    default = ImpactSetup.model_fields["helmet"].default
    name = Leaf(
        "helmet.name", str, default, "",
        "helmet in config/helmets, or path to a YAML file; changing it resets every helmet.* "
        "value that is not set in the same call",
    )  # fmt: skip
    preset = preset_values(default)
    helmet = [
        replace(leaf, default=preset[leaf.name])
        for leaf in leaves(Helmet, "helmet.")
        if leaf.name in preset
    ]
    return [*own, name, *helmet, *renamed(leaves(LiveSettings), "sim.")]


def preset_values(helmet: str) -> dict[str, Any]:
    """The values of a helmet by parameter name.

    Raises:
        SetupError: unknown helmet, or a refused value in its file.
    """
    if not isinstance(helmet, str):
        raise SetupError.of("helmet.name", helmet, "must be text")
    try:
        values = leaf_values(load_helmet(helmet), "helmet.")
    except SetupError as error:
        if error.source:  # the file itself is bad
            raise
        raise SetupError([p._replace(key="helmet.name") for p in error.problems]) from None
    del values[NOT_A_PARAMETER]
    return values


def configuration(values: Mapping[str, Any]) -> SimulationConfig:
    """The setup of all parameters.

    Raises:
        SetupError: a refused value, with its parameter name.
    """
    names = {f"sim.{leaf.name}" for leaf in leaves(LiveSettings)}
    live = {name: value for name, value in values.items() if name in names}
    preset = preset_values(values["helmet.name"])
    changed = {
        name: value
        for name, value in values.items()
        if name not in names and (name not in preset or preset[name] != value)
    }
    try:
        view = LiveSettings(**without_prefix(live, "sim."))
    except SetupError as error:
        raise SetupError([p._replace(key=f"sim.{p.key}") for p in error.problems]) from None
    return SimulationConfig(setup_from_names(changed), view)


def with_preset(changes: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """Add the values of a newly chosen helmet, except those that are set in the same call."""
    chosen = changes.get("helmet.name", before["helmet.name"])
    if chosen == before["helmet.name"]:
        return dict(changes)
    return preset_values(chosen) | dict(changes)


def declare(node: Node, busy: Any) -> Parameters[SimulationConfig]:
    """Declare every parameter on the simulation node; changes are refused while ``busy()``."""
    return Parameters(node, simulation_leaves(), configuration, with_preset, busy)
