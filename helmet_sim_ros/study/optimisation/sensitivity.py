"""How strongly a design's responses depend on each variable, and on the impact conditions."""

from __future__ import annotations

from collections.abc import Mapping

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.setup import setup_from_names
from helmet_sim_ros.schema import leaf_values
from helmet_sim_ros.study.optimisation.design import Design
from helmet_sim_ros.study.optimisation.plan import Optimisation
from helmet_sim_ros.study.optimisation.trials import Effect, Trial, evaluate_setups
from helmet_sim_ros.study.sweeps.engine import Engine


def sensitivity(plan: Optimisation, engine: Engine, trial: Trial) -> list[Effect]:
    """Every response of a design with each value changed up and down, one at a time.

    The step (``sensitivity.step`` of the file) may leave the range that was searched.

    Raises:
        SetupError: a value that is 0 or not set cannot be changed by a share of it, or the changed
            one is refused.
    """
    step = plan.file.sensitivity.step
    base = plan.design(trial.values)
    names = [*plan.file.variables, *plan.file.sensitivity.names]
    changes = [(name, 1.0 + sign * step) for name in names for sign in (-1.0, 1.0)]
    designs: list[tuple[int, Mapping[str, float], Design]] = []
    setups: dict[int, list[dict[str, object]]] = {}
    for number, (name, factor) in enumerate([("", 1.0), *changes]):
        changed = base
        if name in plan.file.variables:
            changed = plan.design({**trial.values, name: trial.values[name] * factor})
        mine = plan.setups(changed)
        if name and name not in plan.file.variables:
            mine = [{**values, name: _scaled(values, name, factor)} for values in mine]
        designs.append((number, trial.values, changed))
        setups[number] = mine
    found = {t.number: t for t in evaluate_setups(plan, engine, designs, setups)}
    for t in found.values():
        if t.error is not None:
            raise SetupError.of(
                "sensitivity", changes[t.number - 1][0] if t.number else "", t.error
            )
    effects = []
    for i, name in enumerate(names):
        low, high = found[1 + 2 * i], found[2 + 2 * i]
        for response, value in found[0].responses.items():
            pair = low.responses[response], high.responses[response]
            slope = (pair[1] - pair[0]) / (2.0 * step * value) if value else 0.0
            effects.append(Effect(name, response, value, *pair, slope))
    return effects


def _scaled(values: Mapping[str, object], name: str, factor: float) -> float:
    setup = setup_from_names(values)
    current = {
        **setup.described(),
        **{f"rider.{k}": v for k, v in leaf_values(setup.rider).items()},
    }
    value = current[name]
    if not value:
        raise SetupError.of("sensitivity.names", name, "is 0 or unset in an impact: no share of it")
    return float(value) * factor
