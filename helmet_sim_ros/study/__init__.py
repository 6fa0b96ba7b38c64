"""Studies: scenario matrices and what is done with them. ROS-free."""

from helmet_sim_ros.study.reference import Reference, load_reference
from helmet_sim_ros.study.scenario import Case, Scenario, load_scenario
from helmet_sim_ros.study.study import Study, load_study
from helmet_sim_ros.study.sweeper import SweepResult, sweep

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
]
