"""Studies: scenario matrices and what is done with them. ROS-free."""

from typing import TYPE_CHECKING

from helmet_sim_ros.lazy import lazy_names

if TYPE_CHECKING:
    from helmet_sim_ros.study.optimisation import Optimisation, load_optimisation
    from helmet_sim_ros.study.optimiser import optimise
    from helmet_sim_ros.study.reference import Reference, load_reference
    from helmet_sim_ros.study.scenario import Case, Scenario, load_scenario
    from helmet_sim_ros.study.study import Study, load_study
    from helmet_sim_ros.study.sweeper import SweepResult, sweep
    from helmet_sim_ros.study.trials import OptimisationResult

__all__ = [
    "load_scenario",
    "Scenario",
    "Case",
    "load_reference",
    "Reference",
    "load_study",
    "Study",
    "sweep",
    "SweepResult",
    "load_optimisation",
    "Optimisation",
    "optimise",
    "OptimisationResult",
]

__getattr__ = lazy_names(
    __name__,
    {
        "scenario": ("load_scenario", "Scenario", "Case"),
        "reference": ("load_reference", "Reference"),
        "study": ("load_study", "Study"),
        "sweeper": ("sweep", "SweepResult"),
        "optimisation": ("load_optimisation", "Optimisation"),
        "optimiser": ("optimise",),
        "trials": ("OptimisationResult",),
    },
)
