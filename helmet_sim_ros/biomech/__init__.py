"""Head-injury and helmet criteria, free of physics engine and ROS."""

from __future__ import annotations

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.helmet import peak_force_ratio
from helmet_sim_ros.biomech.hic import Hic, hic
from helmet_sim_ros.biomech.linear import Span, clip, pulse_duration
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.biomech.standards import load_standard, standard_names

__all__ = [
    "Criterion",
    "Evaluation",
    "Hic",
    "ImpactRecord",
    "Span",
    "clip",
    "evaluate",
    "hic",
    "load_standard",
    "peak_force_ratio",
    "pulse_duration",
    "standard_names",
]
