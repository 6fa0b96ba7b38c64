"""Open simulation of helmeted two-wheeler riders: MuJoCo physics, ROS 2 nodes, MCAP logs.

The names below load on first use, so that importing the package costs nothing::

    from helmet_sim_ros import ImpactSetup, evaluate, simulate

    record = simulate(ImpactSetup(normal_velocity=7.5, tangential_velocity=5.0))
    print(evaluate(record).peak_g)
"""

from typing import TYPE_CHECKING, Any

from helmet_sim_ros.lazy import lazy_names

if TYPE_CHECKING:
    from helmet_sim_ros.biomech.evaluation import Evaluation, evaluate
    from helmet_sim_ros.biomech.record import ImpactRecord
    from helmet_sim_ros.mcap_log import open_log
    from helmet_sim_ros.model.impact import simulate
    from helmet_sim_ros.model.setup import ImpactSetup, Rider
    from helmet_sim_ros.study import optimise, sweep

__all__ = [
    "ImpactSetup",
    "Rider",
    "simulate",
    "evaluate",
    "open_log",
    "sweep",
    "optimise",
    "ImpactRecord",
    "Evaluation",
]

_load = lazy_names(
    __name__,
    {
        "model.setup": ("ImpactSetup", "Rider"),
        "model.impact": ("simulate",),
        "biomech.evaluation": ("evaluate", "Evaluation"),
        "biomech.record": ("ImpactRecord",),
        "mcap_log": ("open_log",),
        "study": ("sweep", "optimise"),
    },
)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    return _load(name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__, "__version__"])
