"""Open simulation of helmeted two-wheeler riders: MuJoCo physics, ROS 2 nodes, MCAP logs.

The names below load on first use, so that importing the package costs nothing::

    from helmet_sim_ros import ImpactSetup, evaluate, simulate

    record = simulate(ImpactSetup(normal_velocity=7.5, tangential_velocity=5.0))
    print(evaluate(record).peak_g)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helmet_sim_ros.biomech.evaluation import Evaluation, evaluate
    from helmet_sim_ros.biomech.record import ImpactRecord
    from helmet_sim_ros.mcap_log import open_log
    from helmet_sim_ros.model.impact import simulate
    from helmet_sim_ros.model.setup import ImpactSetup, Rider

__all__ = [
    "ImpactSetup",
    "Rider",
    "simulate",
    "evaluate",
    "open_log",
    "ImpactRecord",
    "Evaluation",
]

_HOMES = {
    "ImpactSetup": "model.setup",
    "Rider": "model.setup",
    "simulate": "model.impact",
    "evaluate": "biomech.evaluation",
    "Evaluation": "biomech.evaluation",
    "ImpactRecord": "biomech.record",
    "open_log": "mcap_log",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__, "__version__"])
