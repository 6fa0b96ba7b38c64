"""What every process of ours tells the middleware before it starts, unless the user chose."""

from __future__ import annotations

import os

from helmet_sim_ros.resources import share_directory


def prepare_environment(domain_id: int | None = None) -> None:
    """Set the environment of this process and its children; values the user set stay.

    ROS traffic stays on this host, and Fast DDS repeats lost samples at once
    (``config/middleware/fastdds.xml``).

    Args:
        domain_id: the ROS domain; None: ``ROS_DOMAIN_ID`` as it is.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    # The first name is Fast DDS 2's (ROS 2 Jazzy), the second Fast DDS 3's.
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
    if not any(name in os.environ for name in names):
        profiles = str(share_directory() / "config" / "middleware" / "fastdds.xml")
        os.environ.update(dict.fromkeys(names, profiles))
    if domain_id is not None:
        os.environ["ROS_DOMAIN_ID"] = str(domain_id)
