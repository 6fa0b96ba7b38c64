"""Open simulation of helmeted two-wheeler riders: MuJoCo physics, ROS 2 nodes, MCAP logs.

The names below load on first use, so that importing the package costs nothing::

    from helmet_sim_ros import ImpactSetup, evaluate, simulate

    record = simulate(ImpactSetup(normal_velocity=7.5, tangential_velocity=5.0))
    print(evaluate(record).peak_g)
"""

from helmet_sim_ros.lazy import lazy_names
from helmet_sim_ros.views import register_views

__all__ = [
    "ImpactSetup",
    "Fall",
    "Rider",
    "simulate",
    "evaluate",
    "head_strikes",
    "open_log",
    "compare",
    "sweep",
    "optimise",
    "certify",
    "ImpactRecord",
    "Evaluation",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "model.setup": ("ImpactSetup",),
        "model.rider.properties": ("Rider",),
        "model.fall.setup": ("Fall",),
        "model.fall.strikes": ("head_strikes",),
        "model.simulate": ("simulate",),
        "biomech.evaluation": ("evaluate", "Evaluation"),
        "biomech.record": ("ImpactRecord",),
        "mcap_log": ("open_log",),
        "present.comparison": ("compare",),
        "study": ("sweep", "optimise", "certify"),
        "version": ("__version__",),
    },
)

register_views(
    __name__,
    {
        "present.figure": ("record_figure",),
        "present.frames": ("sample_frame", "criteria_frame"),
        "present.html": ("record_html", "evaluation_html", "setup_html"),
        "present.words": ("record_text", "evaluation_text"),
    },
)
