"""Impact logs: MCAP files that any ROS 2 tool opens and that read back without ROS."""

from typing import TYPE_CHECKING

from helmet_sim_ros.lazy import lazy_names

if TYPE_CHECKING:
    from helmet_sim_ros.mcap_log.reader import ImpactLog, LoggedImpact, open_log, read_impacts

__all__ = ["ImpactLog", "LoggedImpact", "open_log", "read_impacts"]

__getattr__ = lazy_names(
    __name__, {"reader": ("ImpactLog", "LoggedImpact", "open_log", "read_impacts")}
)
