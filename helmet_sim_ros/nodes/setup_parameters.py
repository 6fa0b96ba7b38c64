"""The parameters of the simulation node: a whole impact or fall, and how it is shown live.

``sim.kind`` says which of the two the parameters describe. What only the other one has stands at
its default and is refused otherwise: nothing that is set is without effect.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from rclpy.node import Node

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.fall.setup import Fall, fall_from_names, fall_leaves
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names, setup_leaves
from helmet_sim_ros.nodes.parameters import Parameters, renamed, without_prefix
from helmet_sim_ros.schema import Config, Leaf, leaf_values, leaves, quantity


class LiveSettings(Config):
    """How fast it runs and how densely it is shown; no influence on its result."""

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

    setup: ImpactSetup | Fall
    live: LiveSettings


#: Says where a helmet file's values come from. No parameter: prose does not survive
#: ``ros2 param load``, which reads every text as YAML.
NOT_A_PARAMETER = "helmet.description"


#: What the parameters describe.
KIND = "sim.kind"
IMPACT, FALL = "impact", "fall"
#: The service that runs it.
SERVICES = {IMPACT: "~/run_impact", FALL: "~/run_fall"}


def kind_of(setup: ImpactSetup | Fall) -> str:
    """``impact`` or ``fall``."""
    return FALL if isinstance(setup, Fall) else IMPACT


@lru_cache(maxsize=2)
def leaves_of(kind: str) -> Mapping[str, Leaf]:
    """The values of an impact or a fall without its helmet's, by dotted name."""
    return {leaf.name: leaf for leaf in (fall_leaves() if kind == FALL else setup_leaves())}


def simulation_leaves() -> list[Leaf]:
    """Every parameter; those of the helmet with the values of the default helmet. What impacts and
    falls both have has the default of impacts, and the wider range."""
    impact, fall = leaves_of(IMPACT), leaves_of(FALL)
    own = [_of_both(leaf, fall.get(leaf.name, leaf)) for leaf in impact.values()]
    own += [leaf for leaf in fall.values() if leaf.name not in impact]
    default = ImpactSetup.model_fields["helmet"].default
    kind = Leaf(
        KIND, str, IMPACT, "",
        "what the parameters describe: impact (~/run_impact) or fall (~/run_fall); changing it "
        "resets what only the other one has and what has another default there, unless set in the "
        "same call",
        choices=(IMPACT, FALL),
    )  # fmt: skip
    name = Leaf(
        "helmet.name", str, default, "",
        "helmet in config/helmets, or path to a YAML file; none: a bare head; changing it resets "
        "every helmet.* value that is not set in the same call",
    )  # fmt: skip
    preset = preset_values(default)
    helmet = [
        replace(leaf, default=preset[leaf.name])
        for leaf in leaves(Helmet, "helmet.")
        if leaf.name in preset
    ]
    return [kind, *own, name, *helmet, *renamed(leaves(LiveSettings), "sim.")]


def _of_both(impact: Leaf, fall: Leaf) -> Leaf:
    """A value that impacts and falls both have, as one parameter."""
    if impact == fall:
        return impact
    text = f"{impact.description}; of a fall: {fall.description}"
    if (impact.default, impact.maximum) != (fall.default, fall.maximum):
        text += f", {fall.default:g} unless set, at most {fall.maximum:g} (of an impact: "
        text += f"{impact.default:g}, {impact.maximum:g})"
    highest = max(impact.maximum or 0.0, fall.maximum or 0.0) or None
    return replace(impact, description=text, maximum=highest)


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
        SetupError: a refused value, with its parameter name; one that has no effect.
    """
    kind = values[KIND]
    if kind not in SERVICES:
        raise SetupError.of(KIND, kind, f"must be one of {IMPACT}, {FALL}")
    other = IMPACT if kind == FALL else FALL
    for name, leaf in leaves_of(other).items():
        if name not in leaves_of(kind) and values[name] != leaf.default:
            raise SetupError.of(
                name, values[name], f"has no effect on what {KIND} = {kind} describes; set {KIND} "
                f"to {other} in the same call",
            )  # fmt: skip
    names = {f"sim.{leaf.name}" for leaf in leaves(LiveSettings)}
    live = {name: value for name, value in values.items() if name in names}
    preset = preset_values(values["helmet.name"])
    own = leaves_of(kind).keys() | {"helmet.name"}
    changed = {
        name: value
        for name, value in values.items()
        if name in own or (name in preset and preset[name] != value)
    }
    try:
        view = LiveSettings(**without_prefix(live, "sim."))
    except SetupError as error:
        raise SetupError([p._replace(key=f"sim.{p.key}") for p in error.problems]) from None
    setup = fall_from_names(changed) if kind == FALL else setup_from_names(changed)
    return SimulationConfig(setup, view)


def completed(changes: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """Add what follows from a newly chosen kind or helmet, except what is set in the same call."""
    follows: dict[str, Any] = {}
    kind = changes.get(KIND, before[KIND])
    if kind != before[KIND] and kind in SERVICES:
        left, taken = leaves_of(before[KIND]), leaves_of(kind)
        follows |= {name: leaf.default for name, leaf in left.items() if name not in taken}
        follows |= {
            name: leaf.default
            for name, leaf in taken.items()
            if name not in left or left[name].default != leaf.default
        }
    chosen = changes.get("helmet.name", before["helmet.name"])
    if chosen != before["helmet.name"]:
        follows |= preset_values(chosen)
    return follows | dict(changes)


def parameter_values(setup: ImpactSetup | Fall) -> dict[str, Any]:
    """Every parameter that makes up a setup, so that nothing of an earlier case or client stays; an
    optional value that is not set is ``"unset"``."""
    values = {KIND: kind_of(setup)} | setup.described()
    if isinstance(setup, ImpactSetup):
        values["impact.neck_flexion_deg"] = setup.neck_flexion_deg
    values.pop(NOT_A_PARAMETER, None)
    return {name: "unset" if value is None else value for name, value in values.items()}


def declare(node: Node, busy: Any) -> Parameters[SimulationConfig]:
    """Declare every parameter on the simulation node; changes are refused while ``busy()``."""
    return Parameters(node, simulation_leaves(), configuration, completed, busy)
