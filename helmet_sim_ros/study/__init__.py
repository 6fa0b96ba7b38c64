"""Studies: what is done with many impacts. ROS-free.

A room for each thing: ``scenario``, ``sweeps``, ``optimisation``, ``identification``,
``validation`` and ``certification``. Rooms are nouns, because the verbs are functions: ``sweep``,
``optimise``, ``certify``.
"""

from helmet_sim_ros.lazy import lazy_names

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
    "load_protocol",
    "Protocol",
    "certify",
    "Certification",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "scenario.matrix": ("load_scenario", "Scenario", "Case"),
        "scenario.reference": ("load_reference", "Reference"),
        "sweeps.study": ("load_study", "Study"),
        "sweeps.sweep": ("sweep", "SweepResult"),
        "optimisation.plan": ("load_optimisation", "Optimisation"),
        "optimisation.search": ("optimise",),
        "optimisation.trials": ("OptimisationResult",),
        "certification.protocol": ("load_protocol", "Protocol"),
        "certification.certify": ("certify", "Certification"),
    },
)
