"""Impact logs: MCAP files that any ROS 2 tool opens and that read back without ROS."""

from helmet_sim_ros.lazy import lazy_names

__all__ = ["ImpactLog", "LoggedImpact", "open_log", "read_impacts"]

__getattr__, __dir__ = lazy_names(
    __name__, {"reader": ("ImpactLog", "LoggedImpact", "open_log", "read_impacts")}
)
