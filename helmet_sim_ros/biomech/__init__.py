"""Head-injury and helmet criteria, free of physics engine and ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING

# At once: a lazy function would be hidden by its module of the same name.
from helmet_sim_ros.biomech.hic import Hic, hic
from helmet_sim_ros.lazy import lazy_names

if TYPE_CHECKING:
    from helmet_sim_ros.biomech.catalogue import CATALOGUE, HEADLINE
    from helmet_sim_ros.biomech.evaluation import evaluate
    from helmet_sim_ros.biomech.filters import SampleRateWarning, cfc, cfc_coefficients
    from helmet_sim_ros.biomech.helmet import (
        Energy,
        bottoming,
        coupling_energy,
        impulse_ratio,
        instant_force_ratio,
        peak_force_ratio,
        restitution,
    )
    from helmet_sim_ros.biomech.linear import (
        Span,
        clip,
        dwell,
        gsi,
        hic_d,
        pulse_duration,
        sfc,
        velocity_change,
    )
    from helmet_sim_ros.biomech.neck import NeckLoads, neck_loads
    from helmet_sim_ros.biomech.record import ImpactRecord
    from helmet_sim_ros.biomech.result import Criterion, Evaluation
    from helmet_sim_ros.biomech.risk import risk_bric, risk_lognormal, risk_prasad_mertz
    from helmet_sim_ros.biomech.rotation import bric, damage, klc, ric, to_head_axes, ubric
    from helmet_sim_ros.biomech.standards import load_standard, standard_names

__all__ = [
    "CATALOGUE",
    "HEADLINE",
    "Criterion",
    "Energy",
    "Evaluation",
    "Hic",
    "ImpactRecord",
    "NeckLoads",
    "SampleRateWarning",
    "Span",
    "bottoming",
    "bric",
    "cfc",
    "cfc_coefficients",
    "clip",
    "coupling_energy",
    "damage",
    "dwell",
    "evaluate",
    "gsi",
    "hic",
    "hic_d",
    "impulse_ratio",
    "instant_force_ratio",
    "klc",
    "load_standard",
    "neck_loads",
    "peak_force_ratio",
    "pulse_duration",
    "restitution",
    "ric",
    "risk_bric",
    "risk_lognormal",
    "risk_prasad_mertz",
    "sfc",
    "standard_names",
    "to_head_axes",
    "ubric",
    "velocity_change",
]

__getattr__ = lazy_names(
    __name__,
    {
        "catalogue": ("CATALOGUE", "HEADLINE"),
        "evaluation": ("evaluate",),
        "filters": ("SampleRateWarning", "cfc", "cfc_coefficients"),
        "helmet": (
            "Energy",
            "bottoming",
            "coupling_energy",
            "impulse_ratio",
            "instant_force_ratio",
            "peak_force_ratio",
            "restitution",
        ),
        "linear": (
            "Span",
            "clip",
            "dwell",
            "gsi",
            "hic_d",
            "pulse_duration",
            "sfc",
            "velocity_change",
        ),
        "neck": ("NeckLoads", "neck_loads"),
        "record": ("ImpactRecord",),
        "result": ("Criterion", "Evaluation"),
        "risk": ("risk_bric", "risk_lognormal", "risk_prasad_mertz"),
        "rotation": ("bric", "damage", "klc", "ric", "to_head_axes", "ubric"),
        "standards": ("load_standard", "standard_names"),
    },
)
